#include "between_cache.hpp"

#include <algorithm>
#include <cstring>

namespace rhec {

BetweenCache::BetweenCache(int intervals, int most, std::ptrdiff_t key, std::ptrdiff_t each, std::ptrdiff_t together)
    : intervals_(std::max(intervals, 1)), most_(most), each_(each), each_together_(together) {
  const auto slots = static_cast<std::size_t>(intervals_);
  key_.assign(static_cast<std::size_t>(key), 0.0);
  keys_.assign(slots * key_.size(), 0.0);
  results_.assign(slots * static_cast<std::size_t>(most * each), 0.0);
  together_.assign(slots * static_cast<std::size_t>(together), 0.0);
  times_.assign(slots * static_cast<std::size_t>(most), 0.0);
  counts_.assign(slots, -1);
  is_known_.assign(slots, 0);
}

bool BetweenCache::has_times(int interval, const BetweenNodes& between) const noexcept {
  const auto at = static_cast<std::size_t>(slot(interval));
  if (counts_[at] != between.count()) return false;
  const double* const times = times_.data() + at * static_cast<std::size_t>(most_);
  for (int k = 0; k < between.count(); ++k)
    if (times[k] != between.time(k)) return false;
  return true;
}

bool BetweenCache::has_times(int interval, const BetweenNodes& between, std::ptrdiff_t same) const noexcept {
  const double before = keys_[static_cast<std::size_t>(slot(interval)) * key_.size() + static_cast<std::size_t>(same)];
  return before == key_[static_cast<std::size_t>(same)] && has_times(interval, between);
}

bool BetweenCache::holds(int interval, const BetweenNodes& between) const noexcept {
  const auto at = static_cast<std::size_t>(slot(interval));
  return is_known_[at] &&
         std::memcmp(key_.data(), keys_.data() + at * key_.size(), key_.size() * sizeof(double)) == 0 &&
         has_times(interval, between);
}

void BetweenCache::begin(int interval, const BetweenNodes& between) noexcept {
  const auto at = static_cast<std::size_t>(slot(interval));
  counts_[at] = between.count();
  is_known_[at] = 1;
  std::copy(key_.begin(), key_.end(), keys_.begin() + static_cast<std::ptrdiff_t>(at * key_.size()));
  for (int k = 0; k < between.count(); ++k) times_[at * static_cast<std::size_t>(most_) + k] = between.time(k);
}

void BetweenCache::forget() noexcept { std::fill(is_known_.begin(), is_known_.end(), 0); }

}  // namespace rhec
