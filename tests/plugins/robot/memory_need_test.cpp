#include "rhec/plugins/robot/memory_need.hpp"

#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstddef>
#include <fstream>
#include <memory>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "plugins/robot/robots.hpp"
#include "rhec/plugins/robot/blocking_section.hpp"
#include "rhec/plugins/robot/controller_section.hpp"
#include "rhec/plugins/robot/estimator_section.hpp"
#include "support/error_of.hpp"

namespace rhec {
namespace memory_need_test {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr bool is_told = false;  // by a sanitizer's allocator
#else
constexpr bool is_told = true;
#endif

constexpr double interval_bytes = 8000.0, other_bytes = 4e6;

std::shared_ptr<const void> of_known_size(int intervals) {
  return std::make_shared<const std::vector<char>>(static_cast<std::size_t>(other_bytes + interval_bytes * intervals));
}

/// As if the machine had no more than what is given beside what is used now.
class LittleMemory {
 public:
  explicit LittleMemory(double left) {
    getrlimit(RLIMIT_DATA, &before_);
    const double used = static_cast<double>(rlim_t{1} << 40) - free_below(rlim_t{1} << 40);
    set(static_cast<rlim_t>(used + left));
  }
  ~LittleMemory() { setrlimit(RLIMIT_DATA, &before_); }
  LittleMemory(const LittleMemory&) = delete;
  LittleMemory& operator=(const LittleMemory&) = delete;

 private:
  void set(rlim_t most) const {
    struct rlimit less = before_;
    less.rlim_cur = std::min(before_.rlim_max, most);
    setrlimit(RLIMIT_DATA, &less);
  }
  /// Of a limit, what is left of it: from the pages of data, proc(5).
  static double free_below(rlim_t limit) {
    double total = 0, resident = 0, shared = 0, text = 0, libraries = 0, data = 0;
    std::ifstream("/proc/self/statm") >> total >> resident >> shared >> text >> libraries >> data;
    return static_cast<double>(limit) - data * static_cast<double>(getpagesize());
  }
  struct rlimit before_ {};
};

TEST(MemoryNeed, IsThatOfEachIntervalAndTheRest) {
  if (!is_told) GTEST_SKIP();
  const auto need = measure_memory_need(of_known_size, 100);
  ASSERT_TRUE(need);
  EXPECT_NEAR(need->by_interval, interval_bytes, 0.01 * interval_bytes);
  EXPECT_NEAR(need->of(100000), other_bytes + 1e5 * interval_bytes, 0.01 * 1e5 * interval_bytes);
}

TEST(MemoryNeed, IsTheSameWhileAnotherThreadAllocates) {
  if (!is_told) GTEST_SKIP();
  std::atomic<bool> is_over = false;
  std::thread other([&] {
    for (int i = 0; !is_over; ++i) {
      of_known_size((i * 7919) % 1000);
      std::this_thread::sleep_for(std::chrono::microseconds(200));
    }
  });
  for (int i = 0; i < 50; ++i) {
    const auto need = measure_memory_need(of_known_size, 100);
    if (!need) continue;
    EXPECT_NEAR(need->by_interval, interval_bytes, 0.05 * interval_bytes);
  }
  is_over = true;
  other.join();
}

TEST(MemoryNeed, WhatGrowsNotAtAllHasNone) {
  EXPECT_FALSE(measure_memory_need([](int) { return of_known_size(0); }, 10));
}

TEST(MemoryNeed, FreeIsWhatALimitLeaves) {
  if (!is_told) GTEST_SKIP();
  const double before = free_memory();
  EXPECT_GT(before, 1e8);
  const LittleMemory little(2e8);
  EXPECT_NEAR(free_memory(), std::min(before, 2e8), 2e7);
}

TEST(MemoryNeed, MoreThanThereIsIsRefusedBeforeItIsMade) {
  if (!is_told) GTEST_SKIP();
  const Settings horizon = *settings("horizon: 100000").find("horizon");
  int most = 0;
  const auto make = [&](int intervals) {
    most = std::max(most, intervals);
    return of_known_size(intervals);
  };
  const LittleMemory little(4e8);
  EXPECT_THAT(error_of([&] { require_memory(horizon, {.intervals = 100000}, make); }),
              AllOf(HasSubstr("robot.yaml:1: horizon: 100000 intervals of 8 kB take 0.804 GB"),
                    HasSubstr("GB are free"), HasSubstr("expected at most 4"), Not(HasSubstr("room"))));
  EXPECT_LT(most, 1000);
  EXPECT_THAT(error_of([&] {
                require_memory(horizon, {100000, 64, "between"}, make);
              }),
              AllOf(HasSubstr("with room for 64 measurements in each (between)"), HasSubstr("or less room")));
  EXPECT_NO_THROW(require_memory(horizon, {.intervals = 10000}, make));
}

TEST(MemoryNeed, AHorizonThatIsTooShortToMeasureIsMadeLonger) {
  if (!is_told) GTEST_SKIP();
  const auto make = [&](int intervals) {
    if (intervals < 500) throw Error("an overlap of 500 needs a longer horizon");
    return of_known_size(intervals);
  };
  const LittleMemory little(4e8);
  EXPECT_THAT(error_of([&] { require_memory(settings("a: 1"), {.intervals = 100000}, make); }),
              HasSubstr("GB are free"));
  EXPECT_NO_THROW(require_memory(settings("a: 1"), {.intervals = 400}, make))
      << "its own mistakes are told when it is made";
}

TEST(MemoryNeed, LongHorizonsOfARobotAreRefusedAtTheirKeys) {
  if (!is_told) GTEST_SKIP();
  const auto context = context_with();
  const Path path({{0.0, 0.0, 2.0}, {10.0, 0.0, 2.0}});
  const LittleMemory little(4e8);
  for (const char* name : {"rhe", "bank"})
    EXPECT_THAT(error_of([&] {
                  EstimatorSection(context, BlockingSection(context, {}),
                                   settings(std::string("{name: ") + name + ", horizon: 100000}"))
                      .make();
                }),
                AllOf(HasSubstr("robot.yaml:1: horizon: 100000 intervals"), HasSubstr("(estimator.between)")))
        << name;
  EXPECT_THAT(
      error_of([&] {
        EstimatorSection(context, BlockingSection(context, {}), settings("{horizon: 100, between: 10000}")).make();
      }),
      AllOf(HasSubstr("robot.yaml:1: horizon: 100 intervals"), HasSubstr("room for 10000 measurements")));
  const LittleMemory less(1e8);
  EXPECT_THAT(
      error_of([&] { EstimatorSection(context, BlockingSection(context, {}), settings("{between: 10000}")).make(); }),
      AllOf(HasSubstr("robot.yaml:1: between: 15 intervals"), HasSubstr("room for 10000 measurements"),
            HasSubstr("GB that are free, and so do 4")));
  EXPECT_THAT(error_of([&] {
                EstimatorSection(context,
                                 BlockingSection(context, settings("{kappa: {name: structured, overlap: 100}}")),
                                 settings("{horizon: 100000}"))
                    .make();
              }),
              HasSubstr("robot.yaml:1: horizon: 100000 intervals"));
  EXPECT_THAT(error_of([&] { ControllerSection(context, settings("{horizon: 100000}")).make(path); }),
              HasSubstr("robot.yaml:1: horizon: 100000 intervals"));
  EXPECT_THAT(error_of([&] { ControllerSection(context, settings("{horizon: 20000 s}")).make(path); }),
              HasSubstr("robot.yaml:1: horizon: 100000 intervals"));
}

}  // namespace memory_need_test
}  // namespace rhec
