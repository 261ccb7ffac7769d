#include "rhec/core/qp/stage_checks.hpp"

#include "qp_view.hpp"
#include "rhec/core/kernels/kernel_sets.hpp"
#include "rhec/core/kernels/qp_kernels.hpp"

namespace rhec {

StepCheck check_step(const StageQp& qp, const Iterate& step, double tolerance) noexcept {
  const auto [is_finite, violates, largest_costate] = qp_kernels().check_step(view_of(qp, step), tolerance);
  return {.is_finite = is_finite, .violates = violates, .largest_costate = largest_costate};
}

bool mark_bounds(const StageQp& qp, const Iterate& iterate, double tolerance, std::uint8_t* marks) noexcept {
  return qp_kernels().mark_bounds(view_of(qp, iterate), tolerance, marks);
}

ViolatedBounds find_violations(const double* values, const double* least, const double* most, int count,
                               double* violations) noexcept {
  const auto [largest, violated] = qp_kernels().find_violations(values, least, most, count, violations);
  return {.largest = largest, .count = violated};
}

void widen_bounds(const double* lower, const double* upper, double tolerance, int count, double* least,
                  double* most) noexcept {
  qp_kernels().widen_bounds(lower, upper, tolerance, count, least, most);
}

void add_to_step(int intervals, const Iterate& from, Iterate& step) noexcept {
  const std::ptrdiff_t count = static_cast<std::ptrdiff_t>(intervals + 1) * from.capacity().row();
  qp_kernels().add(from.row(0), step.row(0), count);
}

}  // namespace rhec
