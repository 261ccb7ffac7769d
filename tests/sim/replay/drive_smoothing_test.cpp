#include "rhec/sim/replay/drive_smoothing.hpp"

#include <gtest/gtest.h>

#include <cmath>

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

}  // namespace drive_smoothing_test
}  // namespace rhec::sim
