#include "rhec/sim/replay/drive_replay.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "sim/support/driven_log.hpp"
#include "support/error_of.hpp"

namespace rhec::sim {
namespace drive_replay_test {

using DriveReplayTest = DrivenLogTest;

/// Every shipped vehicle, with its own sensors, and sensors with rates and latencies of their own.
class EveryVehicle : public DrivenLogTest, public testing::WithParamInterface<const char*> {};

TEST_P(EveryVehicle, AReplayOfItsLogIsTheRun) {
  const Settings settings = settings_of(GetParam());
  for (const char* file : {"drive.csv", "drive.mcap"}) {
    const RunLog run = drive(settings, file);
    const ReplayScenario scenario(Host(), settings);
    const ReplayVariant& variant = scenario.variants().front();
    const DriveReplay replay = replay_drive(variant.robot, read(variant, file), {}, scenario.simulated_start());
    ASSERT_EQ(replay.estimates.size(), run.samples.size());
    for (std::size_t i = 0; i < run.samples.size(); ++i) {
      const DriveEstimate& estimate = replay.estimates[i];
      const Sample& sample = run.samples[i];
      EXPECT_NEAR(estimate.time, sample.time, 1e-9);
      EXPECT_NEAR((estimate.values.head(sample.state.size()) - sample.state).cwiseAbs().maxCoeff(), 0.0, 1e-9) << i;
      EXPECT_NEAR((estimate.values.tail(sample.parameters.size()) - sample.parameters).cwiseAbs().maxCoeff(), 0.0, 1e-9)
          << i;
      EXPECT_NEAR((estimate.sigmas - sample.sigma).cwiseAbs().maxCoeff(), 0.0, 1e-9) << i;
      EXPECT_EQ(estimate.health, sample.health) << i;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(All, EveryVehicle,
                         testing::Values("figure8", "unicycle_traction", "tractor_trailer", "bicycle_sideslip",
                                         "skid_steer", "gyro", "faults/latency"),
                         [](const auto& vehicle) {
                           std::string name = vehicle.param;
                           std::replace(name.begin(), name.end(), '/', '_');
                           return name;
                         });

TEST_F(DriveReplayTest, WhatIsWithheldLeavesNoTraceAndIsPredicted) {
  const Settings settings = settings_of("skid_steer");
  drive(settings, "drive.csv");
  const ReplayScenario scenario(Host(), settings);
  const ReplayVariant& variant = scenario.variants().front();
  const HoldOut hold_out{5, 4};
  const logs::Drive known = read(variant, "drive.csv");
  logs::Drive bent = known;
  std::size_t fixes = 0;
  for (const logs::DriveEvent& event : bent.events)
    if (event.is_output && hold_out.holds(fixes++)) bent.values[event.values] += 100.0;
  const DriveReplay one = replay_drive(variant.robot, known, hold_out, scenario.simulated_start());
  const DriveReplay other = replay_drive(variant.robot, bent, hold_out, scenario.simulated_start());
  EXPECT_EQ(one.sensors[static_cast<std::size_t>(one.withheld_sensor)].name, "x_gps and y_gps");
  ASSERT_EQ(one.predictions.size(), fixes / 5);
  for (std::size_t i = 0; i < one.estimates.size(); ++i) ASSERT_EQ(one.estimates[i].values, other.estimates[i].values);
  for (std::size_t i = 0; i < one.predictions.size(); ++i) {
    EXPECT_LT(one.predictions[i].distance, 0.15);
    EXPECT_NEAR(other.predictions[i].residuals[0] - one.predictions[i].residuals[0], 100.0, 1e-9);
  }
}

TEST_F(DriveReplayTest, InnovationsAreThoseOfTheStatedNoise) {
  const Settings settings = settings_of("bicycle_sideslip");
  drive(settings, "drive.csv");
  const ReplayScenario scenario(Host(), settings);
  const ReplayVariant& variant = scenario.variants().front();
  const DriveReplay replay = replay_drive(variant.robot, read(variant, "drive.csv"), {}, scenario.simulated_start());
  ASSERT_GT(replay.innovations.size(), 100u);
  double nis = 0.0, values = 0.0;
  for (const DriveInnovation& innovation : replay.innovations) {
    nis += innovation.nis;
    values += static_cast<double>(innovation.values.size());
  }
  EXPECT_GT(nis / values, 0.7);
  EXPECT_LT(nis / values, 1.3);
}

TEST_F(DriveReplayTest, ADriveBeginsWhereItsFirstMeasurementsSay) {
  const ReplayScenario scenario(Host(), settings_of("skid_steer"));
  const ReplayVariant& variant = scenario.variants().front();
  logs::Drive elsewhere;
  elsewhere.outputs = 3;
  elsewhere.inputs = 2;
  elsewhere.values = {1000.0 - 0.1, 500.0 + 0.2, M_PI / 2.0};
  elsewhere.events = {{0.0, 0.0, true, 0}};
  const Eigen::VectorXd start = start_of(variant.robot, elsewhere, scenario.simulated_start());
  // The antenna is 0.2 m before and 0.1 m to the left of the centre; the vehicle heads along y.
  EXPECT_NEAR(start[0], 1000.0, 1e-9);
  EXPECT_NEAR(start[1], 500.0, 1e-9);
  EXPECT_NEAR(start[2], M_PI / 2.0, 1e-12);
}

/// As where a robot's clock is set by an hour: estimates of a minute, and then from the next measurement on.
TEST_F(DriveReplayTest, NothingIsEstimatedInALongSilence) {
  const ReplayScenario scenario(Host(), settings_of("skid_steer"));
  logs::Drive gap;
  gap.outputs = 3;
  gap.inputs = 2;
  const std::vector<double> times{0.0, 1.0, 2.0, 3000.0, 3001.0, 3040.0};
  for (const double time : times) {
    gap.events.push_back({time, time, true, gap.values.size()});
    gap.values.insert(gap.values.end(), {0.0, 0.0, 0.0});
  }
  const Robot& robot = scenario.variants().front().robot;
  const DriveReplay replay = replay_drive(robot, gap);
  double longest = 0.0, before = 0.0;
  std::size_t within_last = 0;
  for (const DriveEstimate& estimate : replay.estimates) {
    longest = std::max(longest, estimate.time - before);
    if (estimate.time > 3001.5) ++within_last;
    before = estimate.time;
  }
  EXPECT_NEAR(longest, 3000.0 - 62.0, 2.0 * robot.step());
  EXPECT_NEAR(static_cast<double>(within_last), 38.5 / robot.step(), 2.0) << "a shorter silence is estimated through";
  EXPECT_NEAR(before, 3040.0, robot.step());
}

TEST_F(DriveReplayTest, RefusesADriveThatLeaps) {
  const ReplayScenario scenario(Host(), settings_of("skid_steer"));
  logs::Drive leap;
  leap.outputs = 3;
  leap.inputs = 2;
  leap.values = {0.0, 0.0, 0.0};
  leap.events = {{0.0, 0.0, true, 0}, {1e6, 1e6, true, 0}};
  EXPECT_THAT(error_of([&] { replay_drive(scenario.variants().front().robot, leap); }),
              testing::HasSubstr("leaps from 0 s"));
  leap.events.clear();
  EXPECT_THAT(error_of([&] { replay_drive(scenario.variants().front().robot, leap); }),
              testing::HasSubstr("no measurement"));
}

}  // namespace drive_replay_test
}  // namespace rhec::sim
