#include "rhec/sim/tuning/drive_tuning.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "rhec/sim/files/json.hpp"
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
  const LogTuning tuning = tune_on_drive(
      Host(), settings_, drive_,
      {.wishes = {.tune = {},
                  .keep = {"noise.inputs", "noise.outputs.heading", "estimator", "model.antenna_x", "signals"}},
       .threads = 2,
       .smooths = false});
  ASSERT_EQ(tuning.numbers.size(), 2u);
  EXPECT_EQ(tuning.numbers[0].tunable.name, "noise.outputs.x_gps, y_gps");
  EXPECT_NEAR(tuning.numbers[0].value, 0.02, 0.004);
  EXPECT_EQ(tuning.numbers[1].tunable.name, "model.antenna_y");
  EXPECT_NEAR(tuning.numbers[1].value, 0.1, 4.0 * tuning.numbers[1].error);
  EXPECT_LT(tuning.numbers[1].error, 0.1);
  EXPECT_GT(tuning.log_likelihood_after, tuning.log_likelihood_before + 50.0);
  EXPECT_LT(tuning.judged[0].after, tuning.judged[0].before);
  EXPECT_EQ(tuning.judged[0].name, "withheld measurements: median");
  EXPECT_NEAR(tuning.settings.find_path("noise.outputs.y_gps")->as_number(), tuning.numbers[0].value, 1e-5);
  EXPECT_EQ(tuning.sensors.size(), 2u);
  EXPECT_THAT(tuned_yaml(tuning, "here"), testing::HasSubstr("antenna_y"));
  EXPECT_GT(Json::parse(summary_json(tuning)).at("measurements").as_number(), 200.0);
  EXPECT_THAT(tuning_svg(tuning), testing::HasSubstr("Log likelihood of the measurements"));
}

TEST_F(DriveTuningTest, FindsWhatASensorIsOffByAndHowLateItIs) {
  apply_assignment(settings_, "signals.outputs.heading={offset: 0.1}");
  apply_assignment(settings_, "estimator.delays.x_gps=0.3");
  apply_assignment(settings_, "estimator.delays.y_gps=0.3");
  const ReplayScenario scenario(Host(), settings_);
  const logs::Drive off = read(scenario.variants().front(), "drive.csv");
  const LogTuning tuning = tune_on_drive(
      Host(), settings_, off,
      {.wishes = {.tune = {},
                  .keep = {"noise", "model", "signals.inputs", "estimator.process_noise", "estimator.delays.heading"}},
       .threads = 2,
       .smooths = false});
  ASSERT_EQ(tuning.numbers.size(), 2u);
  EXPECT_EQ(tuning.numbers[0].tunable.name, "estimator.delays.x_gps");
  EXPECT_LT(tuning.numbers[0].value, 0.05);
  EXPECT_EQ(tuning.numbers[1].tunable.name, "signals.outputs.heading.offset");
  EXPECT_NEAR(tuning.numbers[1].value, 0.0, 4.0 * tuning.numbers[1].error);
  EXPECT_LT(tuning.numbers[1].error, 0.02);
  // What is written is read, and takes the same from the log.
  const Settings written = parse_yaml(tuned_yaml(tuning, "here"), "tuned.yaml");
  const ReplayScenario again(Host(), written);
  const logs::Drive right = read(again.variants().front(), "drive.csv");
  const auto heading = [](const logs::Drive& drive) {
    for (const logs::DriveEvent& event : drive.events)
      if (event.is_output) return drive.values_of(event)[2];
    return std::nan("");
  };
  EXPECT_NEAR(heading(right) - heading(off), tuning.numbers[1].value - 0.1, 1e-9);
}

TEST_F(DriveTuningTest, TriesLawsWhereTheEstimatorHasPriors) {
  apply_assignment(settings_, "estimator.name=bank");
  const LogTuning tuning =
      tune_on_drive(Host(), settings_, drive_,
                    {.wishes = {.tune = {}, .keep = {"noise", "model", "signals", "estimator.delays"}},
                     .threads = 2,
                     .smooths = false});
  EXPECT_EQ(tuning.filter, "bank");
  EXPECT_EQ(tuning.laws.size(), 6u);
  std::vector<std::string> names;
  for (const TriedEstimator& tried : tuning.estimators) names.push_back(tried.name);
  EXPECT_THAT(names, testing::ElementsAre("bank, tuned", "bank, tuned but for its priors", "bank, as it was"));
  for (const TunedNumber& number : tuning.numbers)
    EXPECT_THAT(number.tunable.name, testing::StartsWith("estimator.priors."));
}

TEST_F(DriveTuningTest, RefusesShortLogsAndNothingToTune) {
  logs::Drive cut = drive_;
  cut.events.resize(20);
  EXPECT_THAT(error_of([&] { tune_on_drive(Host(), settings_, cut, {}); }), testing::HasSubstr("expected at least 30"));
  EXPECT_THAT(error_of([&] {
                tune_on_drive(Host(), settings_, drive_,
                              {.wishes = {.tune = {}, .keep = {"noise", "estimator", "model", "signals"}}});
              }),
              testing::HasSubstr("nothing is left to tune"));
  // The log is read once.
  apply_assignment(settings_, "signals.outputs.heading={delay: 0.1}");
  EXPECT_THAT(error_of([&] {
                tune_on_drive(Host(), settings_, drive_,
                              {.wishes = {.tune = {"signals.outputs.heading.delay"}, .keep = {}}});
              }),
              testing::HasSubstr("estimator.delays"));
}

}  // namespace drive_tuning_test
}  // namespace rhec::sim
