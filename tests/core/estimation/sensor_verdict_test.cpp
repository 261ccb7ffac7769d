// What an estimator says of itself while something is missing.
#include "rhec/core/estimation/sensor_watch.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "support/sensor_faults.hpp"

namespace rhec {
namespace sensor_verdict_test {

using namespace rhec::testing;
using ::testing::HasSubstr;

struct SensorVerdicts : SensorFaults {};
INSTANTIATE_TEST_SUITE_P(All, SensorVerdicts, ::testing::Values("ekf", "bank", "rhe"), name_of_estimator);

/// A second without a position is no silence yet; but how little is known by its end is said.
TEST_P(SensorVerdicts, WhatIsMissingShowsBeforeItIsSilent) {
  expect_each({.spoil = [](Delivery& d) { d.outputs[0] = d.outputs[1] = nan; }, .length = 5},
              [](const Episode& episode) {
                EXPECT_EQ(episode.during[0].health, HealthLevel::ok);
                EXPECT_THAT(episode.during[4].words, HasSubstr("degraded: uncertain"));
                EXPECT_LE(episode.samples_to_ok(), 10);
              });
}

TEST_P(SensorVerdicts, WhileNothingComesTheCovarianceGrows) {
  expect_each({.spoil = [](Delivery& d) { d.has_outputs = d.has_inputs = false; }, .length = 20},
              [](const Episode& episode) {
                EXPECT_NE(episode.during.back().health, HealthLevel::ok);
                for (const Episode::Sample& sample : episode.during)
                  EXPECT_TRUE(sample.inside || sample.health == HealthLevel::lost);
                EXPECT_LE(episode.samples_to_recover(usual_error), 15);
              });
}

/// An encoder is back before the receiver is: the first position is still that of a vehicle that may head anywhere.
TEST_P(SensorVerdicts, WhatComesFirstBehindASilenceDoesNotHideWhatIsNotKnown) {
  int honest = 0, samples = 0, slowest = 0;
  expect_each_long({.spoil =
                        [](Delivery& d) {
                          d.has_inputs = d.has_outputs = d.since >= 19;
                          d.outputs[0] = d.outputs[1] = nan;
                        },
                    .length = 20},
                   [&](const Episode& episode) {
                     slowest = std::max(slowest, episode.samples_to_recover(usual_error));
                     for (const Episode::Sample& sample : episode.after) {
                       honest += sample.inside || sample.health == HealthLevel::lost;
                       ++samples;
                     }
                   });
  EXPECT_GT(honest, 0.95 * samples);
  EXPECT_LE(slowest, 8);
}

/// The first position behind a jump of slip waits for the next one; meanwhile it may be right.
TEST_P(SensorVerdicts, AnEstimateInDoubtCoversSlipThatHasJumped) {
  int doubted = 0;
  expect_each({.spoil = {}, .length = 20, .moved = 0.0, .slip = 0.35}, [&](const Episode& episode) {
    for (const Episode::Sample& sample : episode.during) {
      doubted += sample.error > 0.5 * usual_error;
      EXPECT_TRUE(sample.inside) << "off by " << sample.error << " m: " << sample.words;
    }
  });
  EXPECT_GE(doubted, 1);
}

/// A vehicle that drives straight ahead, what it measures, and three estimators that are told of it: one that judges,
/// the same without the positions that are doubted, and one that trusts everything.
struct Doubt {
  static constexpr double step = 0.2, speed = 8.0;
  Robot watched = watched_robot("ekf"), trusting_one = watched_robot("ekf", "  health: {watch: false}\n");
  Eigen::VectorXd truth = Eigen::VectorXd::Zero(4);
  std::unique_ptr<Estimator> judging = watched.make_estimator(truth), without = watched.make_estimator(truth),
                             trusting = trusting_one.make_estimator(truth);
  double time = 0.0;

