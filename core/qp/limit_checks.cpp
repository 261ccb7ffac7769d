#include "limit_checks.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "qp_view.hpp"
#include "rhec/core/base/infinity.hpp"
#include "rhec/core/kernels/kernel_sets.hpp"
#include "tolerances.hpp"

namespace rhec {

bool guess_limits(const StageQp& qp, const Iterate& iterate, ActiveSet& active) noexcept {
  bool any = false;
  for (int i = 0; i <= qp.intervals(); ++i) {
    const double *multipliers = iterate.limit_bound(i), *linears = qp.limit_linear(i);
    for (int r = 0; r < qp.limits(i); ++r) {
      const double multiplier = multipliers[r], linear = linears[r];
      std::int8_t side = 0;
      if (multiplier == 0.0 && linear < infinity) {
        active.limit(i)[r] = side;
        continue;
      }
      const double lower = qp.limit_lower(i)[r], upper = qp.limit_upper(i)[r], size = std::abs(multiplier);
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
  return !qp_kernels().limits_are_sound(view_of_limits(qp), tolerance);
}

void add_row(const double* row, double weight, double gradient, int stride, double* H, double* h) noexcept {
  for (int c = 0; c < stride; ++c) {
    if (row[c] == 0.0) continue;
    h[c] += gradient * row[c];
    for (int j = 0; j < stride; ++j) H[c * stride + j] += weight * row[c] * row[j];
  }
}

}  // namespace rhec
