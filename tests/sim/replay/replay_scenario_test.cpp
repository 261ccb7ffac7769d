#include "rhec/sim/replay/replay_scenario.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "sim/support/driven_log.hpp"
#include "support/error_of.hpp"

namespace rhec::sim {
namespace replay_scenario_test {

TEST(ReplayScenario, TakesScenariosOfSimulationsAndTheirVariants) {
  Settings settings = load_yaml(std::string(SCENARIOS) + "/skid_steer.yaml");
  EXPECT_TRUE(ReplayScenario(Host(), settings).simulated_start());
  apply_assignment(settings, "variants={a: {estimator: {name: ekf}}, b: {signals: {outputs: {heading: none}}}}");
  const ReplayScenario scenario(Host(), settings);
  ASSERT_EQ(scenario.variants().size(), 2u);
  EXPECT_EQ(scenario.variants()[0].robot.estimator_options().name, "ekf");
  EXPECT_EQ(scenario.variants()[1].signals.outputs(), 3);
  EXPECT_EQ(ReplayScenario(Host(), settings, {"b"}).variants().size(), 1u);
}

TEST(ReplayScenario, MistakesInSignalsNameTheirLine) {
  const Settings settings = parse_yaml("model: {name: skid_steer}\nsignals:\n  outputs: {headng: /imu:x}\n", "r.yaml");
  EXPECT_THAT(error_of([&] { ReplayScenario(Host(), settings); }),
              testing::AllOf(testing::HasSubstr("r.yaml:3"), testing::HasSubstr("heading")));
}

}  // namespace replay_scenario_test
}  // namespace rhec::sim
