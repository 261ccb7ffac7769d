#include "limit_checks.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "rhec/core/base/infinity.hpp"
#include "tolerances.hpp"

namespace rhec {

bool guess_limits(const StageQp& qp, const Iterate& iterate, ActiveSet& active) noexcept {
  bool any = false;
  for (int i = 0; i <= qp.intervals(); ++i) {
    for (int r = 0; r < qp.limits(i); ++r) {
      const double multiplier = iterate.limit_bound(i)[r], lower = qp.limit_lower(i)[r], upper = qp.limit_upper(i)[r];
      const double linear = qp.limit_linear(i)[r], size = std::abs(multiplier);
      std::int8_t side = 0;
      if (multiplier > 0.0 && std::isfinite(upper)) side = 1;
      if (multiplier < 0.0 && std::isfinite(lower)) side = -1;
      if (linear == infinity && is_equality(lower, upper)) side = 1;
      if (side != 0 && size >= linear * (1.0 - multiplier_tolerance)) side = static_cast<std::int8_t>(2 * side);
      active.limit(i)[r] = side;
      any = any || side != 0;
    }
  }
  return any;
}

bool limits_cross(const StageQp& qp, double tolerance) noexcept {
  double sums[8] = {};  // stay 0 as long as all entries are finite
  for (int i = 0; i <= qp.intervals(); ++i) {
    const double *least = qp.limit_lower(i), *most = qp.limit_upper(i), *linears = qp.limit_linear(i);
    for (int r = 0; r < qp.limits(i); ++r) {
      const double lower = least[r], upper = most[r], linear = linears[r];
      const bool is_soft = linear < infinity, is_empty = lower == infinity || upper == -infinity;
      if (std::isnan(lower) || std::isnan(upper) || is_empty || !(linear >= 0.0)) return true;
      if (is_soft && !(linear + qp.limit_quadratic(i)[r] > 0.0)) return true;
      if (lower - upper > tolerance * (1.0 + std::abs(lower))) return true;
    }
    const double *G = qp.G(i), *end = G + static_cast<std::ptrdiff_t>(qp.limits(i)) * qp.stride();
    for (; G < end; G += 8)
      for (int j = 0; j < 8; ++j) sums[j] += 0.0 * G[j];
  }
  return std::any_of(sums, sums + 8, [](double sum) { return sum != 0.0; });
}

void add_row(const double* row, double weight, double gradient, int stride, double* H, double* h) noexcept {
  for (int c = 0; c < stride; ++c) {
    if (row[c] == 0.0) continue;
    h[c] += gradient * row[c];
    for (int j = 0; j < stride; ++j) H[c * stride + j] += weight * row[c] * row[j];
  }
}

}  // namespace rhec
