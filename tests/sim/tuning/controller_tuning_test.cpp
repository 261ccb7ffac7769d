#include "rhec/sim/tuning/controller_tuning.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "rhec/plugins/yaml/yaml.hpp"
#include "rhec/sim/loop/scenario.hpp"
#include "support/error_of.hpp"

namespace rhec::sim {
namespace controller_tuning_test {

using testing::HasSubstr;

Settings short_figure8() {
  Settings settings = load_yaml(SCENARIOS "/figure8.yaml");
  for (const char* assignment :
       {"speed=6", "path.laps=1", "path.radius=8", "estimator.name=ekf", "controller.weights.stage.u2=20"})
    apply_assignment(settings, assignment);
  return settings;
}

ControllerTuningOptions few() {
  ControllerTuningOptions options;
  options.seeds = 1;
  options.judges = 2;
  options.threads = 2;
  options.most_evaluations = 8;
  return options;
}

TEST(ControllerTuning, TracksBetterWithinTheEffortThatIsAllowed) {
  const Host host;
  const Settings settings = short_figure8();
  ControllerTuningOptions options = few();
  options.effort = 1.5;
  const ControllerTuning tuning = tune_controller(host, settings, {{"as it is", settings}}, options);
  ASSERT_GT(tuning.tried.size(), 5U);
  EXPECT_EQ(tuning.tried.front().tracking, 1.0);
  const TriedController& chosen = tuning.tried[static_cast<std::size_t>(tuning.chosen)];
  EXPECT_LT(chosen.tracking, 1.0);
  EXPECT_LE(chosen.effort, 1.5);
  for (const TriedController& tried : tuning.tried)
    EXPECT_TRUE(!tried.is_complete || tried.effort > 1.5 || tried.tracking >= chosen.tracking);
  for (const TriedController& one : tuning.tried)
    for (const TriedController& other : tuning.tried)
      EXPECT_FALSE(one.is_efficient && other.is_complete && other.tracking < one.tracking && other.effort < one.effort);
  ASSERT_EQ(tuning.judged.size(), 3U);
  EXPECT_EQ(tuning.judged[2].after, 0.0);
  // What is written drives.
  const Settings read = parse_yaml(tuned_yaml(tuning, "here"), "tuned.yaml");
  EXPECT_NO_THROW(Scenario(host, read));
  EXPECT_NE(*read.find_path("controller.weights.stage.u2")->number(), 20.0);
  const std::string table = pareto_csv(tuning);
  EXPECT_EQ(std::count(table.begin(), table.end(), '\n'), static_cast<std::ptrdiff_t>(tuning.tried.size()) + 1);
  EXPECT_THAT(pareto_svg(tuning), HasSubstr("</svg>"));
}

TEST(ControllerTuning, LeavesAScenarioAloneWhoseEffortCannotBeHad) {
  const Host host;
  const Settings settings = short_figure8();
  ControllerTuningOptions options = few();
  options.effort = 1e-6;
  options.most_evaluations = 5;
  const ControllerTuning tuning = tune_controller(host, settings, {{"as it is", settings}}, options);
  EXPECT_EQ(tuning.chosen, 0);
  EXPECT_EQ(*tuning.settings.find_path("controller.weights.stage.u2")->number(), 20.0);
}

TEST(ControllerTuning, KeepsTheBestWhenItIsStopped) {
  const Host host;
  const Settings settings = short_figure8();
  int runs = 0;
  const ControllerTuning tuning = tune_controller(
      host, settings, {{"as it is", settings}}, few(),
      {.progress = [&](const TuningProgress& now) { runs = now.evaluations; }, .stop = [&] { return runs > 3; }});
  EXPECT_TRUE(tuning.stopped);
  EXPECT_LE(tuning.tried.size(), 6U);
  EXPECT_TRUE(tuning.judged.empty());
}

TEST(ControllerTuning, RefusesAScenarioWithoutWeights) {
  const Host host;
  Settings settings = short_figure8();
  settings.set("controller.weights", Settings::null());
  EXPECT_THAT(error_of([&] {
                tune_controller(host, settings, {{"as it is", settings}}, few());
              }),
              HasSubstr("controller.weights"));
}

}  // namespace controller_tuning_test
}  // namespace rhec::sim
