#include "walking_filter.hpp"

#include <algorithm>
#include <cmath>
#include <span>
#include <utility>

#include "any_angle.hpp"
#include "innovation.hpp"
#include "rhec/core/base/angle.hpp"

namespace rhec {
namespace {

constexpr double rounding = 1e-9;  // of a duration, relative
constexpr int most_parts = 32;     // who has a long way to go divides it by itself

}  // namespace

double chi_square_limit(int degrees, double sigmas) noexcept {
  const double d = degrees, share = 2.0 / (9.0 * d);
  const double root = 1.0 - share + sigmas * std::sqrt(share);
  return d * root * root * root;
}

WalkingFilter::WalkingFilter(std::shared_ptr<const Model> model, const Setup& setup)
    : setup_(setup), filter_(std::move(model), setup.noise, setup.substeps), outputs_(filter_.model().output_count()) {
  const Model& m = filter_.model();
  ramp_variances_.assign(m.parameter_count(), 0.0);
  image_ = Eigen::MatrixXd::Zero(m.state_count(), m.output_count());
}

std::shared_ptr<const FilterMemo> WalkingFilter::make_memo() {
  if (setup_.has_ramps) return nullptr;
  memo_ = std::make_shared<FilterMemo>(
      FilterMemo::Setup{.noise = setup_.noise, .walk = setup_.walk, .substeps = setup_.substeps}, mean().size());
  return memo_;
}

void WalkingFilter::update_as_expected(Measured outputs) noexcept {
  const bool is_kept = memo_ && !outputs.weights;  // others have the same noise then
  if (is_kept) memo_->update.begin({outputs.values, static_cast<std::size_t>(outputs_)}, 0.0, filter_);
  filter_.update_as_expected(outputs);
  if (is_kept) memo_->update.end(filter_);
}

void WalkingFilter::predict(const double* inputs, double duration, const double* more_sigmas,
                            KalmanFilter::Deviations* deviations) noexcept {
  if (!(duration > 0.0) || !std::isfinite(duration)) return;
  const int parts =
      static_cast<int>(std::min<double>(most_parts, std::max(1.0, std::ceil(duration / setup_.step - 1e-6))));
  const double part = duration / parts, ratio = part / setup_.step,
               steps = std::abs(ratio - 1.0) < rounding ? 1.0 : ratio;
  const std::span given(inputs, setup_.noise.input_variances.size());
  const bool is_any_missing = std::ranges::any_of(given, [](double value) { return std::isnan(value); });
  const bool is_kept = memo_ && parts == 1 && !more_sigmas && !is_any_missing;
  if (is_kept) memo_->prediction.begin(given, duration, filter_);
  for (std::size_t j = 0; j < setup_.walk.size(); ++j) ramp_variances_[j] = setup_.walk[j] * setup_.walk[j] * steps;
  for (std::size_t j = 0; more_sigmas && j < given.size(); ++j)
    filter_.set_input_variance(static_cast<int>(j), setup_.noise.input_variances[j] + more_sigmas[j] * more_sigmas[j]);
  for (int i = 0; i < parts; ++i) {
    if (setup_.has_ramps) {
      filter_.predict(inputs, nullptr, part, ramp_variances_.data());
    } else {
      filter_.predict(inputs, nullptr, part);
      for (std::size_t j = 0; j < setup_.walk.size(); ++j)
        filter_.add_parameter_variance(static_cast<int>(j), ramp_variances_[j]);
    }
    if (is_kept) memo_->prediction.end(filter_);
    if (deviations) filter_.carry(*deviations);
    if (more_sigmas) limit_states();
  }
  for (std::size_t j = 0; more_sigmas && j < given.size(); ++j)
    filter_.set_input_variance(static_cast<int>(j), setup_.noise.input_variances[j]);
}

/// A motion that nobody knows ends at a state's bounds, as that of a steering angle at its stop. What is capped keeps
/// its correlations, but for an angle that may be any.
void WalkingFilter::limit_states() noexcept {
  const std::vector<Variable>& states = model().description().states;
  release_angles(states, covariance(), inputs());
  for (Eigen::Index j = 0; j < std::ssize(states); ++j) {
    const Variable& state = states[j];
    mean()[j] = std::min(std::max(mean()[j], state.lower), state.upper);
    const double most = 0.5 * (state.upper - state.lower);
    const double sigma = std::sqrt(covariance()(j, j));
    if (!(sigma > most)) continue;
    covariance().row(j) *= most / sigma;
    covariance().col(j) *= most / sigma;
  }
}

void WalkingFilter::forget_place(double sigma_x, double sigma_y) noexcept {
  const Roles& roles = model().description().roles;
  for (const auto& [state, sigma] : {std::pair{roles.position_x, sigma_x}, std::pair{roles.position_y, sigma_y}}) {
    covariance().row(state).setZero();
    covariance().col(state).setZero();
    covariance()(state, state) = sigma * sigma;
  }
}

void WalkingFilter::expect() noexcept {
  const Model& m = filter_.model();
  filter_.expect();
  const double* jacobian = filter_.output_jacobian();
  const int nx = m.state_count(), ny = m.output_count();
  for (int j = 0; j < ny; ++j) {
    for (int r = 0; r < nx; ++r) {
      double sum = 0.0;
      for (int c = 0; c < nx; ++c) sum += covariance()(r, c) * jacobian[c * ny + j];
      image_(r, j) = sum;
    }
  }
}

bool WalkingFilter::depends_on(int output, int state) const noexcept { return derivative(output, state) != 0.0; }

bool WalkingFilter::innovation(const Sensor& sensor, Measured outputs, Innovation& result) noexcept {
  const Model& m = filter_.model();
  const double* jacobian = filter_.output_jacobian();
  const double* expected = filter_.expected_outputs();
  const int nx = m.state_count(), ny = m.output_count();
  int measured[most_sensor_outputs], count = 0;
  for (const int j : sensor.outputs)
    if (!std::isnan(outputs[j])) measured[count++] = j;
  if (count == 0) return false;
  result.value.resize(count);
  result.covariance.resize(count, count);
  for (int a = 0; a < count; ++a) {
    const int j = measured[a];
    result.value[a] =
        m.description().outputs[j].is_angle ? angle_difference(outputs[j], expected[j]) : outputs[j] - expected[j];
    for (int b = 0; b < count; ++b) {
      double sum = a == b ? filter_.noise().output_variances[j] / outputs.weight(j) : 0.0;
      for (int c = 0; c < nx; ++c) sum += jacobian[c * ny + j] * image_(c, measured[b]);
      result.covariance(a, b) = sum;
    }
  }
  result.nis = squared_size(result.value, result.covariance);
  return true;
}

}  // namespace rhec
