#include "rhec/core/estimation/rhythm.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace rhec {
namespace rhythm_test {

TEST(Rhythm, IsKnownAfterTwoTimes) {
  Rhythm rhythm;
  EXPECT_TRUE(std::isnan(rhythm.interval()));
  rhythm.hear(1.7e9);
  EXPECT_TRUE(std::isnan(rhythm.interval()));
  rhythm.hear(1.7e9 + 1.0);
  EXPECT_EQ(rhythm.interval(), 1.0);
  EXPECT_EQ(rhythm.last(), 1.7e9 + 1.0);
  rhythm.reset();
  EXPECT_TRUE(std::isnan(rhythm.interval()));
}

TEST(Rhythm, GapsAndStampsThatComeTwiceDoNotChangeIt) {
  Rhythm rhythm;
  double time = 0.0;
  for (int k = 0; k < 300; ++k) {
    time += k % 20 == 19 ? 30.0 : k % 20 == 9 ? 1e-6 : 0.2;
    rhythm.hear(time);
    if (k % 5 == 0) rhythm.hear(time);
    if (k % 7 == 0) rhythm.hear(time - 0.1);
    if (k > 0) {
      EXPECT_NEAR(rhythm.interval(), 0.2, 1e-6) << k;
    }
  }
}

TEST(Rhythm, ANewRateIsKnownAfterSixIntervals) {
  for (const double interval : {0.01, 0.05, 1.0, 10.0}) {
    Rhythm rhythm;
    double time = 0.0;
    for (int k = 0; k < 50; ++k) rhythm.hear(time += 0.2);
    for (int k = 0; k < 6; ++k) rhythm.hear(time += interval);
    EXPECT_NEAR(rhythm.interval(), interval, 1e-9);
  }
}

TEST(Rhythm, OfJitterIsItsMean) {
  std::mt19937 random(5);
  std::normal_distribution<double> jitter(0.0, 0.02);
  Rhythm rhythm;
  double sum = 0.0, deviations = 0.0;
  for (int k = 0; k < 2000; ++k) {
    rhythm.hear(0.2 * k + jitter(random));
    if (k < 100) continue;
    sum += rhythm.interval();
    deviations += rhythm.deviation();
  }
  EXPECT_NEAR(sum / 1900.0, 0.2, 0.002);
  // The difference of two, of which the mean absolute value is sqrt(2 / pi) of its deviation.
  EXPECT_NEAR(deviations / 1900.0, 0.02 * std::sqrt(4.0 / std::acos(-1.0)), 0.004);
}

}  // namespace rhythm_test
}  // namespace rhec
