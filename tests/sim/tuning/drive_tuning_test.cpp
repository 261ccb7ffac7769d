#include "rhec/sim/tuning/drive_tuning.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "sim/support/driven_log.hpp"
#include "support/error_of.hpp"

namespace rhec::sim {
namespace drive_tuning_test {

class DriveTuningTest : public DrivenLogTest {
 protected:
  void SetUp() override {
    settings_ = settings_of("skid_steer");
    apply_assignment(settings_, "estimator.name=ekf");
    DrivenLogTest::drive(settings_, "drive.csv");
    drive_ = read(ReplayScenario(Host(), settings_).variants().front(), "drive.csv");
  }
  Settings settings_;
  logs::Drive drive_;
};

TEST_F(DriveTuningTest, FindsNoiseAndLeverArmsThatAreStatedWrongly) {
  apply_assignment(settings_, "noise.outputs={x_gps: 0.08, y_gps: 0.08, heading: 0.01}");
  apply_assignment(settings_, "model.antenna_y=-0.2");
  const DriveTuning tuning = tune_on_drive(
      Host(), settings_, drive_,
      {.wishes = {.tune = {}, .keep = {"noise.inputs", "noise.outputs.heading", "estimator", "model.antenna_x"}}});
  ASSERT_EQ(tuning.numbers.size(), 2u);
  EXPECT_EQ(tuning.numbers[0].tunable.name, "noise.outputs.x_gps, y_gps");
  EXPECT_NEAR(tuning.numbers[0].value, 0.02, 0.004);
  EXPECT_EQ(tuning.numbers[1].tunable.name, "model.antenna_y");
  EXPECT_NEAR(tuning.numbers[1].value, 0.1, 4.0 * tuning.numbers[1].error);
  EXPECT_LT(tuning.numbers[1].error, 0.1);
  EXPECT_GT(tuning.log_likelihood_after, tuning.log_likelihood_before + 50.0);
  EXPECT_TRUE(tuning.is_taken);
  EXPECT_LT(tuning.after.rms, tuning.before.rms);
  EXPECT_NEAR(tuning.settings.find_path("noise.outputs.y_gps")->as_number(), tuning.numbers[0].value, 1e-5);
  EXPECT_THAT(tuned_yaml(tuning, "here"), testing::HasSubstr("antenna_y"));
  EXPECT_TRUE(Json::parse(summary_json(tuning))["taken"].as_flag());
}

TEST_F(DriveTuningTest, RefusesShortLogsAndNothingToTune) {
  logs::Drive cut = drive_;
  cut.events.resize(20);
  EXPECT_THAT(error_of([&] { tune_on_drive(Host(), settings_, cut, {}); }), testing::HasSubstr("expected at least 30"));
  EXPECT_THAT(
      error_of([&] {
        tune_on_drive(Host(), settings_, drive_, {.wishes = {.tune = {}, .keep = {"noise", "estimator", "model"}}});
      }),
      testing::HasSubstr("nothing to tune"));
}

}  // namespace drive_tuning_test
}  // namespace rhec::sim
