#include "rhec/sim/tuning/log_tuning.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "rhec/sim/files/json.hpp"
#include "sim/support/weaving_drive.hpp"
#include "support/error_of.hpp"

namespace rhec::sim {
namespace log_tuning_test {

using testing::HasSubstr;

LogTuningOptions short_options() {
  LogTuningOptions options;
  options.threads = 2;
  options.smooths = false;
  // What this drive tells of most is enough here.
  options.wishes.keep = {"noise.inputs",   "noise.outputs.delta", "estimator",
                         "log.speed_bias", "log.steering_delay",  "log.wheel_offset"};
  return options;
}

const TunedNumber& named(const LogTuning& tuning, const std::string& name) {
  for (const TunedNumber& number : tuning.numbers)
    if (number.tunable.name == name) return number;
  throw Error("no " + name);
}

TEST(LogTuning, RecoversWhatTheLogHides) {
  const WeavingDrive drive;
  const Host host;
  const LogTables tables = drive.tables();
  const LogTuning tuning = tune_on_log(host, weaving_settings(), tables, short_options());
  const auto expect = [&](const std::string& name, double truth, double largest_error) {
    const TunedNumber& number = named(tuning, name);
    EXPECT_NEAR(number.value, truth, 3.0 * number.error) << name;
    EXPECT_LT(number.error, largest_error) << name;
    EXPECT_GT(number.error, 0.0) << name;
    EXPECT_TRUE(number.is_told) << name;
  };
  expect("noise.outputs.x_gps, y_gps", drive.noise, 0.01);
  expect("model.gps_offset", drive.offset, 0.1);
  expect("log.fix_delay", drive.delay, 0.05);
  expect("log.steering_bias", drive.bias, 0.003);
  EXPECT_GT(tuning.log_likelihood_after, tuning.log_likelihood_before + 100.0);
  ASSERT_FALSE(tuning.judged.empty());
  EXPECT_LT(tuning.judged[0].after, 0.7 * tuning.judged[0].before);
  EXPECT_LT(tuning.judged[0].change_interval.second, 0.0);
  EXPECT_FALSE(tuning.stopped);

  // What is written is a scenario, with the same fixes withheld as good as is said.
  const Settings read = parse_yaml(tuned_yaml(tuning, "here"), "tuned.yaml");
  const LogScenario scenario(host, read);
  const RecordedLog log = recorded_log(tables, scenario);
  const Replay replayed = replay(scenario.variants().front().robot, log, scenario.log(), {5, 4});
  EXPECT_NEAR(summarise(replayed, log).all.median, tuning.judged[0].after, 1e-9);
  EXPECT_EQ(Json::parse(summary_json(tuning)).at("numbers").at("model.gps_offset").at("after").as_number(),
            named(tuning, "model.gps_offset").value);
  EXPECT_THAT(tuning_svg(tuning), HasSubstr("model.gps_offset"));
}

TEST(LogTuning, KeepsTheBestWhenItIsStopped) {
  const Host host;
  const LogTables tables = WeavingDrive{.seconds = 40.0}.tables();
  int evaluations = 0;
  const LogTuning tuning = tune_on_log(host, weaving_settings(), tables, short_options(),
                                       {.progress = [&](const TuningProgress& now) { evaluations = now.evaluations; },
                                        .stop = [&] { return evaluations > 20; }});
  EXPECT_TRUE(tuning.stopped);
  EXPECT_LT(tuning.evaluations, 60);
  EXPECT_GE(tuning.log_likelihood_after, tuning.log_likelihood_before);
  EXPECT_THAT(tuned_yaml(tuning, "here"), HasSubstr("Stopped before"));
  EXPECT_NO_THROW(LogScenario(host, parse_yaml(tuned_yaml(tuning, "here"), "tuned.yaml")));
}

TEST(LogTuning, SaysWhatALogDoesNotTell) {
  // Straight ahead at one speed, a lever arm ahead and a late fix are the same.
  const Host host;
  std::string rows, fixes;
  RandomStream random(4, "straight");
  for (int i = 0; i < 1200; ++i) {
    rows += fmt::format("{:.2f},2.0,0.0\n", 0.05 * i);
    if (i % 4 == 0)
      fixes +=
          fmt::format("{:.2f},{:.4f},{:.4f}\n", 0.05 * i, 0.1 * i + 0.05 * random.normal(), 0.05 * random.normal());
  }
  LogTuningOptions options = short_options();
  options.wishes.keep.emplace_back("noise");
  options.wishes.keep.emplace_back("log.steering_bias");
  options.wishes.keep.erase(options.wishes.keep.begin(), options.wishes.keep.begin() + 2);
  const LogTuning tuning =
      tune_on_log(host, weaving_settings(),
                  {parse_csv(rows, "drs.txt", {.columns = 3}), parse_csv(fixes, "gps.txt", {.columns = 3})}, options);
  EXPECT_FALSE(named(tuning, "model.gps_offset").is_told);
  EXPECT_EQ(named(tuning, "model.gps_offset").value, 0.0);
  EXPECT_THAT(tuning.remarks, testing::Contains(HasSubstr("tells little of")));
}

TEST(LogTuning, RefusesALogThatIsTooShort) {
  const Host host;
  const LogTables tables = WeavingDrive{.seconds = 8.0}.tables();
  EXPECT_THAT(error_of([&] { tune_on_log(host, weaving_settings(), tables, short_options()); }),
              HasSubstr("gps.txt: "));
  EXPECT_THAT(error_of([&] { tune_on_log(host, weaving_settings(), tables, short_options()); }),
              HasSubstr("expected at least 30"));
}

}  // namespace log_tuning_test
}  // namespace rhec::sim
