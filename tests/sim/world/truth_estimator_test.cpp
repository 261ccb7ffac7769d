// The estimator that a simulation brings: what its vehicle is and does.
#include "rhec/sim/world/truth_estimator.hpp"

#include <gmock/gmock.h>

#include "rhec/core/base/error.hpp"
#include "rhec/plugins/robot/robot.hpp"
#include "rhec/plugins/yaml/yaml.hpp"
#include "rhec/sim/logs/recorded_log.hpp"
#include "support/error_of.hpp"

namespace rhec::sim {
namespace truth_estimator_test {

using testing::HasSubstr;
using testing::StartsWith;

constexpr const char* configuration = "step: 0.2\nestimator: {name: truth}";

Robot robot() {
  const Settings settings = parse_yaml(configuration, "run.yaml");
  return {Host(), RobotOptions::table().parse(settings, "robot"), scenario_estimators()};
}

TEST(TruthEstimator, KnowsTheVehicleWhateverIsMeasured) {
  Robot knowing = robot();
  const auto field = constant_field({0.75, 0.5});
  TruthVehicle vehicle(*knowing.model(), *field, Eigen::Vector4d(1.0, 2.0, 0.5, 0.0));
  knowing.use_estimators(scenario_estimators(&vehicle));
  const auto estimator = knowing.make_estimator();
  const double nonsense[3] = {70.0, -70.0, 0.3}, inputs[2] = {5.0, 0.25};
  for (int k = 0; k < 4; ++k) {
    const double time = 0.2 * k;
    estimator->push_measurement(time, nonsense);
    const Estimate& estimate = estimator->estimate(time);
    EXPECT_EQ(estimate.time, time);
    EXPECT_EQ(estimate.state, vehicle.state());
    EXPECT_EQ(estimate.parameters, Eigen::Vector2d(0.75, 0.5));
    EXPECT_EQ(estimate.covariance.size(), 0) << "none is known";
    EXPECT_FALSE(estimate.predicted);
    EXPECT_FALSE(estimate.fallback);
    estimator->push_input(time, inputs);
    vehicle.advance(inputs, 0.2);
  }
}

TEST(TruthEstimator, IsNotMadeWithoutAVehicle) {
  constexpr const char* expected = "known to a simulation only; choose rhe or ekf";
  const std::string made = error_of([] { robot().make_estimator(); });
  EXPECT_THAT(made, StartsWith("run.yaml:2: estimator: name: 'truth'"));
  EXPECT_THAT(made, HasSubstr(expected));
  // Nor is a replay of a log that asks for it.
  EXPECT_THAT(error_of([] { LogScenario(Host(), parse_yaml(configuration, "log.yaml"), {}); }), HasSubstr(expected));
}

TEST(TruthEstimator, IsOneOfThoseThatAScenarioNames) {
  const EstimatorMakers makers = scenario_estimators();
  EXPECT_EQ(makers.named("truth").meaning, "what the simulation knows");
  EXPECT_EQ(makers.all().size(), EstimatorMakers().all().size() + 1);
}

}  // namespace truth_estimator_test
}  // namespace rhec::sim
