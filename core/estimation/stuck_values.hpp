#pragma once

#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

namespace rhec {

/// Finds outputs that give one value again and again while the vehicle moves. A sensor with noise does not, unless it
/// has coarse steps; then the same value is believed as long as the vehicle has moved by less than the noise hides.
class StuckValues {
 public:
  StuckValues() = default;
  /// `motion_outputs`: that depend on inputs.
  explicit StuckValues(const std::vector<double>& variances, const std::vector<int>& motion_outputs = {}) {
    for (const double variance : variances) outputs_.push_back({.sigma = std::sqrt(variance)});
    for (const int output : motion_outputs) outputs_[static_cast<std::size_t>(output)].is_of_motion = true;
  }
  void reset() noexcept {
    for (Output& each : outputs_) each = {.sigma = each.sigma, .is_of_motion = each.is_of_motion};
  }
  /// A measured value (NaN: none), and what was expected before it was used.
  void take(std::size_t output, double value, double expected) noexcept {
    Output& each = outputs_[output];
    // What the vehicle's motion has added since the last sample, by its own: angles change by little in a sample. It
    // does so in samples that have values of other sensors alone, too.
    if (each.is_of_motion)
      each.movement = expected - each.first_expected;
    else if (!std::isnan(each.corrected))
      each.movement += expected - each.corrected;
    if (std::isnan(value)) return;
    ++each.values;
    if (value != each.last) {
      each.last = value;
      each.first_expected = expected;
      each.repeats = 0;
      each.movement = 0.0;
      return;
    }
    ++each.repeats;
    ++each.all_repeats;
  }
  /// What is expected after the sample was used.
  void corrected(std::size_t output, double expected) noexcept { outputs_[output].corrected = expected; }
  bool is_stuck(std::size_t output) const noexcept {
    const Output& each = outputs_[output];
    const double movement = std::abs(each.movement);
    // One that never repeated itself is stuck sooner than one with coarse steps.
    const bool repeats_seldom = each.values > 20 && 50 * (each.all_repeats - each.repeats) < each.values;
    return (each.repeats >= 2 && repeats_seldom && movement > each.sigma) ||
           (each.repeats >= 3 && movement > 3.0 * each.sigma);
  }

 private:
  struct Output {
    double sigma = 0.0;
    bool is_of_motion = false;
    double last = std::numeric_limits<double>::quiet_NaN();
    double corrected = std::numeric_limits<double>::quiet_NaN(), movement = 0.0;
    double first_expected = 0.0;  ///< where the value that it repeats came first
    int repeats = 0;
    long values = 0, all_repeats = 0;
  };
  std::vector<Output> outputs_;
};

}  // namespace rhec
