#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "rhec/core/base/aligned.hpp"
#include "rhec/core/horizon/measured_interval.hpp"

namespace rhec {

/// What a model says of the measurements between the nodes of a moving horizon, by interval. A slot holds for the
/// numbers that it was computed from: they are compared, so that nobody need say what has changed.
class BetweenCache {
 public:
  /// `key`: entries that an interval's results depend on, beside the measurements' times; `each`: of a measurement;
  /// `together`: of all of an interval.
  BetweenCache(int intervals, int most, std::ptrdiff_t key, std::ptrdiff_t each, std::ptrdiff_t together);

  /// Room for the numbers that `holds` and `begin` take.
  double* key() noexcept { return key_.data(); }
  /// Whether an interval's results are those of `key()` and of measurements at these times.
  bool holds(int interval, const BetweenNodes& between) const noexcept;
  /// Whether the measurements' times are those of the last `begin`, and so is entry `same` of the key, whatever was
  /// forgotten since.
  bool has_times(int interval, const BetweenNodes& between, std::ptrdiff_t same) const noexcept;
  /// From now on they are; the caller writes them.
  void begin(int interval, const BetweenNodes& between) noexcept;
  double* results(int interval, int measurement) noexcept {
    return results_.data() + (static_cast<std::ptrdiff_t>(slot(interval)) * most_ + measurement) * each_;
  }
  double* results_together(int interval) noexcept { return together_.data() + slot(interval) * each_together_; }

  void forget() noexcept;
  /// The horizon has moved on by so many intervals.
  void move(int steps) noexcept { first_ = (first_ + steps) % intervals_; }

 private:
  bool has_times(int interval, const BetweenNodes& between) const noexcept;
  int slot(int interval) const noexcept { return (first_ + interval) % intervals_; }

  int intervals_, most_, first_ = 0;
  std::ptrdiff_t each_, each_together_;
  AlignedDoubles key_, keys_, results_, together_;
  std::vector<double> times_;
  std::vector<int> counts_;             ///< by slot; -1: none was ever known
  std::vector<std::uint8_t> is_known_;  ///< by slot: not forgotten
};

}  // namespace rhec
