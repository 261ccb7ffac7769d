#pragma once

#include <cstddef>
#include <map>

#include "rhec/core/base/export.hpp"

namespace rhec::sim {

/// The 97.5 % quantile of Student's t distribution (`degrees` at least 1): half the width of a two-sided 95 % interval.
RHEC_EXPORT double student_975(std::size_t degrees);

/// The same quantiles, cached.
class RHEC_EXPORT StudentQuantiles {
 public:
  double of(std::size_t degrees);

 private:
  std::map<std::size_t, double> known_;
};

/// Running mean and standard deviation.
class RHEC_EXPORT Moments {
 public:
  void add(double value) noexcept;
  std::size_t count() const noexcept { return count_; }
  double mean() const noexcept;  ///< NaN without values
  /// Half width of the mean's 95 % confidence interval; NaN for fewer than two values.
  double half_width(StudentQuantiles& quantiles) const;

 private:
  std::size_t count_ = 0;
  double mean_ = 0.0, squares_ = 0.0;
};

}  // namespace rhec::sim
