#pragma once

#include <chrono>

namespace rhec {

/// The clock of all deadlines; `Clock::time_point::max()` stands for none.
using Clock = std::chrono::steady_clock;

/// Whether a deadline is over. Does not read the clock where there is none.
inline bool is_past(Clock::time_point deadline) {
  return deadline != Clock::time_point::max() && Clock::now() > deadline;
}

/// Wall-clock time since a start [us].
inline double microseconds_since(Clock::time_point start) noexcept {
  return std::chrono::duration<double, std::micro>(Clock::now() - start).count();
}

}  // namespace rhec
