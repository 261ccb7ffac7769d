#include "rhec/core/prior/walk_prior.hpp"

namespace rhec {

void WalkPrior::set_up(const Variable& parameter) {
  const ParameterRange range(parameter);
  mean_ = walk_.mean.value_or(range.mean);
  sigma_ = walk_.mean_sigma.value_or(0.2 * range.width);
}

std::span<const ProcessState> WalkPrior::states() const noexcept {
  static constexpr ProcessState all[] = {ProcessState::value};
  return all;
}

void WalkPrior::start(double* mean, double* covariance) const noexcept {
  mean[0] = mean_;
  covariance[0] = sigma_ * sigma_;
}

void WalkPrior::advance(double d, double* F, double* Q) const noexcept {
  F[0] = 1.0;
  Q[0] = walk_.rate * walk_.rate * d;
}

}  // namespace rhec
