#include "rhec/core/estimation/kalman_filter.hpp"
#include "any_angle.hpp"
#include "rhec/core/base/angle.hpp"
#include "rhec/core/model/motion_outputs.hpp"

#include <algorithm>
#include <cmath>
#include <type_traits>
#include <utility>

#include "numbers.hpp"
#include "rhec/core/base/error.hpp"
#include "rhec/core/base/padded.hpp"
#include "rhec/core/base/with_size.hpp"
#include "rhec/core/estimation/measurement.hpp"
#include "rhec/core/horizon/rhe_problem.hpp"
#include "scale_slope.hpp"

namespace rhec {
namespace {

constexpr int carried_at_once = 4;  // deviations

/// Those of motion whose measurements are summarised. Polynomials in time would jump with an angle.
std::vector<int> summarised_outputs(const ModelDescription& about, const KalmanFilter::Noise& noise) {
  std::vector<int> outputs = noise.motion_outputs;
  std::erase_if(outputs, [&](int j) {
    return about.outputs[j].is_angle || std::ranges::find(noise.single_outputs, j) != noise.single_outputs.end();
  });
  return outputs;
}

}  // namespace

KalmanFilter::KalmanFilter(std::shared_ptr<const Model> model, Noise noise, int substeps, int most_between)
    : model_(std::move(model)),
      noise_(std::move(noise)),
      substeps_(substeps),
      nx_(model_->state_count()),
      nu_(model_->input_count()),
      np_(model_->parameter_count()),
      ny_(model_->output_count()),
      input_guess_(model_->description().inputs, Eigen::Index{nx_} + np_),
      input_factors_(*model_) {
  refuse_outputs_of_motion(*model_, "filter");
  const int n = nx_ + np_;
  mean = Eigen::VectorXd::Zero(n);
  covariance = Eigen::MatrixXd::Identity(n, n);
  predicted_.assign(ny_, 0.0);
  output_jacobian_.assign(static_cast<std::size_t>(ny_) * nx_, 0.0);
  next_.assign(nx_, 0.0);
  jacobian_.assign(static_cast<std::size_t>(nx_) * (nx_ + nu_ + 2 * np_), 0.0);
  input_.assign(nu_, 0.0);
  input_variances_ = input_;
  guessed_ = Eigen::MatrixXd::Zero(n, nu_);
  for (auto* v : {&added_, &innovations_, &innovation_variances_}) v->assign(ny_, 0.0);
  gains_ = Eigen::MatrixXd::Zero(n, ny_);
  carried_.assign(static_cast<std::size_t>(nx_) * carried_at_once, 0.0);
  is_missing_.assign(nu_, 0);
  const std::size_t width = padded(nx_ + np_ + nu_);
  for (auto* v : {&row_, &next_row_}) v->assign(width, 0.0);
  jacobian_rows_.assign(nx_ * width, 0.0);
  scratch_.assign(model_->rows_scratch(1), 0.0);
  work_ = next_covariance_ = Eigen::MatrixXd::Zero(n, n);
  gain_ = image_ = zeros_ = correction_ = Eigen::VectorXd::Zero(n);
  kept_rows_.assign(noise_.motion_outputs.empty() ? 0 : noise_.scaled_outputs.size() * (1 + nx_), 0.0);
  if (most_between == 0 && noise_.motion_outputs.empty()) return;
  const int motion = static_cast<int>(noise_.motion_outputs.size()), nz = nx_ + nu_ + 2 * np_, plain = n + nu_ + np_;
  if (motion > 0) curved_ = curved_states(*model_);
  curved_outputs_ = curved_outputs(*model_, noise_.motion_outputs);
  output_curvature_ = Curvature(static_cast<int>(curved_outputs_.size()), nx_, ny_);
  before_ = covariance;
  curvature_ = Curvature(2 * static_cast<int>(curved_.size()), plain);
  summary_ = ReadingSummary(summarised_outputs(model_->description(), noise_), ny_, most_between, substeps_);
  const std::size_t rows = std::max(static_cast<std::size_t>(summary_.most()) + 1, 2 * curved_.size()),
                    times = static_cast<std::size_t>(summary_.most()) + 1, second = 2 * curved_.size(),
                    nx = static_cast<std::size_t>(nx_), ny = static_cast<std::size_t>(ny_);
  times_.assign(times, 0.0);
  durations_.assign(rows, 0.0);
  states_.assign(rows * nx, 0.0);
  inputs_.assign(rows * nu_, 0.0);
  parameters_.assign(rows * np_, 0.0);
  ends_ = parameters_;
  next_states_.assign(times * nx, 0.0);
  jacobians_.assign(times * nx * nz, 0.0);
  outputs_.assign(times * ny, 0.0);
  output_jacobians_.assign(times * ny * nx, 0.0);
  multipliers_.assign(second * nx, 0.0);
  hessians_.assign(second * nz * nz, 0.0);
  const int wide = plain + (curved_.empty() ? 0 : Curvature::factors);
  for (auto* v : {&wide_mean_, &point_, &next_point_, &start_mean_, &wide_gradient_, &wide_gain_, &wide_image_})
    *v = Eigen::VectorXd::Zero(wide);
  motion_innovations_ = Eigen::VectorXd::Zero(motion);
  motion_images_ = motion_gradients_ = Eigen::MatrixXd::Zero(wide, motion);
  motion_covariance_ = Eigen::MatrixXd::Zero(motion, motion);
  wide_end_ = Eigen::VectorXd::Zero(np_);
  wide_covariance_ = start_covariance_ = posterior_ = Eigen::MatrixXd::Zero(wide, wide);
  transition_ = wide_work_ = Eigen::MatrixXd::Zero(n, wide);
}

void KalmanFilter::clip() noexcept {
  for (int j = 0; j < np_; ++j)
    mean[nx_ + j] = std::min(std::max(mean[nx_ + j], noise_.parameter_lower[j]), noise_.parameter_upper[j]);
}

void KalmanFilter::expect() noexcept {
  model_->observe(
      {.count = 1, .states = mean.data(), .outputs = predicted_.data(), .jacobians = output_jacobian_.data()});
}

void KalmanFilter::update(Measured y, const double* information_weights) noexcept {
  if (information_weights) y.weights = information_weights;
  expect();
  update_as_expected(y);
}

void KalmanFilter::update_as_expected(Measured y) noexcept {
  std::ranges::fill(added_, 0.0);
  find_scale_slopes(y);
  if (std::ranges::any_of(curved_outputs_, [y](int j) { return !std::isnan(y[j]); })) {
    // Once to see where the outputs put the state, then linearised there.
    before_ = covariance;
    take_outputs(y);
    point_.head(nx_) = mean.head(nx_) + correction_.head(nx_);
    linearise_outputs();
    covariance = before_;
  }
  take_outputs(y);
  mean += correction_;
  input_guess_.updated(mean, covariance);
  clip();
}

void KalmanFilter::find_scale_slopes(Measured y) noexcept {
  for (const ScaledOutput& scaled : noise_.scaled_outputs) {
    const int j = scaled.output, k = scaled.state;
    if (std::isnan(y[j])) continue;
    const double innovation = y[j] - predicted_[j];
    output_jacobian_[k * ny_ + j] = scale_slope(
        nx_, k, 1.0 + mean[k],
        model_->description().outputs[j].is_angle ? angle_difference(innovation, 0.0) : innovation,
        noise_.output_variances[j] / y.weight(j), [&](int c) { return output_jacobian_[c * ny_ + j]; },
        [&](int r, int c) { return covariance(r, c); });
  }
}

/// One output after the other, all linearised at the same point; the noises are independent.
void KalmanFilter::take_outputs(Measured y) noexcept {
  correction_.setZero();
  std::ranges::fill(innovation_variances_, 0.0);
  for (int j = 0; j < ny_; ++j)
    if (!std::isnan(y[j])) take_output(j, y[j], noise_.output_variances[j] / y.weight(j) + added_[j]);
}

/// Outputs as expected at the mean, linearised about `point_`. Those that are curved have means and variances of their
/// second-order terms, by the covariance after the update and before it.
void KalmanFilter::linearise_outputs() noexcept {
  if (!point_.head(nx_).allFinite()) return;
  // Scaled outputs stay as they are linearised.
  const auto exchange_rows = [&](auto exchange) {
    double* row = kept_rows_.data();
    for (const auto [j, k] : noise_.scaled_outputs) {
      exchange(predicted_[j], *row++);
      for (int c = 0; c < nx_; ++c) exchange(output_jacobian_[c * ny_ + j], *row++);
    }
  };
  exchange_rows([](double& own, double& kept) { kept = own; });
  model_->observe(
      {.count = 1, .states = point_.data(), .outputs = predicted_.data(), .jacobians = output_jacobian_.data()});
  for (int j = 0; j < ny_; ++j)
    for (int c = 0; c < nx_; ++c) predicted_[j] += output_jacobian_[c * ny_ + j] * (mean[c] - point_[c]);
  exchange_rows([](double& own, double& kept) { own = kept; });
  output_curvature_.observe(*model_, curved_outputs_, point_.data());
  output_curvature_.find_factor([&](std::ptrdiff_t r, std::ptrdiff_t c) { return before_(r, c); });
  output_curvature_.find_means([&](std::ptrdiff_t r, std::ptrdiff_t c) { return covariance(r, c); });
  for (std::size_t k = 0; k < curved_outputs_.size(); ++k) {
    const int row = static_cast<int>(k), j = curved_outputs_[k];
    predicted_[j] += output_curvature_.mean(row);
    added_[j] = output_curvature_.variance(row);
  }
}

void KalmanFilter::take_output(int output, double measured, double variance) noexcept {
  double innovation = model_->description().outputs[output].is_angle ? angle_difference(measured, predicted_[output])
                                                                     : measured - predicted_[output];
  const double* of_output = output_jacobian_.data() + output;
  for (int c = 0; c < nx_; ++c) innovation -= of_output[c * ny_] * correction_[c];
  const bool taken = with_size(nx_ + np_, [&](auto n) {
    const double* P = covariance.data();
    double* __restrict image = image_.data();
    double* __restrict gain = gain_.data();
    double* __restrict work = work_.data();
    double* __restrict next = next_covariance_.data();
    const auto multiply_row = [&](const double* by) {
      std::fill_n(image, n, 0.0);
      for (int c = 0; c < nx_; ++c)
        for (int r = 0; r < n; ++r) image[r] += by[c * n + r] * of_output[c * ny_];
    };
    multiply_row(P);
    double total = variance;
    for (int c = 0; c < nx_; ++c) total += of_output[c * ny_] * image[c];
    if (!(total > 0.0)) return false;
    for (int r = 0; r < n; ++r) gain[r] = image[r] / total;
    // Joseph's form, (I - k h') Pi (I - k h')' + k r k': it stays positive semidefinite, and accurate if a vague prior
    // meets an accurate measurement. Applied factor by factor, without matrix products (Bierman 1977).
    for (int c = 0; c < n; ++c)
      for (int r = 0; r < n; ++r) work[c * n + r] = P[c * n + r] - gain[r] * image[c];
    multiply_row(work);
    for (int r = 0; r < n; ++r) image[r] = variance * gain[r] - image[r];
    double* __restrict zeros = zeros_.data();  // stays 0 as long as every number is finite, else NaN
    std::fill_n(zeros, n, 0.0 * innovation);
    for (int c = 0; c < n; ++c) {
      for (int r = 0; r < n; ++r) {
        next[c * n + r] = work[c * n + r] + image[r] * gain[c];
        zeros[r] += 0.0 * next[c * n + r];
      }
    }
    for (int r = 0; r < n; ++r)
      if (zeros[r] != 0.0) return false;
    double* kept = gains_.col(output).data();
    for (int r = 0; r < n; ++r) {
      correction_[r] += gain[r] * innovation;
      kept[r] = gain[r];
    }
    innovations_[output] = innovation;
    innovation_variances_[output] = total;
    return true;
  });
  if (taken) make_symmetric();
}

/// Replaces the covariance by the symmetric part of the next one.
void KalmanFilter::make_symmetric() noexcept {
  with_size(nx_ + np_, [&](auto n) {
    double* __restrict P = covariance.data();
    const double* next = next_covariance_.data();
    for (int c = 0; c < n; ++c)
      for (int r = 0; r < n; ++r) P[c * n + r] = 0.5 * (next[c * n + r] + next[r * n + c]);
  });
}

/// Moments of the inputs of an interval.
void KalmanFilter::begin_inputs(const double* measured, const double* guess, double duration) noexcept {
  if (!guess) {
    input_factors_.begin(measured);
    for (int p = 0; p < np_; ++p)
      if (input_factors_.is_held(p)) restart_parameter(p, covariance(nx_ + p, nx_ + p));
    input_guess_.begin(measured, duration, covariance);
  }
  guesses_inputs_ = !guess && input_guess_.is_any_missing();
  for (int j = 0; j < nu_; ++j) {
    is_missing_[j] = std::isnan(measured[j]);
    input_[j] = measured[j];
    input_variances_[j] = noise_.input_variances[j];
    if (!is_missing_[j]) continue;
    const double wide = guess ? unknown_sigma(model_->description().inputs[j]) : 0.0;
    input_[j] = guess ? guess[j] : input_guess_.mean(j);
    input_variances_[j] = wide * wide;
  }
}

/// Leaves out what parameters do that are held, in the Jacobians of several steps.
void KalmanFilter::hold_factors(double* jacobians, int count) const noexcept {
  const std::ptrdiff_t columns = nx_ + nu_ + 2 * np_;
  for (int p = 0; guesses_inputs_ && p < np_; ++p) {
    if (!input_factors_.is_held(p)) continue;
    for (int k = 0; k < count; ++k)
      for (const int column : {nx_ + nu_ + p, nx_ + nu_ + np_ + p})
        std::fill_n(jacobians + (k * columns + column) * nx_, nx_, 0.0);
  }
}

/// Adds what inputs that are guessed have in the next covariance, by the transition (n_x x n) of the state: with its
/// derivatives B by the inputs, F C B' + B C' F' + B V B'. Their covariance with the next state is F C + B V.
void KalmanFilter::add_guessed_inputs(const double* transition) noexcept {
  const int n = nx_ + np_;
  const Eigen::MatrixXd &V = input_guess_.covariance(), &C = input_guess_.with_state();
  const auto B = [&](int r, int j) { return jacobian_[(nx_ + j) * nx_ + r]; };
  for (int j = 0; j < nu_; ++j) {
    for (int r = 0; r < n; ++r) {
      guessed_(r, j) = r < nx_ ? 0.0 : C(r, j);
      for (int k = 0; r < nx_ && k < n; ++k) guessed_(r, j) += transition[k * nx_ + r] * C(k, j);
    }
  }
  for (int j = 0; j < nu_; ++j) {
    if (!is_missing_[j]) continue;
    for (int c = 0; c < nx_; ++c) {
      for (int r = 0; r < n; ++r) {
        next_covariance_(r, c) += guessed_(r, j) * B(c, j);
        next_covariance_(c, r) += guessed_(r, j) * B(c, j);
      }
      for (int r = 0; r < nx_; ++r)
        for (int k = 0; k < nu_; ++k) next_covariance_(r, c) += B(r, j) * V(j, k) * B(c, k);
    }
  }
  for (int j = 0; j < nu_; ++j)
    for (int r = 0; r < nx_; ++r)
      for (int k = 0; k < nu_; ++k) guessed_(r, j) += B(r, k) * V(k, j);
}

void KalmanFilter::predict(const double* measured_input, const double* input_guess, double duration) noexcept {
  predict(measured_input, input_guess, duration, nullptr);
}

void KalmanFilter::predict(const double* measured_input, const double* input_guess, double duration,
                           const double* ramp_variances) noexcept {
  const int n = nx_ + np_;
  begin_inputs(measured_input, input_guess, duration);
  if (ramp_variances) {
    Model::Intervals request;
    request.count = 1;
    request.states = mean.data();
    request.inputs = input_.data();
    request.parameters = request.parameters_end = mean.data() + nx_;
    request.durations = &duration;
    request.substeps = substeps_;
    request.next_states = next_.data();
    request.jacobians = jacobian_.data();
    model_->integrate(request);
  } else {
    differentiate(duration);
  }
  hold_factors(jacobian_.data(), 1);
  // Only the vehicle's rows of the transition [F_x F_p; 0 I] need a product.
  if (ramp_variances)
    for (int c = 0; c < np_; ++c)
      for (int r = 0; r < nx_; ++r) jacobian_[(nx_ + nu_ + c) * nx_ + r] += jacobian_[(nx_ + nu_ + np_ + c) * nx_ + r];
  with_size(nx_, [&](auto nx) {
    double* transition = jacobian_rows_.data();  // free since the step was differentiated
    std::copy_n(jacobian_.data(), nx * nx, transition);
    std::copy_n(jacobian_.data() + (nx_ + nu_) * nx_, np_ * nx, transition + nx * nx);
    const double* P = covariance.data();
    double* work = work_.data();
    double* next = next_covariance_.data();
    for (int c = 0; c < n; ++c) {
      double* __restrict moved = work + c * n;
      std::fill_n(moved, nx, 0.0);
      for (int k = 0; k < n; ++k)
        for (int r = 0; r < nx; ++r) moved[r] += transition[k * nx + r] * P[c * n + k];
    }
    std::copy_n(P, n * n, next);
    for (int c = 0; c < nx; ++c) {
      double* __restrict column = next + c * n;
      std::fill_n(column, nx, 0.0);
      for (int k = 0; k < n; ++k)
        for (int r = 0; r < nx; ++r) column[r] += work[k * n + r] * transition[k * nx + c];
    }
    for (int c = nx; c < n; ++c)
      for (int r = 0; r < nx; ++r) next[c * n + r] = next[r * n + c] = work[c * n + r];
  });
  // Noise enters through the inputs and, on a ramp, through the change of the parameter over the interval.
  if (guesses_inputs_) add_guessed_inputs(jacobian_rows_.data());
  for (int j = 0; j < nu_; ++j) {
    const double variance = input_variances_[j];
    const double* by_input = jacobian_.data() + (nx_ + j) * nx_;
    for (int c = 0; c < nx_; ++c)
      for (int r = 0; r < nx_; ++r) next_covariance_(r, c) += by_input[r] * (variance * by_input[c]);
  }
  for (int j = 0; ramp_variances && j < np_; ++j) {
    const double variance = ramp_variances[j];
    const double* by_end = jacobian_.data() + (nx_ + nu_ + np_ + j) * nx_;
    for (int c = 0; c < nx_; ++c) {
      for (int r = 0; r < nx_; ++r) next_covariance_(r, c) += by_end[r] * (variance * by_end[c]);
      next_covariance_(c, nx_ + j) += variance * by_end[c];
      next_covariance_(nx_ + j, c) += variance * by_end[c];
    }
    next_covariance_(nx_ + j, nx_ + j) += variance;
  }
  if (!are_finite(next_) || !are_finite(next_covariance_)) return;
  make_symmetric();
  std::copy(next_.begin(), next_.end(), mean.data());
  if (!guesses_inputs_) return;
  for (int j = 0; j < nu_; ++j)
    for (int r = 0; r < nx_ + np_; ++r)
      if (is_missing_[j]) input_guess_.set_with_state(r, j, guessed_(r, j));
  release_angles(model_->description().states, covariance, input_guess_);
  input_guess_.predicted(mean, covariance);
}

void KalmanFilter::carry(Deviations& deviations) noexcept {
  const auto move = [&](auto count, Eigen::Index first) {
    using Lanes = Eigen::Array<double, count(), 1>;
    const Eigen::Index stride = deviations.columns.cols();
    double* rows = deviations.columns.data() + first;
    for (int r = 0; r < nx_; ++r) {
      Lanes sum = Lanes::Zero();
      for (int c = 0; c < nx_ + np_; ++c) {
        const double by = jacobian_[(c < nx_ ? c : nu_ + c) * nx_ + r];
        if (by != 0.0) sum += by * Eigen::Map<const Lanes>(rows + c * stride);
      }
      for (Eigen::Index j = 0; j < deviations.by_input.rows(); ++j)
        if (const double by = is_missing_[j] ? 0.0 : jacobian_[(nx_ + j) * nx_ + r]; by != 0.0)
          sum += by * Eigen::Map<const Lanes>(deviations.by_input.data() + j * stride + first);
      Eigen::Map<Lanes>(carried_.data() + r * count()) = sum;
    }
    for (int r = 0; r < nx_; ++r)
      Eigen::Map<Lanes>(rows + r * stride) = Eigen::Map<const Lanes>(carried_.data() + r * count());
  };
  Eigen::Index first = 0;
  for (; first + carried_at_once <= deviations.used; first += carried_at_once)
    move(std::integral_constant<int, carried_at_once>{}, first);
  for (; first < deviations.used; ++first) move(std::integral_constant<int, 1>{}, first);
}

/// Next state and its Jacobian for constant parameters, by the faster of the model's functions.
void KalmanFilter::differentiate(double duration) noexcept {
  std::copy_n(mean.data(), nx_ + np_, row_.data());
  std::copy_n(input_.data(), nu_, row_.data() + nx_ + np_);
  const std::ptrdiff_t width = padded(nx_ + np_ + nu_);
  IntervalRows request;
  request.count = 1;
  request.z = row_.data();
  request.z_step = width;
  request.durations = &duration;
  request.substeps = substeps_;
  request.next_states = next_row_.data();
  request.next_step = width;
  request.jacobians = jacobian_rows_.data();
  request.jacobian_row = width;
  request.jacobian_step = nx_ * width;
  request.scratch = scratch_.data();
  model_->integrate_rows(request);
  std::copy_n(next_row_.data(), nx_, next_.data());
  // From rows in the order [x; p; u] to columns in the order [x; u; p].
  for (int r = 0; r < nx_; ++r) {
    const double* row = jacobian_rows_.data() + r * width;
    for (int c = 0; c < nx_; ++c) jacobian_[c * nx_ + r] = row[c];
    for (int c = 0; c < nu_; ++c) jacobian_[(nx_ + c) * nx_ + r] = row[nx_ + np_ + c];
    for (int c = 0; c < np_; ++c) jacobian_[(nx_ + nu_ + c) * nx_ + r] = row[nx_ + c];
  }
}

void KalmanFilter::expect_zero(int parameter, double variance) noexcept {
  const int i = nx_ + parameter;
  const double total = covariance(i, i) + variance;
  if (!(total > 0.0)) return;
  gain_ = covariance.col(i);
  mean -= gain_ * (mean[i] / total);
  for (Eigen::Index c = 0; c < gain_.size(); ++c)
    for (Eigen::Index r = 0; r < gain_.size(); ++r) covariance(r, c) -= gain_[r] * gain_[c] / total;
  clip();
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
