#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include "rhec/core/horizon/measured_interval.hpp"

namespace rhec {

/// Gauss-Newton steps to where outputs of motion put an interval, at most, and the length in standard deviations below
/// which a step need not be taken.
inline constexpr int most_look_ahead_steps = 5;
inline constexpr double least_look_ahead_step = 0.25;

/// Whether outputs of motion are measured between an interval's nodes, or among those of its end (n_y, or null): such
/// an interval is linearised where its measurements put it.
inline bool measures_motion(const std::vector<int>& motion_outputs, const MeasuredInterval& interval,
                            std::size_t output_count, Measured end_outputs) noexcept {
  const auto has_motion = [&](const double* y) {
    return std::ranges::any_of(motion_outputs, [y](int j) { return !std::isnan(y[j]); });
  };
  if (end_outputs && has_motion(end_outputs.values)) return true;
  for (int k = 0; k < interval.between; ++k)
    if (has_motion(interval.outputs + k * output_count)) return true;
  return false;
}

}  // namespace rhec
