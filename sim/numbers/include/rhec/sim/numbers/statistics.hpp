#pragma once

#include <cstddef>
#include <map>

#include "rhec/core/base/export.hpp"

namespace rhec::sim {

/// The value that a variable of Student's distribution with so many degrees of freedom (1 at least) stays below with a
/// probability of 97.5 %: half of a two-sided interval of 95 %.
RHEC_EXPORT double student_975(std::size_t degrees);

/// The same, each found once.
class RHEC_EXPORT StudentQuantiles {
 public:
  double of(std::size_t degrees);

 private:
  std::map<std::size_t, double> known_;
};

/// Mean and standard deviation of numbers that come one after the other.
class RHEC_EXPORT Moments {
 public:
  void add(double value) noexcept;
  std::size_t count() const noexcept { return count_; }
  double mean() const noexcept;  ///< NaN of none
  /// Of the 95 % interval of the mean; NaN of fewer than two.
  double half_width(StudentQuantiles& quantiles) const;

 private:
  std::size_t count_ = 0;
  double mean_ = 0.0, squares_ = 0.0;
};

}  // namespace rhec::sim
