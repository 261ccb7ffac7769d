#include "support/test_clock.hpp"

#include <sys/syscall.h>
#include <unistd.h>

#include <cstdint>
#include <ctime>
#include <utility>

namespace {

constexpr std::int64_t per_second = 1'000'000'000;
rhec::TestClock::Look look;
std::int64_t now = 0;  // [ns]

/// The system's.
int read_clock(clockid_t clock, timespec* time) { return static_cast<int>(syscall(SYS_clock_gettime, clock, time)); }

}  // namespace

namespace rhec {

TestClock::TestClock(Look of_test) {
  timespec time{};
  read_clock(CLOCK_MONOTONIC, &time);
  now = time.tv_sec * per_second + time.tv_nsec;
  look = std::move(of_test);
}

TestClock::~TestClock() { look = nullptr; }

}  // namespace rhec

// The C++ library's steady clock calls this one instead of that of the C library.
extern "C" [[gnu::visibility("default")]] int clock_gettime(clockid_t clock, timespec* time) noexcept {
  if (clock != CLOCK_MONOTONIC || !look) return read_clock(clock, time);
  now += look().count();
  time->tv_sec = now / per_second;
  time->tv_nsec = now % per_second;
  return 0;
}
