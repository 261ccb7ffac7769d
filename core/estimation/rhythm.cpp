#include "rhec/core/estimation/rhythm.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace rhec {
namespace {

constexpr double to_new_deviation = 0.1;

}  // namespace

void Rhythm::hear(double time) noexcept {
  const double interval = time - last_;
  if (interval <= 0.0) return;
  last_ = time;
  if (std::isnan(interval)) return;
  if (count_ > 0) deviation_ += to_new_deviation * (std::min(std::abs(interval - interval_), interval_) - deviation_);
  intervals_[count_++ % remembered] = interval;
  std::array<double, remembered> sorted = intervals_;
  const std::size_t known = std::min(count_, remembered), left_out = known / 3;
  std::sort(sorted.begin(), sorted.begin() + static_cast<std::ptrdiff_t>(known));
  const auto middle = sorted.begin() + static_cast<std::ptrdiff_t>(left_out);
  const std::size_t counted = known - 2 * left_out;
  interval_ =
      std::accumulate(middle, middle + static_cast<std::ptrdiff_t>(counted), 0.0) / static_cast<double>(counted);
}

}  // namespace rhec
