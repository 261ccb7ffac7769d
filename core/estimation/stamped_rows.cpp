#include "rhec/core/estimation/stamped_rows.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace rhec {

StampedRows::StampedRows(std::size_t capacity, int width)
    // Space for twice the rows, so that rows are moved to the front only once in `capacity` drops.
    : capacity_(capacity),
      width_(static_cast<std::size_t>(width)),
      times_(2 * capacity),
      values_(2 * capacity * width_) {}

std::size_t StampedRows::insert(double time, const double* values) noexcept {
  if (is_full()) {
    if (time < times_[first_]) return count_;
    drop_front(1);
  }
  if (first_ + count_ == times_.size()) {
    std::move(times_.begin() + static_cast<std::ptrdiff_t>(first_), times_.end(), times_.begin());
    std::move(values_.begin() + static_cast<std::ptrdiff_t>(first_ * width_), values_.end(), values_.begin());
    first_ = 0;
  }
  std::size_t at = first_ + count_;
  for (; at > first_ && times_[at - 1] > time; --at) {
    times_[at] = times_[at - 1];
    std::copy_n(values_.data() + (at - 1) * width_, width_, values_.data() + at * width_);
  }
  times_[at] = time;
  std::copy_n(values, width_, values_.data() + at * width_);
  ++count_;
  return at - first_;
}

std::size_t StampedRows::first_after(double time) const noexcept {
  const auto begin = times_.begin() + static_cast<std::ptrdiff_t>(first_);
  return static_cast<std::size_t>(std::upper_bound(begin, begin + static_cast<std::ptrdiff_t>(count_), time) - begin);
}

void StampedRows::drop_front(std::size_t rows) noexcept {
  first_ += rows;
  count_ -= rows;
  if (count_ == 0) first_ = 0;
}

void MeasuredRows::write_row(Measured measured) noexcept {
  for (int j = 0; j < outputs_; ++j) {
    row_[j] = measured[j];
    row_[outputs_ + j] = measured.weight(j);
  }
}

std::size_t MeasuredRows::insert(double time, Measured measured) noexcept {
  write_row(measured);
  return StampedRows::insert(time, row_.data());
}

bool MeasuredRows::replace(std::size_t i, Measured measured) noexcept {
  write_row(measured);
  const auto is_same = [](double a, double b) { return a == b || (std::isnan(a) && std::isnan(b)); };
  if (std::equal(row_.begin(), row_.end(), values(i), is_same)) return false;
  std::ranges::copy(row_, row(i));
  return true;
}

void MeasuredRows::remove(std::size_t i, const double* y) noexcept {
  for (int j = 0; j < outputs_; ++j)
    if (!std::isnan(y[j])) row(i)[j] = std::numeric_limits<double>::quiet_NaN();
}

}  // namespace rhec
