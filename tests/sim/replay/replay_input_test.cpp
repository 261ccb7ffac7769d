#include "rhec/sim/replay/replay_input.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "sim/support/driven_log.hpp"

namespace rhec::sim {
namespace replay_input_test {

class ReplayInputTest : public DrivenLogTest {
 protected:
  void SetUp() override {
    DrivenLogTest::SetUp();
    drive(settings_, "drive.csv");
  }
  ReplayInput input(const HoldOut& hold_out) const {
    return {ReplayScenario(Host(), settings_), hold_out, *logs::open_log(file("drive.csv"))};
  }
  /// Keeps the shares that a call shows.
  static LoopHooks keeping(std::vector<double>& shares) {
    return {.progress = [&shares](double share) { shares.push_back(share); }};
  }
  const Settings settings_ = settings_of("skid_steer");
};

TEST_F(ReplayInputTest, AVariantIsEstimatedWithAllAndJudgedByWhatIsWithheld) {
  const ReplayInput given = input({5, 4});
  std::vector<double> shares;
  const DriveResult result = estimate_variant(given, 0, keeping(shares));
  EXPECT_EQ(result.all.name, "skid_steer");
  EXPECT_TRUE(result.all.predictions.empty());
  EXPECT_GT(result.withheld.predictions.size(), 10u);
  const DriveReplay alone =
      replay_drive(given.scenario.variants()[0].robot, given.drives[0], {}, given.scenario.simulated_start());
  ASSERT_EQ(result.all.estimates.size(), alone.estimates.size());
  EXPECT_EQ(result.all.estimates.back().values, alone.estimates.back().values);
  EXPECT_NE(result.all.estimates.back().values, result.withheld.estimates.back().values);
  // Both replays are one progress.
  EXPECT_TRUE(std::ranges::is_sorted(shares));
  EXPECT_LT(shares.front(), 0.1);
  EXPECT_NEAR(shares.back(), 1.0, 1e-9);
}

TEST_F(ReplayInputTest, WithoutWithheldMeasurementsThereIsOneReplay) {
  std::vector<double> shares;
  const DriveResult result = estimate_variant(input({}), 0, keeping(shares));
  EXPECT_EQ(result.withheld.withheld_sensor, -1);
  EXPECT_TRUE(result.withheld.estimates.empty());
  EXPECT_NEAR(shares.back(), 1.0, 1e-9);
}

TEST_F(ReplayInputTest, HindsightInterpolatesWhatIsWithheld) {
  const ReplayInput given = input({5, 4});
  const SmoothedVariant smoothed = smooth_variant(given, 0);
  const DriveResult causal = estimate_variant(given, 0, {});
  const Robot& robot = given.scenario.variants()[0].robot;
  EXPECT_EQ(smoothed.all.report.status, Status::solved);
  EXPECT_LT(summarise_predictions(smoothed.withheld, robot).rms, summarise_predictions(causal.withheld, robot).rms);
}

TEST_F(ReplayInputTest, FilesAreThoseOfAllResults) {
  const ReplayInput given = input({5, 4});
  const std::vector<DriveResult> results{estimate_variant(given, 0, {})};
  OutputFolder folder(file("out"));
  const std::string summary = write_drive_files(folder, given, results);
  folder.commit();
  for (const char* name :
       {"estimates.csv", "innovations.csv", "predictions.csv", "times.csv", "summary.json", "run.svg"})
    EXPECT_TRUE(std::filesystem::exists(file("out") / name)) << name;
  EXPECT_THAT(summary, testing::HasSubstr("drive.csv"));
}

}  // namespace replay_input_test
}  // namespace rhec::sim
