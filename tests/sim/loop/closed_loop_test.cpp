// What a closed loop tells of its parts: each sample's in their order, and nothing of the run changes.
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "rhec/plugins/yaml/yaml.hpp"
#include "rhec/sim/loop/closed_loop.hpp"
#include "rhec/sim/loop/run_files.hpp"

namespace rhec::sim {
namespace closed_loop_test {

Scenario scenario_with(const std::vector<std::string>& assignments) {
  Settings settings = load_yaml(SCENARIOS "/figure8.yaml");
  for (const std::string& assignment : assignments) apply_assignment(settings, assignment);
  return {Host(), settings};
}

class LoopParts : public testing::TestWithParam<const char*> {};

TEST_P(LoopParts, BeginInTheirOrderSampleBySample) {
  const Scenario scenario = scenario_with({"path.laps=1", "speed=10", GetParam()});
  std::vector<LoopPart> told;
  LoopHooks hooks;
  hooks.begins = [&told](LoopPart part) { told.push_back(part); };
  const RunLog log = run_closed_loop(scenario, hooks);
  ASSERT_TRUE(log.completed) << log.ended;

  using enum LoopPart;
  std::vector<LoopPart> expected;
  for (std::size_t k = 0; k < log.samples.size(); ++k) {
    expected.insert(expected.end(), {simulate, estimate, control, log_sample});
    if (k + 1 == log.samples.size()) break;
    expected.insert(expected.end(), {simulate, prepare_control, prepare_estimate});
  }
  expected.push_back(end);
  EXPECT_EQ(told, expected);
  EXPECT_EQ(steps_csv(log, scenario), steps_csv(run_closed_loop(scenario), scenario));
}
INSTANTIATE_TEST_SUITE_P(Estimators, LoopParts, testing::Values("estimator.name=rhe", "estimator.name=truth"));

TEST(LoopTimes, FeedbackIsPartOfTheEstimatorsTime) {
  const Scenario scenario = scenario_with({"path.laps=1", "speed=10"});
  for (const Sample& sample : run_closed_loop(scenario).samples) {
    EXPECT_GT(sample.estimator_feedback_us, 0.0);
    EXPECT_GE(sample.estimator_us, sample.estimator_feedback_us);
  }
}

}  // namespace closed_loop_test
}  // namespace rhec::sim
