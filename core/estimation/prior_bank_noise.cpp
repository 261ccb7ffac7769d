// How a PriorBank weighs its outputs: noise that it learns, and robust losses.
#include <algorithm>
#include <cmath>

#include "prior_bank_views.hpp"
#include "rhec/core/base/angle.hpp"
#include "rhec/core/kernels/kernel_sets.hpp"
#include "scale_slope.hpp"

namespace rhec {
namespace {

/// Variance of an adapted noise variance, relative to its square: before anything is known of it (a standard deviation
/// that is stated wrongly by a factor of up to three), and from where on it counts as identified.
constexpr double unknown_noise = 4.0, known_noise = 0.25;

}  // namespace

/// To what is stated.
void PriorBank::Filters::reset_noise() noexcept {
  std::fill(learnt_.begin(), learnt_.end(), 0.0);
  std::fill_n(learnt_.begin() + ny_, ny_, unknown_noise);
  std::copy(setup_.output_variances.begin(), setup_.output_variances.end(), learnt_.begin());
  spread_variances();
}

/// To all lanes, of outputs with weights (null: 1).
///
/// A variance R that was learnt from few residuals is too small as often as too large, and where it is too small a
/// measurement counts for too much. What changes forgets that, but a constant, such as a bias, does not: it would be
/// certain too soon. Of n residuals the variance V of R relative to its square is 2 / n, the posterior of R is an
/// inverse gamma distribution, and its mean is R (1 + V) in the first order (Gelman et al. 2013, section 3.3). Before
/// anything is learnt, what is stated counts.
void PriorBank::Filters::spread_variances(const double* weights) noexcept {
  for (int j = 0; j < ny_; ++j) {
    const double V = learnt_[ny_ + sensor_[j]];
    counted_[j] = learnt_[j] * (setup_.adapts_noise && V < unknown_noise ? 1.0 + V : 1.0);
    std::fill_n(output_variances_.data() + static_cast<std::ptrdiff_t>(j) * lanes_, lanes_,
                weights ? counted_[j] / weights[j] : counted_[j]);
  }
}

/// Derivatives of outputs with scale errors by these.
void PriorBank::Filters::find_scale_slopes(const Frame& frame, const double* y) noexcept {
  const BankView& view = frame.view;
  for (const auto [output, state] : setup_.scaled_outputs) {
    if (std::isnan(y[output])) continue;
    const std::ptrdiff_t j = output, entries = view.vehicle_states;
    const bool is_angle = model_->description().outputs[output].is_angle;
    for (std::ptrdiff_t m = 0; m < lanes_; ++m) {
      const double innovation = y[j] - predicted_[j * lanes_ + m];
      const auto gradient = [&](int c) { return frame.gradient[(j * entries + c) * lanes_ + m]; };
      frame.gradient[(j * entries + state) * lanes_ + m] =
          scale_slope(view.vehicle_states, state, 1.0 + view.mean[state * lanes_ + m],
                      is_angle ? angle_difference(innovation, 0.0) : innovation, output_variances_[j * lanes_ + m],
                      gradient, [&](int r, int c) {
                        return view.covariance[(static_cast<std::ptrdiff_t>(c) * view.states + r) * lanes_ + m];
                      });
    }
  }
}

PriorBank::Noise PriorBank::Filters::noise(int output) const noexcept {
  return {learnt_[output], counted_[output], !setup_.adapts_noise || learnt_[ny_ + sensor_[output]] < known_noise};
}

bool PriorBank::Filters::is_of_motion(int output) const noexcept {
  return std::ranges::binary_search(setup_.motion_outputs, output);
}

/// The innovation nu of an output has the variance S = h' P h + R before the update. With i = R / S, the residual r and
/// the covariance after it, nu^2 - S = (r^2 + h' P h - R) / i^2: a measurement of what R lacks, with the variance 2 S^2
/// (Mehra 1970). R follows by a scalar Kalman filter in units of itself, whose own variance V says how well R is known;
/// where S tells little about R, R hardly moves. What was used in its place, with what is not known of it and with
/// variances of second-order terms, makes i larger, and of S a part that is not R. Residuals are those of the most
/// probable member. The coordinates of a position are one sensor and change
/// together.
///
/// Of an output of motion, what nodes measure does not count: the interval is linearised where they put it. That makes
/// innovations smaller than S says, and little of S is R.
///
/// Where a sensor has a robust loss, a function of nu^2 / S that falls again for outliers takes its place, so that they
/// do not pass for noise (an M-estimator of scale: Huber 1981, chapter 5).
void PriorBank::Filters::adapt_noise(const Frame& frame, const double* y) noexcept {
  constexpr double steady_gain = 0.015, most_squares = 9.0, least_information = 1e-3, most_change = 2.0;
  constexpr double drift = 2.0 * steady_gain * steady_gain;
  const int best = most_probable(), entries = frame.view.vehicle_states, states = frame.view.states;
  for (int sensor = 0; sensor < ny_; ++sensor) {
    if (sensor_[sensor] != sensor || (!frame.is_between && is_of_motion(sensor))) continue;
    // Sums over the sensor's outputs, which do not depend on the axes of a position.
    double squares = 0.0, spread = 0.0, used = 0.0;
    int count = 0;
    for (int j = sensor; j < ny_; ++j) {
      if (sensor_[j] != sensor || std::isnan(y[j])) continue;
      const auto gradient = [&](int c) {
        return frame.gradient[(static_cast<std::ptrdiff_t>(j) * entries + c) * lanes_ + best];
      };
      const double weight = frame.weights ? frame.weights[j] : 1.0;
      double residual = y[j] - predicted_[static_cast<std::ptrdiff_t>(j) * lanes_ + best];
      if (model_->description().outputs[j].is_angle) residual = angle_difference(residual, 0.0);
      for (int c = 0; c < entries; ++c) {
        residual -= gradient(c) * (frame.view.mean[static_cast<std::ptrdiff_t>(c) * lanes_ + best] -
                                   frame.before[c * frame.before_entry + best * frame.before_lane]);
        for (int r = 0; r < entries; ++r)
          spread += weight * gradient(c) * gradient(r) *
                    frame.view.covariance[(static_cast<std::ptrdiff_t>(c) * states + r) * lanes_ + best];
      }
      squares += weight * residual * residual;
      used += weight * output_variances_[static_cast<std::ptrdiff_t>(j) * lanes_ + best];
      ++count;
    }
    if (count == 0) continue;
    double &R = learnt_[sensor], &V = learnt_[ny_ + sensor];
    double information = std::max(1.0 - spread / used, least_information);
    const double relative = used / (count * R), beyond = counted_[sensor] / R - 1.0;
    double expected = relative - beyond * information;  // i S / R, where S is that of R
    double surplus =
        (std::min((squares + spread) / used, most_squares) - 1.0) * relative + beyond * information * information;
    if (loss_of_[sensor] >= 0) {
      // The update was one with the weighted noise: what it found of h' P h holds for R as well.
      const double of_state = relative * (1.0 / information - 1.0);
      information = 1.0 / (1.0 + of_state);
      surplus =
          (1.0 + robust_surplus(y, sensor, best)) * (1.0 + beyond + of_state) * information * information - information;
      expected = 1.0;
    }
    // Of the surplus, i.e. divided by i^2.
    const double gain = V / (V * information * information + 2.0 * expected * expected / count);
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
void PriorBank::Filters::weigh_outputs(const Frame& frame, const double* y, int taken, const double* given) noexcept {
  for (int j = 0; j < ny_; ++j)
    std::fill_n(output_variances_.data() + static_cast<std::ptrdiff_t>(j) * lanes_, lanes_,
                counted_[j] / (frame.weights ? frame.weights[j] : 1.0) + added_[j]);
  bank_kernels().surprise(frame.view, views_->outputs.data(), taken, surprises_.data());
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
        output_variances_[static_cast<std::ptrdiff_t>(output) * lanes_ + m] *=
            given && given[output] > 0.0 ? 1.0 / given[output] : inverse_weight;
    }
  }
}

int PriorBank::Filters::most_probable() const noexcept {
  return static_cast<int>(std::max_element(weights_.begin(), weights_.begin() + members_) - weights_.begin());
}

double PriorBank::Filters::robust_weight(int output) const noexcept {
  // Noise that adapts has been spread anew since.
  const bool is_weighed = !stated_weights_.empty() && !setup_.robust.empty() && !setup_.adapts_noise;
  const double stated = is_weighed ? stated_weights_[output] : 1.0;
  return (counted_[output] / stated + added_[output]) /
         output_variances_[static_cast<std::ptrdiff_t>(output) * lanes_ + most_probable()];
}

/// What a group of outputs with s = sum of nu^2 / S says of their noise, relative to s. The threshold does not follow a
/// loss that is tighter: the noise may be several times what was stated, and must not pass for outliers either.
double PriorBank::Filters::scale_weight(double s, double delta) noexcept {
  constexpr double least_threshold = 4.0;
  const double threshold = std::max(delta, least_threshold), root = 1.0 + s / (threshold * threshold);
  return 1.0 / (root * root);
}

/// For n outputs without outliers, s has a chi-square distribution: the mean of what they say of their noise, by
/// Simpson's rule over r = sqrt(s), of which nothing is left at 12 standard deviations.
void PriorBank::Filters::find_loss_scales() {
  constexpr int steps = 2000;
  loss_of_.assign(ny_, -1);
  for (std::size_t k = 0; k < setup_.robust.size(); ++k) {
    const RobustLoss& loss = setup_.robust[k];
    std::vector<double> scales(loss.outputs.size() + 1, 1.0);
    for (std::size_t n = 1; n < scales.size(); ++n) {
      const double longest = std::sqrt(static_cast<double>(n)) + 12.0;
      double total = 0.0, mean = 0.0;
      for (int i = 0; i <= steps; ++i) {
        const double r = longest * i / steps, s = r * r;
        const double density = std::pow(r, static_cast<double>(n) - 1.0) * std::exp(-0.5 * s);
        const double share = (i == 0 || i == steps ? 1.0 : i % 2 == 0 ? 2.0 : 4.0) * density;
        total += share;
        mean += share * s * scale_weight(s, loss.delta);
      }
      scales[n] = mean / total / static_cast<double>(n);
    }
    for (const int output : loss.outputs) loss_of_[output] = static_cast<int>(k);
    loss_scales_.push_back(std::move(scales));
  }
}

/// nu^2 / S - 1 in the mean over the sensor's outputs, without the outliers that a loss finds.
double PriorBank::Filters::robust_surplus(const double* y, int sensor, int lane) const noexcept {
  double total = 0.0;
  int count = 0, place = 0;
  const auto surprise_at = [&](int each) { return surprises_[static_cast<std::ptrdiff_t>(each) * lanes_ + lane]; };
  for (int j = 0; j < ny_; ++j) {
    if (std::isnan(y[j])) continue;
    if (sensor_[j] == sensor) {
      if (loss_of_[j] < 0) {
        total += surprise_at(place);
      } else {
        const RobustLoss& loss = setup_.robust[loss_of_[j]];
        double s = 0.0;
        int present = 0;
        for (int each = 0, at = 0; each < ny_; ++each) {
          if (std::isnan(y[each])) continue;
          if (loss_of_[each] == loss_of_[j]) {
            s += surprise_at(at);
            ++present;
          }
          ++at;
        }
        total += surprise_at(place) * scale_weight(s, loss.delta) / loss_scales_[loss_of_[j]][present];
      }
      ++count;
    }
    ++place;
  }
  return count > 0 ? total / count - 1.0 : 0.0;
}

}  // namespace rhec
