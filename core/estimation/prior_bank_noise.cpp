// How a PriorBank weighs its outputs: noise that it learns, and robust losses.
#include <algorithm>
#include <cmath>

#include "prior_bank_views.hpp"
#include "rhec/core/base/angle.hpp"
#include "rhec/core/kernels/kernel_sets.hpp"

namespace rhec {
namespace {

/// Variance of an adapted noise variance, relative to its square: before anything is known of it (a standard deviation
/// that is stated wrongly by a factor of up to three), and from where on it counts as identified.
constexpr double unknown_noise = 4.0, known_noise = 0.25;

}  // namespace

/// To what is stated.
void PriorBank::reset_noise() noexcept {
  std::fill(learnt_.begin(), learnt_.end(), unknown_noise);
  std::copy(setup_.output_variances.begin(), setup_.output_variances.end(), learnt_.begin());
  spread_variances();
}

/// To all lanes.
void PriorBank::spread_variances() noexcept {
  for (int j = 0; j < ny_; ++j)
    std::fill_n(output_variances_.data() + static_cast<std::ptrdiff_t>(j) * lanes_, lanes_, learnt_[j]);
}

PriorBank::Noise PriorBank::noise(int output) const noexcept {
  return {learnt_[output], !setup_.adapts_noise || learnt_[ny_ + sensor_[output]] < known_noise};
}

/// The innovation nu of an output has the variance S = h' P h + R before the update. With i = R / S, the residual r and
/// the covariance after it, nu^2 - S = (r^2 + h' P h - R) / i^2: a measurement of what R lacks, with the variance 2 S^2
/// (Mehra 1970). R follows by a scalar Kalman filter in units of itself, whose own variance V says how well R is known;
/// where S tells little about R, R hardly moves. Residuals are those of the most probable member. Outputs of one unit
/// and one stated noise, like the coordinates of a position, are one sensor and change together.
void PriorBank::adapt_noise(const double* y) noexcept {
  constexpr double steady_gain = 0.015, most_squares = 9.0, least_information = 1e-3, most_change = 2.0;
  constexpr double drift = 2.0 * steady_gain * steady_gain;
  const auto best = std::max_element(weights_.begin(), weights_.begin() + members_) - weights_.begin();
  for (int sensor = 0; sensor < ny_; ++sensor) {
    if (sensor_[sensor] != sensor) continue;
    // Sums over the sensor's outputs, which do not depend on the axes of a position.
    double squares = 0.0, spread = 0.0;
    int count = 0;
    for (int j = sensor; j < ny_; ++j) {
      if (sensor_[j] != sensor || std::isnan(y[j])) continue;
      const auto gradient = [&](int c) {
        return gradient_[(static_cast<std::ptrdiff_t>(j) * nx_ + c) * lanes_ + best];
      };
      double residual = y[j] - predicted_[static_cast<std::ptrdiff_t>(j) * lanes_ + best];
      if (model_->description().outputs[j].is_angle) residual = angle_difference(residual, 0.0);
      for (int c = 0; c < nx_; ++c) {
        residual -= gradient(c) * (mean_[static_cast<std::ptrdiff_t>(c) * lanes_ + best] - states_[best * nx_ + c]);
        for (int r = 0; r < nx_; ++r)
          spread += gradient(c) * gradient(r) * covariance_[(static_cast<std::ptrdiff_t>(c) * n_ + r) * lanes_ + best];
      }
      squares += residual * residual;
      ++count;
    }
    if (count == 0) continue;
    double &R = learnt_[sensor], &V = learnt_[ny_ + sensor];
    const double information = std::max(1.0 - spread / (count * R), least_information);
    const double surplus = std::min((squares + spread) / (count * R), most_squares) - 1.0;
    const double gain = V / (V * information * information + 2.0 / count);  // of the surplus, i.e. divided by i^2
    const double change = 1.0 + gain * surplus;
    if (!std::isfinite(change)) continue;
    const double stated = setup_.output_variances[sensor], most = setup_.most_noise_change * setup_.most_noise_change;
    R = std::clamp(R * std::clamp(change, 1.0 / most_change, most_change), stated / most, stated * most);
    V = std::min(V * (1.0 - gain * information * information) + drift, unknown_noise);
  }
  for (int j = 0; j < ny_; ++j) learnt_[j] = learnt_[sensor_[j]];
  spread_variances();
}

/// Pseudo-Huber losses of the innovations, as weights of the outputs: s = sum of r^2 / S over a group, and the loss
/// 2 delta^2 (sqrt(1 + s / delta^2) - 1) has the slope 1 / sqrt(1 + s / delta^2).
void PriorBank::weigh_outputs(const double* y, int taken) noexcept {
  const BankView view{lanes_, nx_, n_, mean_.data(), covariance_.data(), work_.data()};
  for (int j = 0; j < ny_; ++j)
    std::fill_n(output_variances_.data() + static_cast<std::ptrdiff_t>(j) * lanes_, lanes_, learnt_[j]);
  bank_kernels().surprise(view, views_->outputs.data(), taken, surprises_.data());
  const auto place = [&](int output) {
    return std::count_if(y, y + output, [](double each) { return !std::isnan(each); });
  };
  for (const RobustLoss& loss : setup_.robust) {
    for (int m = 0; m < lanes_; ++m) {
      double s = 0.0;
      for (const int output : loss.outputs)
        if (!std::isnan(y[output])) s += surprises_[place(output) * lanes_ + m];
      const double inverse_weight = std::sqrt(1.0 + s / (loss.delta * loss.delta));
      for (const int output : loss.outputs)
        output_variances_[static_cast<std::ptrdiff_t>(output) * lanes_ + m] *= inverse_weight;
    }
  }
}

}  // namespace rhec
