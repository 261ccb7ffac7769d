#pragma once

#include <array>
#include <cstddef>
#include <limits>

#include "rhec/core/base/export.hpp"

namespace rhec {

/// The usual interval of a sequence of times, such as the stamps of a sensor, and how far intervals differ from it.
///
/// Usual is the mean of the middle third of the last nine intervals: three gaps, or stamps that are nearly the same, do
/// not change it, and a sensor that gets another rate is known after six intervals. Times in seconds.
class RHEC_EXPORT Rhythm {
 public:
  /// The next time; one that is not later than the last one says nothing.
  void hear(double time) noexcept;
  void reset() noexcept { *this = {}; }
  /// [s]; NaN before the second time.
  double interval() const noexcept { return interval_; }
  /// Mean of by how much an interval differs from the usual one [s]; 0 before the third time.
  double deviation() const noexcept { return deviation_; }
  /// [s]; NaN before the first.
  double last() const noexcept { return last_; }

 private:
  static constexpr std::size_t remembered = 9;
  static constexpr double none = std::numeric_limits<double>::quiet_NaN();
  std::array<double, remembered> intervals_{};  ///< in a ring
  std::array<double, remembered> sorted_{};     ///< the same
  std::size_t count_ = 0;
  double interval_ = none, deviation_ = 0.0, last_ = none;
};

}  // namespace rhec
