#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>
#include <string>

#include "rhec/core/model/formula_model.hpp"
#include "rhec/plugins/host/host.hpp"
#include "rhec/plugins/robot/robot.hpp"
#include "rhec/plugins/yaml/yaml.hpp"
#include "sim/support/unicycle.hpp"

namespace rhec::sim {
namespace model_check_integration_test {

using testing::HasSubstr;

/// A wheel whose motor follows its set point with a lag.
template <class Scalar>
struct Wheel {
  static constexpr int state_count = 2, input_count = 1, parameter_count = 0, output_count = 1;
  Scalar lag{0.01};
  template <class Visitor>
  void options(Visitor&& option) {
    option("lag", lag, "time constant [s]", greater_than(0.0));
  }
  void dynamics(const Scalar* x, const Scalar* u, const Scalar*, Scalar* dxdt) const {
    dxdt[0] = x[1];
    dxdt[1] = (u[0] - x[1]) / lag;
  }
  void outputs(const Scalar* x, Scalar* y) const { y[0] = x[0]; }
};

Finding found(double lag, const ModelCheckOptions& options = {}) {
  ModelDescription about;
  about.name = "wheel";
  about.source = "none";
  about.states = {{.name = "angle", .unit = "1", .meaning = "turned"},
                  {.name = "rate", .unit = "1/s", .meaning = "speed"}};
  about.inputs = {{.name = "set_point", .unit = "1/s", .meaning = "wanted speed"}};
  about.outputs = {{.name = "angle", .unit = "1", .meaning = "measured"}};
  Wheel<double> formula;
  formula.lag = lag;
  FormulaModel<Wheel> model(formula, about);
  const ModelCheck check = check_model(model, options);
  for (const Finding& finding : check.findings)
    if (finding.check == "integration") return finding;
  return {};
}

TEST(Integration, OfASlowModelTakesOneStep) {
  const Finding finding = found(1.0);
  EXPECT_EQ(finding.verdict, Verdict::pass);
  EXPECT_THAT(finding.found,
              HasSubstr("an interval of 0.2 s takes 1 Runge-Kutta step; its shortest time constant is 1 s"));
  EXPECT_EQ(finding.where, "rate");
}

TEST(Integration, OfAFastLagWarnsOfTheCost) {
  const Finding finding = found(0.01);
  EXPECT_EQ(finding.verdict, Verdict::warn);
  EXPECT_EQ(finding.where, "rate");
  EXPECT_THAT(finding.found, HasSubstr("time constant is 0.01 s, in the state 'rate'"));
  EXPECT_EQ(found(0.01, {.interval = 0.02}).verdict, Verdict::pass);
}

TEST(Integration, WithFewerStepsThanNeededWarns) {
  const Finding finding = found(0.01, {.substeps = 2});
  EXPECT_EQ(finding.verdict, Verdict::warn);
  EXPECT_THAT(finding.found, HasSubstr("2 Runge-Kutta steps in an interval of 0.2 s are inexact"));
  EXPECT_THAT(finding.advice, HasSubstr("or auto"));
}

TEST(Integration, OfWhatNoStepsFollowFails) {
  const Finding finding = found(1e-5);
  EXPECT_EQ(finding.verdict, Verdict::fail);
  EXPECT_THAT(finding.found, HasSubstr("1000 Runge-Kutta steps do not follow an interval of 0.2 s"));
}

// Of a robot whose steps are chosen for it, what is said is not that other steps be chosen for it.
TEST(Integration, OfARobotThatChoosesItsStepsAsksForNoOtherNumber) {
  const auto advice = [](const std::string& substeps) {
    const Robot robot(Host(), RobotOptions::table().parse(parse_yaml(R"(
model:
  equations:
    name: motor
    states: {x: {role: position_x}, y: {role: position_y}, psi: {role: heading, angle: true}, v: {unit: m/s}}
    inputs: {wanted: {unit: m/s, role: speed}, turn: {unit: rad/s}}
    outputs: {x: {}, y: {}}
    equations: |
      x' = v * cos(psi)
      y' = v * sin(psi)
      psi' = turn
      v' = (wanted - v) / 0.001
estimator: )" + substeps,
                                                                     "robot.yaml"),
                                                          "robot"));
    const ModelCheck check = check_model(Host(), robot, {.samples = 16});
    for (const Finding& finding : check.findings)
      if (finding.check == "integration") return finding.advice;
    return std::string();
  };
  EXPECT_THAT(advice("{}"), testing::AllOf(HasSubstr("integrator: implicit"), testing::Not(HasSubstr("auto"))));
  EXPECT_THAT(advice("{substeps: 80}"), HasSubstr("or auto"));
}

}  // namespace model_check_integration_test
}  // namespace rhec::sim
