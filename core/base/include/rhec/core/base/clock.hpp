#pragma once

#include <chrono>

namespace rhec {

/// The clock of all deadlines; `Clock::time_point::max()` means no deadline.
using Clock = std::chrono::steady_clock;

/// Whether a deadline has passed. Does not read the clock if there is no deadline.
inline bool is_past(Clock::time_point deadline) {
  return deadline != Clock::time_point::max() && Clock::now() > deadline;
}

/// Wall-clock time since a start [us].
inline double microseconds_since(Clock::time_point start) noexcept {
  return std::chrono::duration<double, std::micro>(Clock::now() - start).count();
}

}  // namespace rhec
