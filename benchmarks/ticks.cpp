#include "ticks.hpp"

#include <algorithm>
#include <array>

namespace rhec::bench {

/// Calibrated against the steady clock over 20 ms.
double Ticks::microseconds_per_count() noexcept {
  static const double value = [] {
    using Steady = std::chrono::steady_clock;
    const auto start = Steady::now();
    const Count first = now();
    while (Steady::now() - start < std::chrono::milliseconds(20)) {
    }
    const Count last = now();
    const std::chrono::duration<double, std::micro> elapsed = Steady::now() - start;
    return elapsed.count() / static_cast<double>(last - first);
  }();
  return value;
}

/// The median difference of two consecutive readings.
Ticks::Count Ticks::overhead() noexcept {
  static const Count value = [] {
    std::array<Count, 1001> differences{};
    for (Count& difference : differences) {
      const Count first = now();
      difference = now() - first;
    }
    std::nth_element(differences.begin(), differences.begin() + 500, differences.end());
    return differences[500];
  }();
  return value;
}

}  // namespace rhec::bench
