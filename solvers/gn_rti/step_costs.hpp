#pragma once

// What a step of a stage QP does to its limits, as far as the linearisation knows.

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "rhec/core/qp/iterate.hpp"
#include "rhec/core/qp/stage_qp.hpp"

namespace rhec::gn_rti {

/// The distance of a limit's value beyond its side after a step, as far as the linearisation knows.
inline double excess_after(const StageQp& qp, const Iterate& step, int stage, int r) noexcept {
  const double* row = qp.G(stage) + static_cast<std::ptrdiff_t>(r) * qp.stride();
  double value = 0.0;
  for (int j = 0; j < qp.capacity().states + qp.controls(stage); ++j) value += row[j] * step.row(stage)[j];
  return std::max({0.0, qp.limit_lower(stage)[r] - value, value - qp.limit_upper(stage)[r]});
}

/// What the slacks cost after a step.
inline double slack_costs_after(const StageQp& qp, const Iterate& step) noexcept {
  double costs = 0.0;
  for (int i = 0; i <= qp.intervals(); ++i) {
    for (int r = 0; r < qp.limits(i); ++r) {
      const double linear = qp.limit_linear(i)[r];
      if (!std::isfinite(linear)) continue;
      const double slack = excess_after(qp, step, i, r);
      costs += (linear + 0.5 * qp.limit_quadratic(i)[r] * slack) * slack;
    }
  }
  return costs;
}

/// Sum by which hard limits are violated after a step, as far as the linearisation knows.
inline double violation_after(const StageQp& qp, const Iterate& step) noexcept {
  double violation = 0.0;
  for (int i = 0; i <= qp.intervals(); ++i)
    for (int r = 0; r < qp.limits(i); ++r)
      if (!std::isfinite(qp.limit_linear(i)[r])) violation += excess_after(qp, step, i, r);
  return violation;
}

inline double largest_gradient(const StageQp& qp) noexcept {
  double largest = 0.0;
  for (int i = 0; i <= qp.intervals(); ++i)
    for (int j = 0; j < qp.stride(); ++j) largest = std::max(largest, std::abs(qp.h(i)[j]));
  return largest;
}

}  // namespace rhec::gn_rti
