#include "rhec/core/kalman_filter.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "rhec/core/rhe_problem.hpp"

namespace rhec {

KalmanFilter::KalmanFilter(std::shared_ptr<const Model> model, Noise noise, int substeps)
    : model_(std::move(model)),
      noise_(std::move(noise)),
      substeps_(substeps),
      nx_(model_->state_count()),
      nu_(model_->input_count()),
      np_(model_->parameter_count()),
      ny_(model_->output_count()) {
  const int n = nx_ + np_;
  mean = Eigen::VectorXd::Zero(n);
  covariance = Eigen::MatrixXd::Identity(n, n);
  predicted_.assign(ny_, 0.0);
  output_jacobian_.assign(static_cast<std::size_t>(ny_) * nx_, 0.0);
  next_.assign(nx_, 0.0);
  jacobian_.assign(static_cast<std::size_t>(nx_) * (nx_ + nu_ + 2 * np_), 0.0);
  input_.assign(nu_, 0.0);
  transition_ = Eigen::MatrixXd::Identity(n, n);
  input_map_ = Eigen::MatrixXd::Zero(n, nu_ + np_);
  work_ = next_covariance_ = Eigen::MatrixXd::Zero(n, n);
  gain_ = row_ = correction_ = Eigen::VectorXd::Zero(n);
}

void KalmanFilter::clip() noexcept {
  for (int j = 0; j < np_; ++j)
    mean[nx_ + j] = std::min(std::max(mean[nx_ + j], noise_.parameter_lower[j]), noise_.parameter_upper[j]);
}

void KalmanFilter::update(const double* y, const double* robust_weights) noexcept {
  Model::Nodes request;
  request.count = 1;
  request.states = mean.data();
  request.outputs = predicted_.data();
  request.jacobians = output_jacobian_.data();
  model_->observe(request);
  // One output after the other, all linearised at the same point; noises are independent.
  correction_.setZero();
  for (int j = 0; j < ny_; ++j)
    if (std::isfinite(y[j]))
      take_output(j, y[j], noise_.output_variances[j] / (robust_weights ? robust_weights[j] : 1.0));
  mean += correction_;
  clip();
}

void KalmanFilter::take_output(int output, double measured, double variance) noexcept {
  const int n = nx_ + np_;
  double innovation = model_->description().outputs[output].is_angle ? angle_difference(measured, predicted_[output])
                                                                     : measured - predicted_[output];
  row_.setZero();
  for (int c = 0; c < nx_; ++c) row_[c] = output_jacobian_[c * ny_ + output];
  innovation -= row_.dot(correction_);
  gain_.noalias() = covariance.lazyProduct(row_);
  const double total = row_.dot(gain_) + variance;
  if (!(total > 0.0)) return;
  gain_ /= total;
  // Joseph's form, (I - k h') Pi (I - k h')' + k r k': it stays positive semidefinite, and exact where a vague prior
  // meets a good measurement.
  work_.setIdentity();
  for (int c = 0; c < n; ++c)
    for (int r = 0; r < n; ++r) work_(r, c) -= gain_[r] * row_[c];
  transition_.noalias() = work_.lazyProduct(covariance);
  next_covariance_.noalias() = transition_.lazyProduct(work_.transpose());
  for (int c = 0; c < n; ++c)
    for (int r = 0; r < n; ++r) next_covariance_(r, c) += gain_[r] * variance * gain_[c];
  if (!std::isfinite(innovation) || !gain_.allFinite() || !next_covariance_.allFinite()) return;
  correction_ += gain_ * innovation;
  for (int c = 0; c < n; ++c)
    for (int r = 0; r < n; ++r) covariance(r, c) = 0.5 * (next_covariance_(r, c) + next_covariance_(c, r));
}

void KalmanFilter::predict(const double* measured_input, const double* input_guess, double duration) noexcept {
  predict(measured_input, input_guess, duration, nullptr);
}

void KalmanFilter::predict(const double* measured_input, const double* input_guess, double duration,
                           const double* ramp_variances) noexcept {
  const int n = nx_ + np_;
  for (int j = 0; j < nu_; ++j) input_[j] = std::isfinite(measured_input[j]) ? measured_input[j] : input_guess[j];
  Model::Intervals request;
  request.count = 1;
  request.states = mean.data();
  request.inputs = input_.data();
  request.parameters = mean.data() + nx_;
  request.parameters_end = ramp_variances ? request.parameters : nullptr;
  request.durations = &duration;
  request.substeps = substeps_;
  request.next_states = next_.data();
  request.jacobians = jacobian_.data();
  model_->integrate(request);
  transition_.setIdentity();
  for (int r = 0; r < nx_; ++r) {
    for (int c = 0; c < nx_; ++c) transition_(r, c) = jacobian_[c * nx_ + r];
    for (int c = 0; c < np_; ++c) {
      transition_(r, nx_ + c) = jacobian_[(nx_ + nu_ + c) * nx_ + r];
      if (ramp_variances) transition_(r, nx_ + c) += jacobian_[(nx_ + nu_ + np_ + c) * nx_ + r];
    }
  }
  // Noise enters through the inputs and, on a ramp, through the change of the parameter over the interval.
  for (int c = 0; c < nu_; ++c) {
    const double wide = 100.0 * model_->description().inputs[c].scale;
    const double sigma = std::isfinite(measured_input[c]) ? std::sqrt(noise_.input_variances[c]) : wide;
    for (int r = 0; r < nx_; ++r) input_map_(r, c) = jacobian_[(nx_ + c) * nx_ + r] * sigma;
  }
  for (int c = 0; c < np_; ++c) {
    const double sigma = ramp_variances ? std::sqrt(ramp_variances[c]) : 0.0;
    input_map_.col(nu_ + c).setZero();
    if (sigma == 0.0) continue;
    for (int r = 0; r < nx_; ++r) input_map_(r, nu_ + c) = jacobian_[(nx_ + nu_ + np_ + c) * nx_ + r] * sigma;
    input_map_(nx_ + c, nu_ + c) = sigma;
  }
  work_.noalias() = transition_.lazyProduct(covariance);
  next_covariance_.noalias() = work_.lazyProduct(transition_.transpose());
  next_covariance_.noalias() += input_map_.lazyProduct(input_map_.transpose());
  const bool finite = std::all_of(next_.begin(), next_.end(), [](double value) { return std::isfinite(value); });
  if (!finite || !next_covariance_.allFinite()) return;
  for (int c = 0; c < n; ++c)
    for (int r = 0; r < n; ++r) covariance(r, c) = 0.5 * (next_covariance_(r, c) + next_covariance_(c, r));
  std::copy(next_.begin(), next_.end(), mean.data());
}

void KalmanFilter::add_parameter_variance(int parameter, double variance) noexcept {
  covariance(nx_ + parameter, nx_ + parameter) += variance;
}

void KalmanFilter::restart_parameter(int parameter, double variance) noexcept {
  const int i = nx_ + parameter;
  covariance.row(i).setZero();
  covariance.col(i).setZero();
  covariance(i, i) = variance;
}

}  // namespace rhec
