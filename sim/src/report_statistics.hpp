#pragma once

#include <cstddef>

namespace rhec::sim {

/// The value that a variable of Student's distribution with so many degrees of freedom (1 at least) stays below with a
/// probability of 97.5 %: half of a two-sided interval of 95 %.
double student_975(std::size_t degrees);

/// Mean and standard deviation of numbers that come one after the other.
class Moments {
 public:
  void add(double value) noexcept;
  std::size_t count() const noexcept { return count_; }
  double mean() const noexcept;        ///< NaN of none
  double half_width() const noexcept;  ///< of the 95 % interval of the mean; NaN of fewer than two

 private:
  std::size_t count_ = 0;
  double mean_ = 0.0, squares_ = 0.0;
};

}  // namespace rhec::sim
