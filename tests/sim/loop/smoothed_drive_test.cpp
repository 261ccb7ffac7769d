// A simulated drive, estimated as a whole.
#include "rhec/sim/loop/smoothed_drive.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <string>
#include <vector>

#include "sim/support/figure8.hpp"

namespace rhec::sim {
namespace smoothed_drive_test {

using testing::IsEmpty;
using testing::Not;

Scenario short_drive(std::vector<std::string> more = {}) {
  std::vector<std::string> assignments{"path.laps=1", "path.radius=8", "speed=4", "smoother.laws=2",
                                       "estimator.name=ekf"};
  assignments.insert(assignments.end(), more.begin(), more.end());
  return figure8_with(assignments);
}

TEST(SmoothedDrive, IsBetterThanWhatDroveAndKnowsHowGoodItIs) {
  const Scenario scenario = short_drive();
  const SmoothedDrive drive = smooth_closed_loop(scenario);
  ASSERT_EQ(drive.report.status, Status::solved);
  ASSERT_TRUE(drive.has_sigmas);
  ASSERT_EQ(drive.smoothed.samples.size(), drive.causal.samples.size());
  EXPECT_EQ(drive.intervals + 1, std::ssize(drive.smoothed.samples));
  EXPECT_THAT(drive.laws, Not(IsEmpty()));
  const RunSummary smoothed = summarise(drive.smoothed, scenario), causal = summarise(drive.causal, scenario);
  EXPECT_LT(smoothed.mae.parameters.at("kappa"), 0.6 * causal.mae.parameters.at("kappa"));
  EXPECT_LT(smoothed.mae.position, 0.8 * causal.mae.position);
  EXPECT_GT(smoothed.within_two_sigma.at("kappa"), 0.85);
  EXPECT_EQ(smoothed.mae.tracking, causal.mae.tracking) << "the drive is the same";
  const Json summary = Json::parse(summary_json(drive, scenario));
  EXPECT_EQ(summary["smoother"]["status"], "solved");
  EXPECT_EQ(summary["mae"]["kappa"], smoothed.mae.parameters.at("kappa"));
  EXPECT_EQ(summary["causal"]["mae"]["kappa"], causal.mae.parameters.at("kappa"));
  EXPECT_EQ(summary["smoother"]["laws"].size(), drive.laws.size());
}

/// What is recorded does not change the drive, and a hook of the caller's still gets its turn.
TEST(SmoothedDrive, IsTheDriveOfTheClosedLoop) {
  const Scenario scenario = short_drive();
  int samples = 0;
  const SmoothedDrive drive = smooth_closed_loop(scenario, {.sampled = [&](const LoopSample&) { ++samples; }});
  const RunLog alone = run_closed_loop(scenario);
  ASSERT_EQ(drive.causal.samples.size(), alone.samples.size());
  EXPECT_EQ(static_cast<std::size_t>(samples), alone.samples.size());
  EXPECT_EQ(drive.causal.samples.back().state, alone.samples.back().state);
  EXPECT_EQ(drive.causal.samples.back().nees, alone.samples.back().nees);
}

TEST(SmoothedDrive, HasBlocksWhereTheyAreGiven) {
  const Scenario scenario = short_drive({"smoother.blocking.kappa={name: structured, size: 3, neighbour_sigma: 0.03}"});
  const SmoothedDrive drive = smooth_closed_loop(scenario);
  EXPECT_EQ(drive.report.status, Status::solved);
  EXPECT_THAT(drive.laws, IsEmpty());
}

TEST(SmoothedDrive, SaysWhereItWasNotSolved) {
  const SmoothedDrive drive =
      smooth_closed_loop(short_drive({"smoother.solver={name: sparse_sqp, max_iterations: 1}"}));
  EXPECT_EQ(drive.report.status, Status::iteration_limit);
  EXPECT_EQ(drive.smoothed.samples.back().estimator_status, Status::iteration_limit);
}

}  // namespace smoothed_drive_test
}  // namespace rhec::sim