  /// Measures, with a position that is off by `spike` along y [m] and is hidden from one of them.
  void measure(double spike, bool is_hidden) {
    std::vector<double> outputs(3);
    watched.model()->observe({.count = 1, .states = truth.data(), .outputs = outputs.data()});
    outputs[1] += spike;
    judging->push_measurement(time, outputs.data());
    trusting->push_measurement(time, outputs.data());
    if (is_hidden) outputs[0] = outputs[1] = nan;
    without->push_measurement(time, outputs.data());
    for (Estimator* each : {judging.get(), without.get(), trusting.get()}) each->estimate(time);
  }
  void drive(double kappa) {
    const std::vector<double> inputs{speed, 0.0};
    for (Estimator* each : {judging.get(), without.get(), trusting.get()}) each->push_input(time, inputs.data());
    truth[0] += kappa * speed * step;
    time += step;
  }
  void drive_until_slip_is_known() {
    constexpr int samples = 40;
    for (int k = 0; k < samples; ++k) {
      measure(0.0, false);
      drive(0.8);
    }
  }
};

TEST(SensorVerdict, AnEstimateInDoubtHasTheSecondMomentOfBothAnswers) {
  Doubt doubt;
  doubt.drive_until_slip_is_known();
  doubt.measure(0.0, false);
  constexpr double kappa = 0.5;
  doubt.drive(kappa);
  doubt.measure(0.0, true);
  const Eigen::VectorXd& truth = doubt.truth;
  const auto off = [&](const Estimate& estimate, Eigen::Index j) {
    const Eigen::Index nx = estimate.state.size();
    const double error = j < nx ? estimate.state[j] - truth[j] : estimate.parameters[j - nx] - kappa;
    return std::abs(error) / std::sqrt(estimate.covariance(j, j));
  };
  {
    const Estimate &given = doubt.judging->estimate(doubt.time), &alone = doubt.without->estimate(doubt.time);
    EXPECT_EQ(given.health.level, HealthLevel::ok) << "it agrees with what the sensors say";
    EXPECT_FALSE(given.predicted);
    EXPECT_EQ(given.time, alone.time);
    EXPECT_EQ(given.state, alone.state) << "a single position does not move the mean";
    EXPECT_EQ(given.parameters, alone.parameters);
    for (const Eigen::Index j : {0, 4}) {
      EXPECT_GT(off(alone, j), 4.0) << j;
      EXPECT_NEAR(off(given, j), 1.0, 0.2) << j << ": the square of the distance is in the covariance, once";
    }
    EXPECT_EQ(given.covariance.llt().info(), Eigen::Success);
    const Eigen::MatrixXd once = given.covariance;
    EXPECT_EQ(doubt.judging->estimate(doubt.time).covariance, once) << "asked again";
    const Estimate& ahead = doubt.judging->estimate(doubt.time + Doubt::step);
    EXPECT_TRUE(ahead.predicted);
    EXPECT_GT(ahead.covariance(0, 0), once(0, 0)) << "a prediction goes on from it";
  }
  doubt.drive(kappa);
  doubt.measure(0.0, false);
  const Estimate &given = doubt.judging->estimate(doubt.time), &trusted = doubt.trusting->estimate(doubt.time);
  EXPECT_EQ(given.health.level, HealthLevel::ok);
  for (const Eigen::Index j : {0, 4}) {
    EXPECT_LT(off(given, j), 2.0) << j;
    EXPECT_LT(off(given, j), off(trusted, j)) << j << ": of slip it knows that what it was says nothing";
    EXPECT_LT(given.covariance(j, j), 1.1 * trusted.covariance(j, j)) << j << ": nothing of the doubt remains";
  }
}

TEST(SensorVerdict, AnErrorThatNoSlipExplainsLeavesTheCovariance) {
  Doubt doubt;
  doubt.drive_until_slip_is_known();
  constexpr double spike = 20.0;  // [m]
  doubt.measure(spike, true);
  const Estimate &given = doubt.judging->estimate(doubt.time), &alone = doubt.without->estimate(doubt.time);
  EXPECT_EQ(given.health.level, HealthLevel::degraded);
  EXPECT_EQ(given.state, alone.state);
  EXPECT_EQ(given.covariance, alone.covariance);
}

TEST(SensorVerdict, APredictionStaysWithinBounds) {
  for (const char* health : {"", "  health: {watch: false}\n"}) {
    SCOPED_TRACE(health);
    const Robot vehicle = watched_robot("ekf", health);
    const auto estimator = vehicle.make_estimator(Eigen::VectorXd::Zero(4));
    const std::vector<double> outputs{0.0, 0.0, 0.0}, inputs{2.0, 0.3};
    estimator->push_measurement(0.0, outputs.data());
    estimator->estimate(0.0);
    estimator->push_input(0.0, inputs.data());
    const double upper = vehicle.model()->description().states[3].upper;
    EXPECT_NEAR(estimator->estimate(0.5).state[3], 0.15, 0.02);
    EXPECT_EQ(estimator->estimate(100.0).state[3], upper) << "a steering angle, at its stop";
  }
}

}  // namespace sensor_verdict_test
}  // namespace rhec
