#include "rhec/core/estimation/reading_summary.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <limits>
#include <numeric>
#include <random>
#include <vector>

namespace rhec {
namespace reading_summary_test {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

/// The measurements of one output, one row each.
struct Readings {
  std::vector<double> times, outputs, weights = {};
  double duration = 0.2;
  MeasuredInterval interval() const {
    return {.duration = duration,
            .between = static_cast<int>(times.size()),
            .times = times.data(),
            .outputs = outputs.data(),
            .weights = weights.empty() ? nullptr : weights.data()};
  }
};

Readings random_readings(int count, int width, std::mt19937_64& random) {
  std::uniform_real_distribution<double> uniform(0.001, 0.199);
  std::normal_distribution<double> normal;
  Readings readings;
  for (int k = 0; k < count; ++k) readings.times.push_back(uniform(random));
  std::ranges::sort(readings.times);
  for (int k = 0; k < count * width; ++k) readings.outputs.push_back(normal(random));
  return readings;
}

/// What readings say of the coefficients of a polynomial of degree 3: information matrix and vector, weights included.
Eigen::MatrixXd information(const MeasuredInterval& interval, int width, int output, const double* weights) {
  Eigen::MatrixXd sum = Eigen::MatrixXd::Zero(4, 5);
  for (int k = 0; k < interval.between; ++k) {
    const double y = interval.outputs[k * width + output], t = interval.times[k] / interval.duration;
    if (std::isnan(y)) continue;
    const Eigen::Vector4d powers(1.0, t, t * t, t * t * t);
    const double weight = weights ? weights[k * width + output] : 1.0;
    sum.leftCols(4) += weight * powers * powers.transpose();
    sum.col(4) += weight * y * powers;
  }
  return sum;
}

TEST(ReadingSummary, SaysOfAPolynomialWhatAllReadingsSay) {
  std::mt19937_64 random(3);
  for (const int count : {5, 6, 20, 200, -20}) {
    Readings readings = random_readings(std::abs(count), 1, random);
    double total = std::abs(count);
    if (count < 0) {  // as accurate as each says
      std::uniform_real_distribution<double> uniform(0.1, 4.0);
      for (std::size_t k = 0; k < readings.times.size(); ++k) readings.weights.push_back(uniform(random));
      total = std::accumulate(readings.weights.begin(), readings.weights.end(), 0.0);
    }
    ReadingSummary summary({0}, 1, 200, 1);
    const MeasuredInterval few = summary(readings.interval());
    ASSERT_EQ(few.between, ReadingSummary::nodes) << count;
    EXPECT_EQ(few.duration, 0.2);
    double weights = 0.0;
    for (int k = 0; k < few.between; ++k) {
      weights += summary.weights()[k];
      EXPECT_GT(few.times[k], k == 0 ? readings.times.front() : few.times[k - 1]);
      EXPECT_LT(few.times[k], readings.times.back());
    }
    EXPECT_NEAR(weights, total, 1e-9 * total);
    const Eigen::MatrixXd all = information(readings.interval(), 1, 0, readings.interval().weights),
                          left = information(few, 1, 0, summary.weights());
    EXPECT_LT((all - left).cwiseAbs().maxCoeff(), 1e-9 * total) << count;
  }
}

TEST(ReadingSummary, LeavesFewReadingsAndOtherOutputsAsTheyAre) {
  std::mt19937_64 random(5);
  Readings readings = random_readings(9, 2, random);
  for (int k = 0; k < 9; ++k)
    if (k % 3 == 0) readings.outputs[2 * k] = nan;  // six of the first output are left
  for (const bool is_chosen : {false, true}) {
    ReadingSummary summary(is_chosen ? std::vector{0} : std::vector<int>{}, 2, 9, 1);
    const MeasuredInterval few = summary(readings.interval());
    EXPECT_EQ(few.between, is_chosen ? 13 : 9);
    int others = 0;
    for (int k = 0; k < few.between; ++k) {
      if (k > 0) {
        EXPECT_GT(few.times[k], few.times[k - 1]);
      }
      if (std::isnan(few.outputs[2 * k + 1])) continue;
      EXPECT_EQ(few.times[k], readings.times[others]);
      EXPECT_EQ(few.outputs[2 * k + 1], readings.outputs[2 * others + 1]);
      EXPECT_EQ(summary.weights()[2 * k + 1], 1.0);
      ++others;
    }
    EXPECT_EQ(others, 9);
  }
}

/// Six readings at three times hold no polynomial of degree 3.
TEST(ReadingSummary, LeavesReadingsOfTooFewTimesAsTheyAre) {
  Readings readings{.times = {0.05, 0.05, 0.1, 0.1, 0.15, 0.15}, .outputs = {1.0, 1.1, 2.0, 2.1, 3.0, 3.1}};
  ReadingSummary summary({0}, 1, 6, 1);
  for (int round = 0; round < 2; ++round) {
    const MeasuredInterval same = summary(readings.interval());
    ASSERT_EQ(same.between, 6);
    for (int k = 0; k < 6; ++k) {
      EXPECT_EQ(same.times[k], readings.times[k]) << k;
      EXPECT_EQ(same.outputs[k], readings.outputs[k]) << k;
      EXPECT_EQ(summary.weights()[k], 1.0) << k;
    }
    readings.times.assign(6, 0.1);
  }
}

TEST(ReadingSummary, CutsTheIntervalIntoPieces) {
  std::mt19937_64 random(7);
  const Readings readings = random_readings(60, 1, random);
  ReadingSummary summary({0}, 1, 60, 3);
  const MeasuredInterval few = summary(readings.interval());
  ASSERT_EQ(few.between, 12);
  for (int k = 0; k < 12; ++k) {
    const double start = 0.2 / 3.0 * (k / 4);
    EXPECT_GT(few.times[k], start) << k;
    EXPECT_LT(few.times[k], start + 0.2 / 3.0) << k;
  }
}

TEST(ReadingSummary, KeepsOutputsOfOneTimeTogether) {
  std::mt19937_64 random(9);
  const Readings readings = random_readings(20, 2, random);
  ReadingSummary summary({0, 1}, 2, 20, 1);
  const MeasuredInterval few = summary(readings.interval());
  EXPECT_EQ(few.between, ReadingSummary::nodes);
  for (int k = 0; k < few.between; ++k) EXPECT_FALSE(std::isnan(few.outputs[2 * k] + few.outputs[2 * k + 1]));
}

}  // namespace reading_summary_test
}  // namespace rhec
