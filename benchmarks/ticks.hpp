#pragma once

#include <chrono>
#include <cstdint>
#if defined(__x86_64__)
#include <x86intrin.h>
#endif

namespace rhec::bench {

/// A clock for stretches of a microsecond: the processor's counter where there is one that runs evenly, so that reading
/// it costs nanoseconds.
class Ticks {
 public:
  using Count = std::int64_t;

  static Count now() noexcept {
#if defined(__x86_64__)
    unsigned processor = 0;
    const auto count = static_cast<Count>(__rdtscp(&processor));
    _mm_lfence();  // nothing of what is timed begins before
    return count;
#else
    return std::chrono::steady_clock::now().time_since_epoch().count();
#endif
  }

  /// The time between two readings [us], without what the reading itself costs.
  static double microseconds(Count from, Count to) noexcept {
    return static_cast<double>(to - from - overhead()) * microseconds_per_count();
  }

 private:
  static double microseconds_per_count() noexcept;
  static Count overhead() noexcept;
};

}  // namespace rhec::bench
