#pragma once

#include <chrono>
#include <cstdint>
#if defined(__x86_64__)
#include <x86intrin.h>
#endif

namespace rhec::bench {

/// A clock for intervals of about a microsecond: the processor's time-stamp counter on x86-64, which takes nanoseconds
/// to read, and the steady clock elsewhere.
class Ticks {
 public:
  using Count = std::int64_t;

  static Count now() noexcept {
#if defined(__x86_64__)
    unsigned processor = 0;
    const auto count = static_cast<Count>(__rdtscp(&processor));
    _mm_lfence();  // no timed instruction starts before the counter is read
    return count;
#else
    return std::chrono::steady_clock::now().time_since_epoch().count();
#endif
  }

  /// The time between two readings [us], minus the cost of a reading.
  static double microseconds(Count from, Count to) noexcept {
    return static_cast<double>(to - from - overhead()) * microseconds_per_count();
  }

 private:
  static double microseconds_per_count() noexcept;
  static Count overhead() noexcept;
};

}  // namespace rhec::bench
