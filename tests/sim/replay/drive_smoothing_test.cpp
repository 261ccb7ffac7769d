#include "rhec/sim/replay/drive_smoothing.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>

#include <fmt/format.h>

#include "sim/support/driven_log.hpp"

namespace rhec::sim {
namespace drive_smoothing_test {

using DriveSmoothingTest = DrivenLogTest;

TEST_F(DriveSmoothingTest, HindsightIsNearerToTheTruthAndToWhatIsWithheld) {
  Settings settings = settings_of("skid_steer");
  apply_assignment(settings, "estimator.name=ekf");
  apply_assignment(settings, "smoother.solver={name: gn_rti, mode: converge}");
  const RunLog run = drive(settings, "drive.csv");
  const ReplayScenario scenario(Host(), settings);
  const ReplayVariant& variant = scenario.variants().front();
  const SmoothedDriveReplay result =
      smooth_drive("x", variant.robot, read(variant, "drive.csv"), {5, 4}, scenario.simulated_start());
  EXPECT_EQ(result.report.status, Status::solved);
  EXPECT_EQ(result.causal.name, "x causal");
  ASSERT_EQ(result.smoothed.estimates.size(), run.samples.size());
  double causal = 0.0, smoothed = 0.0, before = 0.0, after = 0.0;
  for (std::size_t i = 0; i < run.samples.size(); ++i) {
    causal += (result.causal.estimates[i].values.head(2) - run.samples[i].true_state.head(2)).norm();
    smoothed += (result.smoothed.estimates[i].values.head(2) - run.samples[i].true_state.head(2)).norm();
  }
  EXPECT_LT(smoothed, 0.8 * causal);
  for (std::size_t i = 0; i < result.causal.predictions.size(); ++i) {
    before += std::pow(result.causal.predictions[i].distance, 2);
    after += std::pow(result.smoothed.predictions[i].distance, 2);
  }
  EXPECT_LT(after, before);
  EXPECT_TRUE(result.smoothed.estimates.back().sigmas.allFinite());
}

TEST_F(DriveSmoothingTest, WhatIsStampedLateIsWhereItWasMeasured) {
  Settings settings = settings_of("skid_steer");
  apply_assignment(settings, "estimator.name=ekf");
  apply_assignment(settings, "smoother.solver={name: gn_rti, mode: converge}");
  drive(settings, "drive.csv");
  const ReplayScenario scenario(Host(), settings);
  const logs::Drive punctual = read(scenario.variants().front(), "drive.csv");
  // Its measurements have stamps that are late by 0.5 s, and are there by then.
  logs::Drive late = punctual;
  for (logs::DriveEvent& event : late.events)
    if (event.is_output) event.time = event.arrival += 0.5;
  std::stable_sort(late.events.begin(), late.events.end(),
                   [](const logs::DriveEvent& a, const logs::DriveEvent& b) { return a.arrival < b.arrival; });
  apply_assignment(settings, "estimator.delays={x_gps: 0.5, y_gps: 0.5, heading: 0.5}");
  const ReplayScenario delayed(Host(), settings);
  const auto smoothed = [](const ReplayScenario& of, const logs::Drive& drive) {
    return smooth_drive("x", of.variants().front().robot, drive, {5, 4}, of.simulated_start());
  };
  const SmoothedDriveReplay right = smoothed(scenario, punctual), found = smoothed(delayed, late);
  ASSERT_EQ(found.smoothed.predictions.size(), right.smoothed.predictions.size());
  EXPECT_NEAR(found.causal.start, right.causal.start, 1e-9);
  for (std::size_t i = 0; i < right.smoothed.predictions.size(); ++i) {
    EXPECT_NEAR(found.smoothed.predictions[i].time, right.smoothed.predictions[i].time, 1e-9);
    EXPECT_NEAR(found.smoothed.predictions[i].distance, right.smoothed.predictions[i].distance, 1e-3);
    // The causal ones are predicted from what was there: half a second less of what is measured.
    EXPECT_LT(found.causal.predictions[i].distance, 0.4);
  }
}

/// Of vehicles of whose inputs nothing is known, or nothing in the middle of the drive. On the narrow figure of eight
/// the steering goes from one stop to the other within a second.
TEST_F(DriveSmoothingTest, WithoutInputsHindsightIsNearerToTheTruthAsWell) {
  for (const char* name : {"figure8", "skid_steer", "tractor_trailer"}) {
    for (const double from : {0.0, 5.0}) {
      double causal = 0.0, smoothed = 0.0;
      int honest = 0, samples = 0;
      for (int seed = 1; seed <= 2; ++seed) {
        SCOPED_TRACE(fmt::format("{}, silent from {} s on, seed {}", name, from, seed));
        Settings settings = settings_of(name);
        apply_assignment(settings, "estimator.name=ekf");
        apply_assignment(settings, fmt::format("seed={}", seed));
        apply_assignment(settings, "smoother.solver={name: gn_rti, mode: converge}");
        const RunLog run = drive(settings, "drive.csv");
        const ReplayScenario scenario(Host(), settings);
        const ReplayVariant& variant = scenario.variants().front();
        logs::Drive silent = read(variant, "drive.csv");
        std::erase_if(silent.events, [&](const logs::DriveEvent& event) {
          return !event.is_output && event.time >= from && (from == 0.0 || event.time < 12.0);
        });
        const SmoothedDriveReplay result = smooth_drive("x", variant.robot, silent, {0, 0}, scenario.simulated_start());
        EXPECT_EQ(result.report.status, Status::solved);
        ASSERT_EQ(result.smoothed.estimates.size(), run.samples.size());
        for (std::size_t i = 0; i < run.samples.size(); ++i) {
          const auto off = [&](const DriveEstimate& of) -> Eigen::VectorXd {
            return of.values.head(2) - run.samples[i].true_state.head(2);
          };
          const DriveEstimate& hindsight = result.smoothed.estimates[i];
          EXPECT_LT(off(result.causal.estimates[i]).norm(), 0.5) << run.samples[i].time;
          causal += off(result.causal.estimates[i]).norm();
          smoothed += off(hindsight).norm();
          honest += (off(hindsight).array().abs() < 3.0 * hindsight.sigmas.head(2).array()).all();
          ++samples;
        }
      }
      EXPECT_LT(smoothed, 0.85 * causal) << name << ' ' << from;
      // Slip varies faster on the narrow figure of eight than the laws say.
      EXPECT_GT(honest, (std::string(name) == "figure8" ? 0.8 : 0.95) * samples) << name << ' ' << from;
    }
  }
}

}  // namespace drive_smoothing_test
}  // namespace rhec::sim
