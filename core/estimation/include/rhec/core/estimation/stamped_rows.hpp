#pragma once

#include <cstddef>
#include <vector>

#include "rhec/core/base/export.hpp"
#include "rhec/core/horizon/measured_interval.hpp"

namespace rhec {

/// Rows of numbers in the order of their time stamps; of those with one stamp, the one pushed last is the last. Only
/// its constructor allocates: when it is full, the oldest row gives way.
class RHEC_EXPORT StampedRows {
 public:
  StampedRows(std::size_t capacity, int width);

  /// Where the row is now; the oldest row is gone if there was no room. A row that is older than all others of a full
  /// store is not taken: `size()`.
  std::size_t insert(double time, const double* values) noexcept;
  bool is_full() const noexcept { return count_ == capacity_; }
  std::size_t size() const noexcept { return count_; }
  double time(std::size_t i) const noexcept { return times_[first_ + i]; }
  const double* values(std::size_t i) const noexcept { return values_.data() + (first_ + i) * width_; }
  /// The first row behind a time; `size()` if there is none.
  std::size_t first_after(double time) const noexcept;
  void drop_front(std::size_t rows) noexcept;
  void clear() noexcept { first_ = count_ = 0; }

 protected:
  double* row(std::size_t i) noexcept { return values_.data() + (first_ + i) * width_; }

 private:
  std::size_t capacity_, width_, first_ = 0, count_ = 0;
  std::vector<double> times_, values_;
};

/// The same of measurements, with their weights.
class RHEC_EXPORT MeasuredRows final : public StampedRows {
 public:
  MeasuredRows(std::size_t capacity, int outputs)
      : StampedRows(capacity, 2 * outputs), outputs_(outputs), row_(2 * static_cast<std::size_t>(outputs)) {}

  std::size_t insert(double time, Measured measured) noexcept;
  Measured measured(std::size_t i) const noexcept { return {values(i), values(i) + outputs_}; }
  /// Row i loses the outputs that are not missing in y (n_y).
  void remove(std::size_t i, const double* y) noexcept;
  /// Row i keeps its time. False, and nothing else, if that is what it has.
  bool replace(std::size_t i, Measured measured) noexcept;

 private:
  void write_row(Measured measured) noexcept;

  int outputs_;
  std::vector<double> row_;  ///< outputs, then their weights
};

}  // namespace rhec
