#include "rhec/core/estimation/clocks.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <utility>
#include <vector>

namespace rhec {
namespace clocks_test {

constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr double nan = std::numeric_limits<double>::quiet_NaN();

struct TwoClocks : ::testing::Test {
  Clocks clocks{2, {.usual_interval = 0.1, .behind = 3.0, .longest_gap = 60.0}};
  /// Both sources deliver at 10 Hz.
  double run(double from, int samples, double offset = 0.0) {
    for (int k = 0; k < samples; ++k) {
      const double time = from + 0.1 * k;
      EXPECT_NEAR(clocks.take(0, time + offset), time, 1e-9) << k;
      EXPECT_NEAR(clocks.take(1, time + offset), time, 1e-9) << k;
    }
    return from + 0.1 * samples;
  }
};

TEST_F(TwoClocks, StampsInOrderStayAsTheyAre) {
  const double end = run(1.7e9, 100);
  EXPECT_EQ(clocks.refused(), 0);
  EXPECT_EQ(clocks.settings(), 0);
  EXPECT_NEAR(clocks.now(), end - 0.1, 1e-6);
  EXPECT_NEAR(clocks.usual_interval(0), 0.1, 1e-6);
}

/// Who delivers along with another whose stamp is right has a right one.
TEST_F(TwoClocks, NobodyIsSuspectedWhoDeliversAlongWithOthers) {
  const double end = run(100.0, 100);
  EXPECT_TRUE(std::isnan(clocks.take(1, end + 4.0)));
  EXPECT_TRUE(clocks.is_suspected(1));
  EXPECT_TRUE(std::isnan(clocks.take(0, end + 4.1)));
  EXPECT_NEAR(clocks.take(0, end + 4.2), end + 4.2, 1e-9);
  clocks.also(1, end + 4.2);
  EXPECT_FALSE(clocks.is_suspected(0));
  EXPECT_FALSE(clocks.is_suspected(1));
}

TEST_F(TwoClocks, OneWrongStampChangesNothing) {
  for (const double wrong : {1e9, -1e9, 20.0, infinity, nan, 7.5}) {
    clocks.reset();
    const double time = run(10.0, 50);
    EXPECT_TRUE(std::isnan(clocks.take(0, wrong)) || wrong == 7.5) << wrong;
    run(time, 20);
    EXPECT_EQ(clocks.settings(), 0) << wrong;
  }
}

TEST_F(TwoClocks, AClockThatIsSetIsRecognisedWithinFiveSamples) {
  for (const double jump : {1000.0, -1000.0, -5.0, 100.0, -1.0}) {
    clocks.reset();
    double time = run(10.0, 50);
    double place = nan;
    for (int k = 0; k < 5; ++k, time += 0.1) place = clocks.take(0, time + jump);
    EXPECT_NEAR(place, time - 0.1, 0.11) << jump;
    EXPECT_EQ(clocks.settings(), 1) << jump;
    // The other source's clock was set by as much: it follows at once, and the two stay together.
    EXPECT_NEAR(clocks.take(1, time + jump), clocks.take(0, time + jump), 1e-9) << jump;
  }
}

TEST_F(TwoClocks, TheClockOfOneSourceAloneIsSet) {
  double time = run(10.0, 50);
  for (int k = 0; k < 20; ++k, time += 0.1) {
    clocks.take(0, time - 500.0);
    EXPECT_NEAR(clocks.take(1, time), time, 1e-9);
  }
  EXPECT_NEAR(clocks.take(0, time - 500.0), time, 0.11);
}

/// A source that goes by another clock from its first stamp on is not older than the others.
TEST_F(TwoClocks, ASourceWithAnotherEpochIsAsNewAsTheOthers) {
  for (const double interval : {0.1, 0.2, 1.0}) {
    clocks.reset();
    double time = 10.0, next = 10.0, place = nan;
    for (int k = 0; k < 100; ++k, time += 0.1) {
      clocks.take(1, time);
      if (time < next - 1e-6) continue;
      place = clocks.take(0, 1.7e9 + time);
      next += interval;
      if (k > 50) {
        EXPECT_NEAR(place, time, 0.01) << interval;
      }
    }
    EXPECT_EQ(clocks.settings(), 1);
  }
}

/// Half a second is no gap, and less than five intervals of a receiver at 5 Hz.
TEST(ClocksOfSensors, AreSetByLittle) {
  std::mt19937 random(11);
  std::normal_distribution<double> normal;
  for (const double step : {0.3, 0.5, 1.0, -0.3, -0.5, -1.0}) {
    for (const double interval : {0.1, 0.2, 1.0}) {
      Clocks clocks{3, {.usual_interval = 0.1, .behind = 3.0, .longest_gap = 60.0}};
      // Delivered late, by 0.1 s and a jitter of 5 ms; encoder and inputs at 20 Hz.
      int messages = 0, wrong = 0;
      double last = 0.0;
      for (int tick = 0; tick < 3000; ++tick) {
        const double time = 0.05 * tick;
        clocks.take(1, time);
        clocks.take(2, time);
        const double measured = time - 0.1 + 0.005 * normal(random);
        if (measured < last + interval - 0.02) continue;
        last = measured;
        const bool is_set = time > 60.0;
        const double place = clocks.take(0, measured + (is_set ? step : 0.0));
        messages += is_set;
        if (!is_set || messages > 5) {
          EXPECT_NEAR(place, measured, 0.06) << step << " s, every " << interval << " s, at " << time;
          wrong += !(std::abs(place - measured) < 0.06);
        }
        if (wrong > 3) break;
      }
      EXPECT_EQ(clocks.settings(), 1) << step << " s, every " << interval << " s";
    }
  }
}

/// Messages that are lost, held up, or come in bursts do not set a clock; nor does it matter if the others are silent.
TEST(ClocksOfSensors, AreNotSetByWhatHappensToMessages) {
  std::mt19937 random(12);
  std::uniform_real_distribution<double> uniform;
  std::normal_distribution<double> normal;
  Clocks clocks{3, {.usual_interval = 0.1, .behind = 3.0, .longest_gap = 60.0}};
  struct Message {
    double arrival, stamp;
    int source;
  };
  std::vector<Message> messages;
  double held_until = 0.0, others_from = 0.0;
  for (int tick = 0; tick < 60000; ++tick) {
    const double time = 0.05 * tick;
    if (uniform(random) < 0.003) held_until = time + 1.5 * uniform(random);
    if (uniform(random) < 0.003) others_from = time + 1.5 * uniform(random);
    const double late = 0.1 + std::abs(0.02 * normal(random));
    if (tick % 4 == 0 && uniform(random) < 0.9) messages.push_back({std::max(time + late, held_until), time, 0});
    if (time < others_from) continue;
    messages.push_back({time + 0.002, time, 1});
    messages.push_back({time + 0.01 * uniform(random), time, 2});
  }
  std::ranges::stable_sort(messages, {}, &Message::arrival);
  for (const Message& each : messages) clocks.take(each.source, each.stamp);
  EXPECT_EQ(clocks.settings(), 0);
  EXPECT_LT(clocks.refused(), 30);
}

TEST_F(TwoClocks, AGapIsAGap) {
  const double time = run(10.0, 50) + 20.0;
  EXPECT_TRUE(std::isnan(clocks.take(0, time)));
  EXPECT_EQ(clocks.take(0, time + 0.1), time + 0.1);
  EXPECT_EQ(clocks.settings(), 0);
}

TEST_F(TwoClocks, DataThatWereHeldUpAreLate) {
  double time = run(10.0, 50);
  for (int k = 0; k < 10; ++k) clocks.take(1, time + 0.1 * k);
  // Source 0 delivers the newest first, then the rest.
  EXPECT_NEAR(clocks.take(0, time + 0.9), time + 0.9, 1e-9);
  for (int k = 0; k < 9; ++k) EXPECT_NEAR(clocks.take(0, time + 0.1 * k), time + 0.1 * k, 1e-9) << k;
  EXPECT_EQ(clocks.settings(), 0);
  time += 1.0;
  run(time, 10);
}

TEST_F(TwoClocks, JitterAndDisorderAreNoReason) {
  std::mt19937 random(3);
  std::normal_distribution<double> jitter(0.0, 0.02);
  for (int k = 0; k < 5000; ++k) {
    const double time = 5.0 + 0.1 * k + jitter(random) - (k % 7 == 0 ? 0.25 : 0.0);
    EXPECT_EQ(clocks.take(0, time), time) << k;
    EXPECT_EQ(clocks.take(1, 5.0 + 0.1 * k), 5.0 + 0.1 * k) << k;
  }
  EXPECT_EQ(clocks.settings(), 0);
  EXPECT_EQ(clocks.refused(), 0);
}

/// A quick sensor whose messages overtake each other by many of its intervals, as over a wireless network.
TEST_F(TwoClocks, AQuickSourceMayDeliverInAnyOrder) {
  for (const double held_up : {0.005, 0.03, 0.1}) {
    std::mt19937 engine(5);
    std::exponential_distribution<double> delay(1.0 / held_up);
    std::vector<std::pair<double, double>> messages;  // arrival, stamp
    for (int k = 0; k < 6000; ++k) messages.emplace_back(10.0 + 0.005 * k + delay(engine), 10.0 + 0.005 * k);
    std::sort(messages.begin(), messages.end());
    clocks.reset();
    for (const auto& [arrival, stamp] : messages) EXPECT_EQ(clocks.take(0, stamp), stamp) << held_up;
    EXPECT_EQ(clocks.settings(), 0) << held_up;
  }
}

TEST_F(TwoClocks, AskedTimesAreThoseOfTheClockThatFits) {
  double time = run(10.0, 50);
  EXPECT_EQ(clocks.place_of(time), time);
  for (int k = 0; k < 5; ++k, time += 0.1) clocks.take(0, time - 1000.0);
  EXPECT_NEAR(clocks.place_of(time - 1000.0), time, 0.11);
  EXPECT_NEAR(clocks.place_of(time), time, 1e-9);  // of one whose clock was not set
}

TEST_F(TwoClocks, EvenAWrongFirstStampIsForgotten) {
  clocks.take(0, 1e12);
  double place = nan;
  for (int k = 0; k < 5; ++k) place = clocks.take(0, 3.0 + 0.1 * k);
  EXPECT_TRUE(std::isfinite(place));
  EXPECT_NEAR(clocks.take(0, 3.5), place + 0.1, 1e-3);
}

/// Nothing says beforehand how slow a source is.
TEST_F(TwoClocks, ASlowSourceIsKnownAfterTwoStamps) {
  for (const double interval : {0.3, 1.0, 2.0, 7.0, 30.0}) {
    clocks.reset();
    EXPECT_FALSE(clocks.knows_interval(0));
    for (int k = 0; k < 40 * 10; ++k) {
      const double time = 10.0 + 0.1 * k;
      EXPECT_EQ(clocks.take(1, time), time);
      const double stamp = 10.0 + interval * std::floor((time - 10.0) / interval + 1e-9);
      if (stamp <= clocks.newest(0)) continue;
      EXPECT_EQ(clocks.take(0, stamp), stamp) << interval;
      if (stamp > 10.0) {
        EXPECT_NEAR(clocks.usual_interval(0), interval, 1e-9);
      }
    }
    EXPECT_TRUE(clocks.knows_interval(0));
    EXPECT_EQ(clocks.settings(), 0) << interval;
  }
}

/// No other source tells the time.
TEST(OneClock, MayBeSlowOrBecomeSlow) {
  for (const double interval : {1.0, 2.5, 20.0}) {
    Clocks clocks{1, {.usual_interval = 0.1, .behind = 3.0, .longest_gap = 60.0}};
    int refused = 0;
    for (int k = 0; k < 50; ++k) refused += std::isnan(clocks.take(0, 5.0 + interval * k));
    EXPECT_LE(refused, 1) << interval;
    EXPECT_EQ(clocks.settings(), 0) << interval;

    clocks.reset();
    for (int k = 0; k < 50; ++k) EXPECT_EQ(clocks.take(0, 5.0 + 0.1 * k), 5.0 + 0.1 * k);
    refused = 0;
    for (int k = 0; k < 50; ++k) {
      const double time = 9.9 + interval * (k + 1), place = clocks.take(0, time);
      refused += std::isnan(place);
      if (k > 25) {
        EXPECT_EQ(place, time) << interval;
      }
    }
    EXPECT_LE(refused, 12) << interval;
    EXPECT_EQ(clocks.settings(), 0) << interval;
  }
}

}  // namespace clocks_test
}  // namespace rhec
