#include "rhec/core/prior/matern_prior.hpp"

#include <algorithm>

namespace rhec {

void MaternPrior::set_up(const Variable& parameter) {
  const ParameterRange range(parameter);
  matern_ = {law_.states, law_.length, law_.sigma.value_or(0.15 * range.width)};
  mean_ = law_.mean.value_or(range.mean);
  mean_sigma_ = law_.mean_sigma.value_or(0.2 * range.width);
  mean_rate_ = law_.mean_rate.value_or(0.005 * range.width);
}

std::span<const ProcessState> MaternPrior::states() const noexcept {
  static constexpr ProcessState half[] = {ProcessState::value, ProcessState::mean};
  static constexpr ProcessState three_halves[] = {ProcessState::value, ProcessState::slope, ProcessState::mean};
  static constexpr ProcessState five_halves[] = {ProcessState::value, ProcessState::slope, ProcessState::curvature,
                                                 ProcessState::mean};
  if (law_.states == 1) return half;
  if (law_.states == 2) return three_halves;
  return five_halves;
}

// With the deviation e from the mean m, the states are [m + e; e'; e''; m].

void MaternPrior::start(double* mean, double* covariance) const noexcept {
  const int n = state_count(), last = n - 1;
  std::fill_n(mean, n, 0.0);
  std::fill_n(covariance, n * n, 0.0);
  mean[0] = mean[last] = mean_;
  matern_.stationary(covariance, n);
  const double variance = mean_sigma_ * mean_sigma_;
  covariance[0] += variance;
  covariance[last * n] += variance;
  covariance[last] += variance;
  covariance[last * n + last] += variance;
}

void MaternPrior::advance(double d, double* F, double* Q) const noexcept {
  const int n = state_count(), last = n - 1;
  std::fill_n(F, n * n, 0.0);
  std::fill_n(Q, n * n, 0.0);
  matern_.transition(d, F, Q, n);
  // The mean's part of z[0] does not decay.
  for (int r = 0; r < last; ++r) F[last * n + r] = (r == 0 ? 1.0 : 0.0) - F[r];
  F[last * n + last] = 1.0;
  const double variance = mean_rate_ * mean_rate_ * d;
  Q[0] += variance;
  Q[last * n] += variance;
  Q[last] += variance;
  Q[last * n + last] += variance;
}

}  // namespace rhec
