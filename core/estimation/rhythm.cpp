#include "rhec/core/estimation/rhythm.hpp"

#include <algorithm>
#include <cmath>

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
  // The new one takes the place of the oldest, from where it moves to its own.
  double& oldest = intervals_[count_ % remembered];
  const std::size_t known = std::min(count_ + 1, remembered), left_out = known / 3;
  std::size_t at = count_ < remembered ? count_ : 0;
  while (count_ >= remembered && sorted_[at] != oldest) ++at;
  for (; at > 0 && sorted_[at - 1] > interval; --at) sorted_[at] = sorted_[at - 1];
  for (; at + 1 < known && sorted_[at + 1] < interval; ++at) sorted_[at] = sorted_[at + 1];
  sorted_[at] = oldest = interval;
  ++count_;
  interval_ = 0.0;
  for (std::size_t i = left_out; i < known - left_out; ++i) interval_ += sorted_[i];
  interval_ /= static_cast<double>(known - 2 * left_out);
}

}  // namespace rhec
