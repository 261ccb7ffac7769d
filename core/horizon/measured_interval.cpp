#include "rhec/core/horizon/measured_interval.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

namespace rhec {

MeasuredOutputs::MeasuredOutputs(int outputs)
    : values_(static_cast<std::size_t>(outputs), std::numeric_limits<double>::quiet_NaN()),
      weights_(values_.size(), 1.0) {}

void MeasuredOutputs::clear() noexcept {
  std::ranges::fill(values_, std::numeric_limits<double>::quiet_NaN());
  if (has_weights_) std::ranges::fill(weights_, 1.0);
  has_weights_ = false;
}

void MeasuredOutputs::add(Measured from) noexcept {
  for (std::size_t j = 0; j < values_.size(); ++j) {
    const auto output = static_cast<std::ptrdiff_t>(j);
    if (std::isnan(from[output])) continue;
    values_[j] = from[output];
    weights_[j] = from.weight(output);
    has_weights_ = has_weights_ || weights_[j] != 1.0;
  }
}

void MeasuredOutputs::remove(const double* y) noexcept {
  for (std::size_t j = 0; j < values_.size(); ++j)
    if (!std::isnan(y[j])) values_[j] = std::numeric_limits<double>::quiet_NaN();
}

void BetweenNodes::assign(const MeasuredInterval& interval) noexcept {
  count_ = std::min(interval.between, most());
  std::copy_n(interval.times, count_, times_.begin());
  const std::ptrdiff_t values = static_cast<std::ptrdiff_t>(count_) * width_;
  std::copy_n(interval.outputs, values, outputs_.begin());
  has_weights_ = interval.weights != nullptr;
  if (has_weights_) std::copy_n(interval.weights, values, weights_.begin());
}

void BetweenNodes::assign(const BetweenNodes& from) noexcept { assign(from.over(0.0, nullptr)); }

double* BetweenNodes::add(double time) noexcept {
  if (count_ == most()) return nullptr;
  times_[count_] = time;
  double* const row = outputs(count_++);
  std::fill_n(row, width_, std::numeric_limits<double>::quiet_NaN());
  if (has_weights_) std::fill_n(weigh(count_ - 1), width_, 1.0);
  return row;
}

double* BetweenNodes::weigh(int i) noexcept {
  if (!has_weights_) std::ranges::fill(weights_, 1.0);
  has_weights_ = true;
  return weights_.data() + static_cast<std::ptrdiff_t>(i) * width_;
}

void BetweenNodes::add_outputs(int i, Measured from) noexcept {
  for (std::ptrdiff_t j = 0; j < width_; ++j) {
    if (std::isnan(from[j])) continue;
    outputs(i)[j] = from[j];
    if (has_weights_ || from.weight(j) != 1.0) weigh(i)[j] = from.weight(j);
  }
}

}  // namespace rhec
