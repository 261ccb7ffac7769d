#include "core/estimation/stuck_values.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

namespace rhec {
namespace stuck_values_test {

struct OneOutput : ::testing::Test {
  StuckValues values{{0.01}};  // a standard deviation of 0.1
  double expected = 0.0;
  std::mt19937 random{1};
  std::normal_distribution<double> noise{0.0, 0.1};
  /// The vehicle goes on by `step`, and a value is measured.
  void measure(double value, double step) {
    expected += step;
    values.take(0, value, expected);
    values.corrected(0, expected);
  }
};

TEST_F(OneOutput, TheSameValueWhileTheVehicleMovesIsStuck) {
  for (int k = 0; k < 30; ++k) measure(expected + noise(random), 0.2);
  EXPECT_FALSE(values.is_stuck(0));
  measure(6.0, 0.2);
  measure(6.0, 0.2);
  EXPECT_FALSE(values.is_stuck(0));
  measure(6.0, 0.2);
  EXPECT_TRUE(values.is_stuck(0));
  measure(7.1, 0.2);
  EXPECT_FALSE(values.is_stuck(0));
}

TEST_F(OneOutput, OneThatStandsMayRepeatItself) {
  for (int k = 0; k < 100; ++k) measure(5.0, 0.0);
  EXPECT_FALSE(values.is_stuck(0));
}

TEST_F(OneOutput, CoarseStepsAreNoReason) {
  for (int k = 0; k < 500; ++k) {
    measure(std::round((expected + noise(random)) / 0.2) * 0.2, 0.01);
    EXPECT_FALSE(values.is_stuck(0)) << k;
  }
}

TEST_F(OneOutput, WhatIsMissingIsNoRepetition) {
  measure(1.0, 0.2);
  for (int k = 0; k < 10; ++k) measure(std::nan(""), 0.2);
  EXPECT_FALSE(values.is_stuck(0));
}

TEST_F(OneOutput, TheVehicleMovesInSamplesOfOtherSensorsToo) {
  const double none = std::nan("");
  for (int k = 0; k < 30; ++k) {
    measure(expected + noise(random), 0.001);
    for (int i = 0; i < 9; ++i) measure(none, 0.02);
  }
  for (int k = 0; k < 3; ++k) {
    EXPECT_FALSE(values.is_stuck(0)) << k;
    for (int i = 0; i < 9; ++i) measure(none, 0.02);
    measure(6.0, 0.001);
  }
  EXPECT_TRUE(values.is_stuck(0));
}

// A steering angle that is an input, measured with coarse steps: the input is always a little ahead of the angle, and
// the estimate is drawn back to the angle in each sample.
TEST(OutputOfMotion, ThatIsAlwaysBehindIsNotStuck) {
  for (const bool is_of_motion : {true, false}) {
    StuckValues values({0.01}, is_of_motion ? std::vector<int>{0} : std::vector<int>{});
    for (int k = 0; k < 5; ++k) {
      const double expected = 1.0 + 0.01 * k;
      values.take(0, 0.9, expected);
      values.corrected(0, expected - 0.1);
    }
    // A state that returned so far in each sample would be drawn there by the value that is stuck.
    EXPECT_EQ(values.is_stuck(0), !is_of_motion);
  }
}

TEST(OutputOfMotion, ThatRepeatsItselfWhileInputsChangeIsStuck) {
  StuckValues values({0.01}, {0});
  for (int k = 0; k < 3; ++k) values.take(0, 0.9, 1.0 + 0.2 * k);
  EXPECT_FALSE(values.is_stuck(0));
  values.take(0, 0.9, 1.6);
  EXPECT_TRUE(values.is_stuck(0));
  values.reset();
  EXPECT_FALSE(values.is_stuck(0));
}

}  // namespace stuck_values_test
}  // namespace rhec
