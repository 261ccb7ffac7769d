#pragma once

#include <chrono>
#include <functional>

namespace rhec {

/// While one lives, the clock of this program's deadlines (std::chrono::steady_clock) stands still but for what a test
/// says that each look at it takes. Not for several threads.
class TestClock {
 public:
  /// By how much the clock goes on before a look.
  using Look = std::function<std::chrono::nanoseconds()>;
  explicit TestClock(Look look);
  TestClock(const TestClock&) = delete;
  TestClock& operator=(const TestClock&) = delete;
  ~TestClock();
};

}  // namespace rhec
