// What an estimator says of itself while something is missing.
#include "rhec/core/estimation/sensor_watch.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>

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
