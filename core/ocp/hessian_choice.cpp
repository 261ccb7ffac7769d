#include "rhec/core/ocp/hessian_choice.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace rhec {

void HessianChoice::setup(const Ocp& ocp) {
  ocp_ = &ocp;
  first_ = ocp.preferred_hessian();
  const Ocp::StepOperations of = ocp.step_operations();
  exact_.clear();
  if (first_ == Hessian::exact &&
      of.exact - of.gauss_newton > std::max(few_operations, modest_share * of.gauss_newton)) {
    if (of.exact > high_cost * of.gauss_newton) first_ = Hessian::gauss_newton;
    qp_ = StageQp(ocp.capacity());
    exact_.assign(static_cast<std::size_t>(ocp.capacity().intervals) + 1, 0.0);
  }
  reset();
}

void HessianChoice::reset() noexcept {
  now_ = first_;
  is_open_ = !exact_.empty();
  steps_ = 0;
  kappa_ = -1.0;
  largest_residual_ = 0.0;
}

void HessianChoice::step(const Iterate& before, const Iterate& after, double residual,
                         std::span<double> scratch) noexcept {
  if (!is_open_) return;
  ++steps_;
  if (now_ == Hessian::gauss_newton && steps_ < trial_steps && residual <= largest_residual_) return;
  largest_residual_ = std::max(largest_residual_, residual);
  kappa_ = measure(before, after, scratch);
  if (!(kappa_ < small_kappa)) {  // also where it is no number
    now_ = Hessian::exact;
    is_open_ = false;
  } else if (steps_ >= trial_steps) {
    now_ = Hessian::gauss_newton;
    steps_ = 0;
  }
}

double HessianChoice::measure(const Iterate& before, const Iterate& after, std::span<double> scratch) noexcept {
  const int N = ocp_->intervals();
  ocp_->linearise(all_stages(*ocp_), after, Hessian::exact, qp_, scratch);
  for (int i = 0; i <= N; ++i) exact_[static_cast<std::size_t>(i)] = curvature(i, before, after);
  ocp_->linearise(all_stages(*ocp_), after, Hessian::gauss_newton, qp_, scratch);
  double added = 0.0, known = 0.0;
  for (int i = 0; i <= N; ++i) {
    const double here = curvature(i, before, after);
    added += std::abs(exact_[static_cast<std::size_t>(i)] - here);
    known += here;
  }
  return added == 0.0 ? 0.0 : added / known;
}

double HessianChoice::curvature(int stage, const Iterate& before, const Iterate& after) const noexcept {
  const int states = ocp_->state_count(stage), controls = stage < ocp_->intervals() ? ocp_->control_count(stage) : 0;
  const int first_control = ocp_->capacity().states, end = first_control + controls;
  const double *from = before.row(stage), *to = after.row(stage), *H = qp_.H(stage);
  const auto next = [&](int k) { return k + 1 == states ? first_control : k + 1; };
  double sum = 0.0;
  for (int r = 0; r < end; r = next(r)) {
    const double* row = H + static_cast<std::ptrdiff_t>(r) * qp_.stride();
    double product = 0.0;
    for (int c = 0; c < end; c = next(c)) product += row[c] * (to[c] - from[c]);
    sum += (to[r] - from[r]) * product;
  }
  return sum;
}

}  // namespace rhec
