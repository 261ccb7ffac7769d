#pragma once

#include <array>
#include <cstddef>

#include "rhec/core/estimation/health.hpp"

namespace rhec {

/// Whether the innovations of a sensor are as large together as a filter says.
///
/// Where model and noise are what a filter assumes, normalised innovations L^-1 nu (S = L L') are white (Mehra 1970): a
/// sum over m of them has the variance m. Errors that last, such as fixes that are off by the same for seconds, or a
/// drift sideways that no model has, are hardly seen in single ones, but those that follow each other agree: the
/// variance of sums is larger, and by so much less is learnt from them than the filter believes (long-run variance,
/// Bartlett's window: Newey and West 1987). It is estimated for sums over 1, 2, 4, ... innovations, of late.
class InnovationWhiteness {
 public:
  void reset() noexcept { *this = {}; }
  /// The next innovation that was used. `values`: that the sensor has; one with fewer says nothing.
  void take(const Innovation& innovation, std::size_t values) noexcept;
  /// By how much larger the variance of a covariance that was learnt from this sensor is to be; 1 where sums are no
  /// larger than expected by more than a standard deviation of what is known of them.
  double factor() const noexcept { return factor_; }
  /// How much larger the squares of sums of innovations are than those of as many independent ones of the same size,
  /// once the mean of late is taken out: because errors last, and not because they are constant.
  double correlation() const noexcept { return correlation_; }
  /// The same of the last `count`, or of as many as are remembered, about a straight line: what is left of a sensor
  /// that is off by a constant since then, or by more and more.
  double correlation_of_last(std::size_t count) const noexcept;
  /// Innovations that were taken so far.
  std::size_t count() const noexcept { return count_; }

 private:
  static constexpr std::size_t levels = 7, longest = 1u << (levels - 1), remembered = 4 * longest;
  struct Level {
    double variance = 0.0;  ///< of a sum over 2^level, relative to what is expected
    double count = 0.0, gain = 0.0;
    double usual = 0.0;  ///< a variance up to this is no larger than expected, as far as is known
  };
  using Values = std::array<double, most_sensor_outputs>;
  std::array<Level, levels> levels_{};
  std::array<Values, remembered> sums_{};  ///< of all innovations until one, in a ring
  Values sum_{}, mean_{};
  std::size_t values_ = 0;
  std::size_t count_ = 0;
  double factor_ = 1.0, correlation_ = 1.0;
};

}  // namespace rhec
