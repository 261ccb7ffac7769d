// How a KalmanFilter uses measurements between two nodes, and where it linearises an interval with outputs of motion.
#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>

#include "any_angle.hpp"
#include "look_ahead.hpp"
#include "rhec/core/base/angle.hpp"
#include "rhec/core/base/assertion.hpp"
#include "rhec/core/estimation/kalman_filter.hpp"
#include "scale_slope.hpp"

namespace rhec {

/// What is unknown within an interval are [x; p] at its start, the input, and the change of p. Measurements at later
/// times tell of all of these; only then they move to the interval's end.
void KalmanFilter::predict(const MeasuredInterval& interval, const double* input_guess, const double* ramp_variances,
                           const double* information_weights, Measured end_outputs) noexcept {
  between_log_likelihood_ = 0.0;
  is_curved_ = false;
  if (measures_motion(noise_.motion_outputs, interval, static_cast<std::size_t>(ny_), end_outputs)) {
    look_ahead(interval, input_guess, ramp_variances, information_weights, end_outputs);
  } else {
    if (interval.between == 0) return predict(interval.inputs, input_guess, interval.duration, ramp_variances);
    RHEC_ASSERT(wide_mean_.size() > 0, "a filter that was set up for measurements between nodes");
    begin_inputs(interval.inputs, input_guess, interval.duration);
    widen(ramp_variances);
    const auto linearise = [&](double seconds) {
      point_ = wide_mean_;
      linearise_times(interval, 1, &seconds);
      use_time(interval, 0);
    };
    for (int k = 0; k < interval.between; ++k) {
      linearise(interval.times[k]);
      take_between(interval, k, information_weights ? information_weights : interval.weights);
    }
    linearise(interval.duration);
  }
  narrow();
}

/// Gauss-Newton steps, until the point does not move by much.
MeasuredInterval KalmanFilter::look_ahead(const MeasuredInterval& measured, const double* input_guess,
                                          const double* ramp_variances, const double* information_weights,
                                          Measured end_outputs) noexcept {
  RHEC_ASSERT(wide_mean_.size() > 0, "a filter that was set up for outputs of motion");
  is_curved_ = !curved_.empty();
  begin_inputs(measured.inputs, input_guess, measured.duration);
  widen(ramp_variances);
  const MeasuredInterval interval = information_weights ? measured : summary_(measured);
  const double* const weights = information_weights ? information_weights : summary_.weights();
  std::copy_n(interval.times, interval.between, times_.begin());
  times_[interval.between] = interval.duration;
  const Eigen::Index plain = Eigen::Index{nx_} + np_ + nu_ + np_;
  point_ = start_mean_ = wide_mean_;
  start_covariance_ = wide_covariance_;
  for (int step = 0;; ++step) {
    if (step > 0) {
      wide_mean_ = start_mean_;
      wide_covariance_ = start_covariance_;
    }
    find_curvature(interval, step);
    point_.tail(point_.size() - plain).setZero();
    linearise_times(interval, interval.between + 1, times_.data());
    between_log_likelihood_ = 0.0;
    for (int k = 0; k < interval.between; ++k) {
      use_time(interval, k);
      take_between(interval, k, weights);
    }
    use_time(interval, interval.between);
    if (step == most_look_ahead_steps) return interval;
    find_next_point(end_outputs);
    const auto is_far = [&](Eigen::Index r) {
      const double change = next_point_[r] - point_[r];
      return change * change > least_look_ahead_step * least_look_ahead_step * start_covariance_(r, r);
    };
    bool has_moved = false;
    for (Eigen::Index r = 0; r < plain; ++r) has_moved = has_moved || is_far(r);
    if ((!has_moved && (step > 0 || !is_curved_)) || !next_point_.allFinite()) return interval;
    point_.swap(next_point_);
  }
}

/// From [x; p].
void KalmanFilter::widen(const double* ramp_variances) noexcept {
  const int n = nx_ + np_;
  wide_covariance_.setZero();
  for (int c = 0; c < n; ++c) {
    wide_mean_[c] = mean[c];
    for (int r = 0; r < n; ++r) wide_covariance_(r, c) = covariance(r, c);
  }
  for (int j = 0; j < nu_; ++j) {
    wide_mean_[n + j] = input_[j];
    wide_covariance_(n + j, n + j) = input_variances_[j];
    for (int r = 0; guesses_inputs_ && is_missing_[j] && r < n; ++r)
      wide_covariance_(r, n + j) = wide_covariance_(n + j, r) = input_guess_.with_state()(r, j);
    for (int k = 0; guesses_inputs_ && is_missing_[j] && k < nu_; ++k)
      wide_covariance_(n + j, n + k) += input_guess_.covariance()(j, k);
  }
  for (int j = 0; j < np_; ++j) {
    wide_mean_[n + nu_ + j] = 0.0;
    wide_covariance_(n + nu_ + j, n + nu_ + j) = ramp_variances ? ramp_variances[j] : 0.0;
  }
  const Eigen::Index factors = wide_mean_.size() - n - nu_ - np_;
  wide_mean_.tail(factors).setZero();
  wide_covariance_.bottomRightCorner(factors, factors).setIdentity();
}

/// Hessians of the curved states by [x; p; u; change of p] about `point_`, at the first measurement and at the end.
void KalmanFilter::write_hessians(const MeasuredInterval& interval) noexcept {
  const int n = nx_ + np_, nz = nx_ + nu_ + 2 * np_, plain = n + nu_ + np_, curved = static_cast<int>(curved_.size());
  const double first = interval.between > 0 ? interval.times[0] : interval.duration;
  // Without measurements in between both are the end.
  const int count = interval.between > 0 ? 2 * curved : curved;
  const auto seconds = [&](int row) { return row < curved ? first : interval.duration; };
  std::ranges::fill(multipliers_, 0.0);
  for (int row = 0; row < count; ++row) {
    copy_point(row, seconds(row), seconds(row) / interval.duration);
    multipliers_[row * nx_ + curved_[row % curved]] = 1.0;
  }
  Model::Intervals request = copied_points(count);
  request.multipliers = multipliers_.data();
  request.hessians = hessians_.data();
  model_->integrate(request);
  // Places of z = [x; u; p; p at the time] among what is unknown.
  const auto place = [&](int z) {
    if (z < nx_) return z;
    if (z < nx_ + nu_) return n + z - nx_;
    return nx_ + (z - nx_ - nu_) % np_;
  };
  const auto change = [&](int z) { return n + nu_ + z - nx_ - nu_ - np_; };
  for (int row = 0; row < 2 * curved; ++row) {
    const double share = seconds(row) / interval.duration;
    const double* const hessian = hessians_.data() + static_cast<std::ptrdiff_t>(row % count) * nz * nz;
    double* const H = curvature_.hessian(row);
    std::fill_n(H, plain * plain, 0.0);
    for (int c = 0; c < nz; ++c) {
      for (int r = 0; r < nz; ++r) {
        const double value = hessian[c * nz + r];
        if (value == 0.0) continue;
        const bool of_end = c >= nx_ + nu_ + np_, by_end = r >= nx_ + nu_ + np_;
        H[place(c) * plain + place(r)] += value;
        if (of_end) H[change(c) * plain + place(r)] += share * value;
        if (by_end) H[place(c) * plain + change(r)] += share * value;
        if (of_end && by_end) H[change(c) * plain + change(r)] += share * share * value;
      }
    }
  }
}

/// Second-order terms: their means with the covariance given all measurements, once that is known, their covariances
/// with the one before. Of an input that is not measured nothing is known but what the outputs tell. The second
/// derivatives are those at the mean, then those close to the point.
void KalmanFilter::find_curvature(const MeasuredInterval& interval, int step) noexcept {
  if (!is_curved_) return;
  if (step < 2) {
    const int n = nx_ + np_;
    const auto is_known = [&](std::ptrdiff_t r) { return r < n || r >= n + nu_ || !is_missing_[r - n]; };
    const auto before = [&](std::ptrdiff_t r, std::ptrdiff_t c) {
      return is_known(r) && is_known(c) ? start_covariance_(r, c) : 0.0;
    };
    write_hessians(interval);
    curvature_.look();
    curvature_.find_factor(before);
    if (step == 0) return curvature_.find_means(before);
  }
  curvature_.find_means([&](std::ptrdiff_t r, std::ptrdiff_t c) { return posterior_(r, c); });
}

/// To a row of what the model is given, at a time and a share of the interval.
void KalmanFilter::copy_point(int row, double seconds, double share) noexcept {
  const int n = nx_ + np_;
  std::copy_n(point_.data(), nx_, states_.data() + row * nx_);
  std::copy_n(point_.data() + nx_, np_, parameters_.data() + row * np_);
  std::copy_n(point_.data() + n, nu_, inputs_.data() + row * nu_);
  for (int j = 0; j < np_; ++j) ends_[row * np_ + j] = point_[nx_ + j] + share * point_[n + nu_ + j];
  durations_[row] = seconds;
}

Model::Intervals KalmanFilter::copied_points(int count) const noexcept {
  return {.count = count,
          .states = states_.data(),
          .inputs = inputs_.data(),
          .parameters = parameters_.data(),
          .parameters_end = ends_.data(),
          .durations = durations_.data(),
          .substeps = substeps_};
}

/// How far a time is from that of the first measurement (0) towards the end (1).
double KalmanFilter::from_first(const MeasuredInterval& interval, double seconds) noexcept {
  return interval.between > 0 ? (seconds - interval.times[0]) / (interval.duration - interval.times[0]) : 1.0;
}

/// Next states, outputs and their Jacobians at several times about `point_`, all in one call of the model.
void KalmanFilter::linearise_times(const MeasuredInterval& interval, int count, const double* seconds) noexcept {
  for (int k = 0; k < count; ++k) copy_point(k, seconds[k], seconds[k] / interval.duration);
  Model::Intervals request = copied_points(count);
  request.next_states = next_states_.data();
  request.jacobians = jacobians_.data();
  model_->integrate(request);
  hold_factors(jacobians_.data(), count);
  const int curved = is_curved_ ? static_cast<int>(curved_.size()) : 0;
  for (int k = 0; k < count; ++k) {
    const double share = from_first(interval, seconds[k]);
    for (int i = 0; i < curved; ++i)
      next_states_[k * nx_ + curved_[i]] += (1.0 - share) * curvature_.mean(i) + share * curvature_.mean(i + curved);
  }
  model_->observe({.count = count,
                   .states = next_states_.data(),
                   .outputs = outputs_.data(),
                   .jacobians = output_jacobians_.data()});
}

/// Takes up one of these times: next state, outputs, and the transition to it.
void KalmanFilter::use_time(const MeasuredInterval& interval, int which) noexcept {
  const int n = nx_ + np_, plain = n + nu_ + np_, nz = nx_ + nu_ + 2 * np_;
  const double seconds = durations_[which], share = seconds / interval.duration;
  std::copy_n(next_states_.data() + which * nx_, nx_, next_.data());
  std::copy_n(outputs_.data() + which * ny_, ny_, predicted_.data());
  std::copy_n(output_jacobians_.data() + which * ny_ * nx_, ny_ * nx_, output_jacobian_.data());
  // From columns [x; u; p; p_end] to [x; p; u; change], in the rows of the vehicle.
  const double* const jacobian = jacobians_.data() + static_cast<std::ptrdiff_t>(which) * nx_ * nz;
  const auto by = [&](int column) { return jacobian + column * nx_; };
  for (int r = 0; r < nx_; ++r) {
    for (int c = 0; c < nx_; ++c) transition_(r, c) = by(c)[r];
    for (int c = 0; c < nu_; ++c) transition_(r, n + c) = by(nx_ + c)[r];
    for (int c = 0; c < np_; ++c) {
      const double by_end = by(nx_ + nu_ + np_ + c)[r];
      transition_(r, nx_ + c) = by(nx_ + nu_ + c)[r] + by_end;
      transition_(r, n + nu_ + c) = share * by_end;
    }
  }
  transition_.rightCols(transition_.cols() - plain).setZero();
  const int curved = is_curved_ ? static_cast<int>(curved_.size()) : 0;
  const double late = from_first(interval, seconds);
  for (int k = 0; k < curved; ++k)
    for (int f = 0; f < Curvature::factors; ++f)
      transition_(curved_[k], plain + f) =
          (1.0 - late) * curvature_.factor(k, f) + late * curvature_.factor(k + curved, f);
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

/// To the mean given the outputs of motion at the end, linearised about the point.
void KalmanFilter::find_next_point(Measured y) noexcept {
  constexpr double most_surprise = 16.0;
  next_point_ = wide_mean_;
  Eigen::Index count = 0;
  for (const int j : noise_.motion_outputs) {
    if (!y || std::isnan(y[j])) continue;
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
    total = std::max(total + noise_.output_variances[j] / y.weight(j),
                     motion_innovations_[count] * motion_innovations_[count] / most_surprise);
    ++count;
  }
  auto innovations = motion_innovations_.head(count);
  Eigen::Ref<Eigen::MatrixXd> S = motion_covariance_.topLeftCorner(count, count);
  const Eigen::LLT<Eigen::Ref<Eigen::MatrixXd>> in_place(S);
  in_place.solveInPlace(innovations);
  for (Eigen::Index k = 0; k < count; ++k)
    for (Eigen::Index r = 0; r < next_point_.size(); ++r) next_point_[r] += motion_images_(r, k) * innovations[k];
  if (curved_.empty()) return;
  posterior_ = wide_covariance_;
  for (Eigen::Index r = 0; r < posterior_.rows(); ++r) {
    // Of S = L L', the rows of (images L'^-1): what they take from the covariance is their product.
    for (Eigen::Index k = 0; k < count; ++k) {
      double value = motion_images_(r, k);
      for (Eigen::Index l = 0; l < k; ++l) value -= S(k, l) * motion_images_(r, l);
      motion_images_(r, k) = value / S(k, k);
    }
    for (Eigen::Index c = 0; c <= r; ++c) {
      for (Eigen::Index k = 0; k < count; ++k) posterior_(r, c) -= motion_images_(r, k) * motion_images_(c, k);
      posterior_(c, r) = posterior_(r, c);
    }
  }
}

/// Measurements at the time in use; `expect_wide` is about the mean as it is after each of them.
void KalmanFilter::take_between(const MeasuredInterval& interval, int which, const double* weights) noexcept {
  const double* const y = interval.outputs + static_cast<std::ptrdiff_t>(which) * ny_;
  if (weights) weights += static_cast<std::ptrdiff_t>(which) * ny_;
  for (int j = 0; j < ny_; ++j) {
    if (std::isnan(y[j])) continue;
    const double innovation = expect_wide(j, y[j]),
                 variance = noise_.output_variances[j] / (weights ? weights[j] : 1.0);
    for (const auto [output, k] : noise_.scaled_outputs)
      if (output == j)
        wide_gradient_[k] = scale_slope(
            static_cast<int>(wide_gradient_.size()), k, 1.0 + wide_mean_[k], innovation, variance,
            [&](int c) { return wide_gradient_[c]; }, [&](int r, int c) { return wide_covariance_(r, c); });
    take_wide(innovation, variance);
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

/// Moments of guessed inputs, given what was measured on the interval.
void KalmanFilter::take_guessed_inputs() noexcept {
  const int n = nx_ + np_;
  for (int j = 0; j < nu_; ++j) {
    if (!is_missing_[j]) continue;
    input_guess_.set(j, wide_mean_[n + j]);
    for (int k = 0; k < nu_; ++k)
      if (is_missing_[k]) input_guess_.set_covariance(j, k, wide_covariance_(n + j, n + k));
    for (int r = 0; r < n; ++r) input_guess_.set_with_state(r, j, wide_work_(r, n + j));
  }
  release_angles(model_->description().states, covariance, input_guess_);
  input_guess_.predicted(mean, covariance);
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
  // Of numbers that are far too large rounding leaves no covariance.
  const bool is_covariance = next_covariance_.allFinite() && next_covariance_.diagonal().minCoeff() >= 0.0;
  if (!finite || !is_covariance || !wide_end_.allFinite()) return;
  make_symmetric();
  std::copy(next_.begin(), next_.end(), mean.data());
  std::copy_n(wide_end_.data(), np_, mean.data() + nx_);
  if (guesses_inputs_) take_guessed_inputs();
  clip();
}

}  // namespace rhec
