#include "rhec/core/horizon/measured_interval.hpp"

#include <algorithm>
#include <cstddef>
#include <limits>

namespace rhec {

void BetweenNodes::assign(const MeasuredInterval& interval) noexcept {
  count_ = std::min(interval.between, most());
  std::copy_n(interval.times, count_, times_.begin());
  std::copy_n(interval.outputs, static_cast<std::ptrdiff_t>(count_) * width_, outputs_.begin());
}

void BetweenNodes::assign(const BetweenNodes& from) noexcept { assign(from.over(0.0, nullptr)); }

double* BetweenNodes::add(double time) noexcept {
  if (count_ == most()) return nullptr;
  times_[count_] = time;
  double* const row = outputs(count_++);
  std::fill_n(row, width_, std::numeric_limits<double>::quiet_NaN());
  return row;
}

}  // namespace rhec
