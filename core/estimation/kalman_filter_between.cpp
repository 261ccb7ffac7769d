// How a KalmanFilter uses measurements between two nodes, and where it linearises an interval with outputs of motion.
#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>

#include "look_ahead.hpp"
#include "rhec/core/base/angle.hpp"
#include "rhec/core/base/assertion.hpp"
#include "rhec/core/estimation/kalman_filter.hpp"

namespace rhec {

/// What is unknown within an interval are [x; p] at its start, the input, and the change of p. Measurements at later
/// times tell of all of these; only then they move to the interval's end.
void KalmanFilter::predict(const MeasuredInterval& interval, const double* input_guess, const double* ramp_variances,
                           const double* robust_weights, const double* end_outputs) noexcept {
  between_log_likelihood_ = 0.0;
  const bool is_ahead = looks_ahead(noise_.motion_outputs, interval, static_cast<std::size_t>(ny_), end_outputs);
  if (interval.between == 0 && !is_ahead)
    return predict(interval.inputs, input_guess, interval.duration, ramp_variances);
  RHEC_ASSERT(wide_mean_.size() > 0, "a filter that was set up for measurements between nodes");
  for (int j = 0; j < nu_; ++j) {
    input_[j] = std::isnan(interval.inputs[j]) ? input_guess[j] : interval.inputs[j];
    wide_gradient_[nx_ + np_ + j] = input_variance(j, interval.inputs);
  }
  widen(ramp_variances);
  for (int k = 0; k < interval.between; ++k)
    take_between(interval.times[k], interval.times[k] / interval.duration,
                 interval.outputs + static_cast<std::ptrdiff_t>(k) * ny_,
                 robust_weights ? robust_weights + static_cast<std::ptrdiff_t>(k) * ny_ : nullptr);
  linearise_wide(interval.duration, is_ahead ? end_outputs : nullptr);
  narrow();
}

/// From [x; p]; the variances of the inputs stand in their entries of the gradient.
void KalmanFilter::widen(const double* ramp_variances) noexcept {
  const int n = nx_ + np_;
  wide_covariance_.setZero();
  for (int c = 0; c < n; ++c) {
    wide_mean_[c] = mean[c];
    for (int r = 0; r < n; ++r) wide_covariance_(r, c) = covariance(r, c);
  }
  for (int j = 0; j < nu_; ++j) {
    wide_mean_[n + j] = input_[j];
    wide_covariance_(n + j, n + j) = wide_gradient_[n + j];
  }
  for (int j = 0; j < np_; ++j) {
    wide_mean_[n + nu_ + j] = 0.0;
    wide_covariance_(n + nu_ + j, n + nu_ + j) = ramp_variances ? ramp_variances[j] : 0.0;
  }
}

/// Next state and Jacobian at a time within the interval, or at its end.
void KalmanFilter::integrate_wide(const Eigen::VectorXd& wide, double seconds, double share) noexcept {
  const int n = nx_ + np_;
  for (int j = 0; j < np_; ++j) wide_end_[j] = wide[nx_ + j] + share * wide[n + nu_ + j];
  model_->integrate({.count = 1,
                     .states = wide.data(),
                     .inputs = wide.data() + n,
                     .parameters = wide.data() + nx_,
                     .parameters_end = wide_end_.data(),
                     .durations = &seconds,
                     .substeps = substeps_,
                     .next_states = next_.data(),
                     .jacobians = jacobian_.data()});
  // From columns [x; u; p; p_end] to [x; p; u; change], in the rows of the vehicle.
  const auto by = [&](int column) { return jacobian_.data() + column * nx_; };
  for (int r = 0; r < nx_; ++r) {
    for (int c = 0; c < nx_; ++c) transition_(r, c) = by(c)[r];
    for (int c = 0; c < nu_; ++c) transition_(r, n + c) = by(nx_ + c)[r];
    for (int c = 0; c < np_; ++c) {
      const double by_end = by(nx_ + nu_ + np_ + c)[r];
      transition_(r, nx_ + c) = by(nx_ + nu_ + c)[r] + by_end;
      transition_(r, n + nu_ + c) = share * by_end;
    }
  }
}

/// Writes an output's gradient by the wide vector, about `point_`. Its innovation as that of the linearised output at
/// `wide_mean_`.
double KalmanFilter::expect_wide(int output, double measured) noexcept {
  for (Eigen::Index c = 0; c < wide_gradient_.size(); ++c) {
    wide_gradient_[c] = 0.0;
    for (int r = 0; r < nx_; ++r) wide_gradient_[c] += output_jacobian_[r * ny_ + output] * transition_(r, c);
  }
  const double expected = predicted_[output];
  const double innovation =
      model_->description().outputs[output].is_angle ? angle_difference(measured, expected) : measured - expected;
  return innovation - (wide_gradient_.dot(wide_mean_) - wide_gradient_.dot(point_));
}

/// Next state and Jacobian at the interval's end at the mean or, where outputs y are given, where those of motion put
/// what is unknown of it: Gauss-Newton steps, until the point does not move by much.
void KalmanFilter::linearise_wide(double seconds, const double* y) noexcept {
  point_ = wide_mean_;
  for (int step = 0; step <= most_look_ahead_steps; ++step) {
    integrate_wide(point_, seconds, 1.0);
    if (!y || step == most_look_ahead_steps) return;
    model_->observe(
        {.count = 1, .states = next_.data(), .outputs = predicted_.data(), .jacobians = output_jacobian_.data()});
    if (!move_point(y)) return;
  }
}

/// Moves the point to the mean given the outputs of motion, linearised about the point, unless that is near.
bool KalmanFilter::move_point(const double* y) noexcept {
  constexpr double little = least_look_ahead_step * least_look_ahead_step, most_surprise = 16.0;
  Eigen::Index count = 0;
  for (const int j : noise_.motion_outputs) {
    if (std::isnan(y[j])) continue;
    motion_innovations_[count] = expect_wide(j, y[j]);
    motion_gradients_.col(count) = wide_gradient_;
    for (Eigen::Index r = 0; r < wide_gradient_.size(); ++r) {
      motion_images_(r, count) = 0.0;
      for (Eigen::Index c = 0; c < wide_gradient_.size(); ++c)
        motion_images_(r, count) += wide_covariance_(r, c) * wide_gradient_[c];
    }
    for (Eigen::Index k = 0; k <= count; ++k)
      motion_covariance_(count, k) = motion_gradients_.col(k).dot(motion_images_.col(count));
    double& total = motion_covariance_(count, count);
    // An outlier decides nothing.
    total = std::max(total + noise_.output_variances[j],
                     motion_innovations_[count] * motion_innovations_[count] / most_surprise);
    ++count;
  }
  auto innovations = motion_innovations_.head(count);
  Eigen::Ref<Eigen::MatrixXd> S = motion_covariance_.topLeftCorner(count, count);
  const Eigen::LLT<Eigen::Ref<Eigen::MatrixXd>> in_place(S);
  in_place.solveInPlace(innovations);
  if (!innovations.allFinite()) return false;
  bool has_moved = false;
  for (Eigen::Index r = 0; r < point_.size(); ++r) {
    double next = wide_mean_[r];
    for (Eigen::Index k = 0; k < count; ++k) next += motion_images_(r, k) * innovations[k];
    const double change = next - point_[r];
    has_moved = has_moved || change * change > little * wide_covariance_(r, r);
    next_point_[r] = next;
  }
  if (has_moved) point_.swap(next_point_);
  return has_moved;
}

void KalmanFilter::take_between(double seconds, double share, const double* y, const double* robust_weights) noexcept {
  point_ = wide_mean_;
  integrate_wide(point_, seconds, share);
  model_->observe(
      {.count = 1, .states = next_.data(), .outputs = predicted_.data(), .jacobians = output_jacobian_.data()});
  // All outputs are linearised there; `expect_wide` is about the mean as it is after each of them.
  for (int j = 0; j < ny_; ++j) {
    if (std::isnan(y[j])) continue;
    const double innovation = expect_wide(j, y[j]);
    take_wide(innovation, noise_.output_variances[j] / (robust_weights ? robust_weights[j] : 1.0));
  }
}

/// One output, in Joseph's form multiplied out with b = P h and s = h' b + R: P - k b' - b k' + s k k'.
void KalmanFilter::take_wide(double innovation, double variance) noexcept {
  const Eigen::Index a = wide_gradient_.size();
  double total = variance;
  for (Eigen::Index r = 0; r < a; ++r) {
    wide_image_[r] = 0.0;
    for (Eigen::Index c = 0; c < a; ++c) wide_image_[r] += wide_covariance_(r, c) * wide_gradient_[c];
    total += wide_image_[r] * wide_gradient_[r];
  }
  if (!(total > 0.0) || !std::isfinite(innovation / total)) return;
  for (Eigen::Index r = 0; r < a; ++r) wide_gain_[r] = wide_image_[r] / total;
  for (Eigen::Index c = 0; c < a; ++c)
    for (Eigen::Index r = 0; r < a; ++r)
      wide_covariance_(r, c) -=
          wide_gain_[r] * wide_image_[c] + (wide_image_[r] - total * wide_gain_[r]) * wide_gain_[c];
  wide_mean_ += innovation * wide_gain_;
  // A single outlier must not decide between filters.
  between_log_likelihood_ -= 0.5 * std::min(innovation * innovation / total, 16.0) + 0.5 * std::log(total);
}

/// To the interval's end, linearised about `point_`: x as integrated from there, p with its change.
void KalmanFilter::narrow() noexcept {
  const int n = nx_ + np_;
  const Eigen::Index a = wide_mean_.size();
  for (int j = 0; j < np_; ++j) {
    transition_.row(nx_ + j).setZero();
    transition_(nx_ + j, nx_ + j) = transition_(nx_ + j, n + nu_ + j) = 1.0;
  }
  for (Eigen::Index c = 0; c < a; ++c) {
    for (int r = 0; r < n; ++r) {
      double sum = 0.0;
      for (Eigen::Index k = 0; k < a; ++k) sum += transition_(r, k) * wide_covariance_(k, c);
      wide_work_(r, c) = sum;
    }
  }
  for (int c = 0; c < n; ++c) {
    for (int r = 0; r < n; ++r) {
      double sum = 0.0;
      for (Eigen::Index k = 0; k < a; ++k) sum += wide_work_(r, k) * transition_(c, k);
      next_covariance_(r, c) = sum;
    }
  }
  for (int r = 0; r < nx_; ++r)
    for (Eigen::Index c = 0; c < a; ++c) next_[r] += transition_(r, c) * (wide_mean_[c] - point_[c]);
  for (int j = 0; j < np_; ++j) wide_end_[j] = wide_mean_[nx_ + j] + wide_mean_[n + nu_ + j];
  const bool finite = std::all_of(next_.begin(), next_.end(), [](double value) { return std::isfinite(value); });
  if (!finite || !next_covariance_.allFinite() || !wide_end_.allFinite()) return;
  make_symmetric();
  std::copy(next_.begin(), next_.end(), mean.data());
  std::copy_n(wide_end_.data(), np_, mean.data() + nx_);
  clip();
}

}  // namespace rhec
