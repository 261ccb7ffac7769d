#include "rhec/sim/horizons/horizon_log.hpp"

#include <gtest/gtest.h>

#include <sstream>
#include <string>
#include <vector>

#include "rhec/plugins/yaml/yaml.hpp"
#include "rhec/sim/loop/run_files.hpp"

namespace rhec::sim {
namespace horizon_log_test {

Scenario scenario_with(const std::vector<std::string>& assignments) {
  Settings settings = load_yaml(SCENARIOS "/figure8.yaml");
  apply_assignment(settings, "path.laps=1");
  apply_assignment(settings, "speed=10");
  for (const std::string& assignment : assignments) apply_assignment(settings, assignment);
  return {Host(), settings};
}

class HorizonLogOf : public testing::TestWithParam<const char*> {};

TEST_P(HorizonLogOf, LooksOnOnly) {
  const Scenario scenario = scenario_with({GetParam()});
  HorizonLog horizons(scenario.robot(), 1);
  const RunLog log = run_closed_loop(scenario, {.sampled = [&](const LoopSample& sample) { horizons.take(sample); }});
  EXPECT_EQ(steps_csv(log, scenario), steps_csv(run_closed_loop(scenario), scenario));
  EXPECT_EQ(horizons.kept(), std::ssize(log.samples));
}
INSTANTIATE_TEST_SUITE_P(Estimators, HorizonLogOf,
                         testing::Values("estimator.name=rhe", "estimator.name=ekf", "estimator.name=truth",
                                         "estimator.solver={name: gn_rti, mode: converge}",
                                         "blocking.kappa={name: structured, size: 5, overlap: 2, transition: ramp}"));

TEST(HorizonLog, KeepsFewOfManySamples) {
  const Scenario scenario = scenario_with({});
  HorizonLog horizons(scenario.robot(), 10000, 100);
  EXPECT_EQ(horizons.every(), 100);
  const RunLog log = run_closed_loop(scenario, {.sampled = [&](const LoopSample& sample) { horizons.take(sample); }});
  EXPECT_EQ(horizons.kept(), (std::ssize(log.samples) + 99) / 100);
  // What was measured is kept of every node nevertheless.
  const Json nodes = Json::parse(horizons.nodes_line(0));
  EXPECT_EQ(nodes.at("node_time").size(), log.samples.size());
  EXPECT_EQ(nodes.at("output").at(0).size(), log.samples.size());
  EXPECT_EQ(nodes.at("input").at(0).size(), log.samples.size() - 1);
}

/// The windows of a run, record by record.
std::vector<Json> windows_of(const std::vector<std::string>& assignments) {
  const Scenario scenario = scenario_with(assignments);
  HorizonLog horizons(scenario.robot(), 1);
  run_closed_loop(scenario, {.sampled = [&](const LoopSample& sample) { horizons.take(sample); }});
  std::vector<Json> windows;
  std::istringstream lines(horizons.records());
  for (std::string line; std::getline(lines, line);) windows.push_back(Json::parse(line).at("rhe"));
  return windows;
}

TEST(HorizonLog, ShowsNoSuppressedStartsWhereThereIsNoOverlap) {
  for (const char* blocking : {"blocking.kappa={name: structured, size: 4}", "blocking.kappa={name: unblocked}",
                               "blocking.kappa={name: pattern, lengths: [8, 4, 3]}"}) {
    for (const Json& window : windows_of({blocking})) {
      if (window.at("intervals") == 0) continue;
      EXPECT_TRUE(window.at("blocks").at(0).at("suppressed").empty()) << blocking;
    }
  }
}

TEST(HorizonLog, ShowsWhereTheWindowsEdgeCutsABlock) {
  const std::vector<Json> windows = windows_of({"blocking.kappa={name: structured, size: 4}"});
  const Json& block = windows.at(22).at("blocks").at(0);  // intervals 7 .. 21
  EXPECT_EQ(block.at("starts"), Json({7, 8, 12, 16, 20}));
  EXPECT_EQ(block.at("first_start"), 4);
  EXPECT_EQ(block.at("next_start"), 24);
}

}  // namespace horizon_log_test
}  // namespace rhec::sim
