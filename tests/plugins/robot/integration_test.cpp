#include "rhec/plugins/robot/integration.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "plugins/robot/robots.hpp"
#include "rhec/core/model/implicit_model.hpp"
#include "support/error_of.hpp"
#include "support/other_model.hpp"

namespace rhec {
namespace integration_test {

using testing::AllOf;
using testing::HasSubstr;
using testing::StartsWith;

/// A vehicle whose steering follows a set point with a lag [s].
std::shared_ptr<const RobotContext> lagging(const std::string& lag, double step = 0.2) {
  const Settings section = settings(
      "equations:\n"
      "  states:\n"
      "    x: {unit: m, typical: 10, role: position_x}\n"
      "    y: {unit: m, typical: 10, role: position_y}\n"
      "    psi: {unit: rad, angle: true, role: heading}\n"
      "    delta: {unit: rad, typical: 0.3, bounds: [-0.6, 0.6]}\n"
      "  inputs:\n"
      "    v: {unit: m/s, typical: 5, role: speed}\n"
      "    set_point: {unit: rad, typical: 0.3, bounds: [-0.6, 0.6]}\n"
      "  outputs:\n"
      "    x: {unit: m}\n"
      "    y: {unit: m}\n"
      "  options: {lag: {default: " +
      lag +
      ", unit: s, above: 0}}\n"
      "  equations: |\n"
      "    x' = v * cos(psi)\n"
      "    y' = v * sin(psi)\n"
      "    psi' = v / 1.4 * tan(delta)\n"
      "    delta' = (set_point - delta) / lag\n");
  const auto model = ModelSection(host(), section).model();
  return std::make_shared<const RobotContext>(
      RobotContext{host(), step, model, model->description(), NoiseSection({}, model->description())});
}

int substeps_of(std::optional<int> given, const Settings& section, const std::shared_ptr<const RobotContext>& context,
                std::span<const double> parameters = {}, Integrator integrator = Integrator::runge_kutta) {
  return integration_of(integrator, given, section, context, parameters).substeps;
}

TEST(Integration, AutoFollowsTheShortestTimeConstant) {
  EXPECT_EQ(substeps_of({}, {}, lagging("1")), 1);
  // 10 ms in steps of 0.2 s: 20 / 2.785 = 7.2 steps are stable.
  EXPECT_GE(substeps_of({}, {}, lagging("0.01")), 8);
  EXPECT_LE(substeps_of({}, {}, lagging("0.01")), 12);
  EXPECT_LE(substeps_of({}, {}, lagging("0.01", 0.01)), 2);
  EXPECT_EQ(substeps_of({}, {}, lagging("0.01", 0.001)), 1);
  EXPECT_EQ(substeps_of({}, {}, context_with(), std::vector<double>{0.5, 0.5}), 1);
}

TEST(Integration, StepsThatAreGivenAreTakenIfTheyAreStable) {
  EXPECT_EQ(substeps_of(8, {}, lagging("0.01")), 8);
  EXPECT_EQ(substeps_of(40, {}, lagging("0.01")), 40);
  const Settings section = settings("horizon: 5\nsubsteps: 7");
  EXPECT_THAT(
      error_of([&] { substeps_of(7, section, lagging("0.01")); }),
      AllOf(StartsWith("robot.yaml:2: substeps: found 7"), HasSubstr("unstable"),
            HasSubstr("time constant of 0.01 s, in the state 'delta'"), HasSubstr("0.2 s (step)"),
            HasSubstr("expected at least " + std::to_string(substeps_of({}, {}, lagging("0.01"))) + ", or auto"),
            HasSubstr("integrator: implicit")));
}

TEST(Integration, WhatNoStepsFollowIsRefused) {
  for (const char* text : {"substeps: auto", "substeps: 1000"}) {
    const Settings section = settings(text);
    EXPECT_THAT(
        error_of([&] { substeps_of(section.find("substeps")->integer(), section, lagging("0.00001")); }),
        AllOf(StartsWith("robot.yaml:1: substeps: "), HasSubstr("time constant of 1e-05 s, in the state 'delta'"),
              HasSubstr("1000 Runge-Kutta steps are not enough"), HasSubstr("integrator: implicit"),
              HasSubstr("shorten `step`")))
        << text;
  }
}

TEST(Integration, ImplicitStepsNeedNotBeShort) {
  for (const char* lag : {"0.1", "0.01", "0.001", "0.00001"}) {
    const auto context = lagging(lag);
    const Integration found = integration_of(Integrator::radau, {}, {}, context, {});
    EXPECT_EQ(found.substeps, 1) << lag;
    EXPECT_TRUE(is_implicit(*found.context->model)) << lag;
    EXPECT_EQ(found.context->step, context->step);
    EXPECT_FALSE(is_implicit(*context->model)) << "others' model";
  }
  EXPECT_EQ(substeps_of(3, {}, lagging("0.00001"), {}, Integrator::radau), 3);
}

TEST(Integration, AutoIsImplicitWhereExplicitStepsAreMany) {
  const auto found = [](const char* lag) { return integration_of(Integrator::automatic, {}, {}, lagging(lag), {}); };
  EXPECT_FALSE(is_implicit(*found("1").context->model));
  ASSERT_GT(substeps_of({}, {}, lagging("0.02")), 1);
  ASSERT_LE(substeps_of({}, {}, lagging("0.02")), most_explicit_substeps);
  EXPECT_FALSE(is_implicit(*found("0.02").context->model));
  EXPECT_EQ(found("0.02").substeps, substeps_of({}, {}, lagging("0.02")));
  ASSERT_GT(substeps_of({}, {}, lagging("0.001")), most_explicit_substeps);
  EXPECT_TRUE(is_implicit(*found("0.001").context->model));
  EXPECT_TRUE(is_implicit(*found("0.00001").context->model));
}

TEST(Integration, AModelWithoutAFormulaHasNoImplicitSteps) {
  RobotContext context = *lagging("0.01");
  context.model = std::make_shared<const OtherModel>(context.model);
  const auto opaque = std::make_shared<const RobotContext>(context);
  const Settings section = settings("horizon: 5\nintegrator: implicit");
  EXPECT_THAT(error_of([&] { integration_of(Integrator::radau, {}, section, opaque, {}); }),
              AllOf(StartsWith("robot.yaml:2: integrator: "), HasSubstr("has no formula")));
  EXPECT_FALSE(is_implicit(*integration_of(Integrator::automatic, {}, {}, opaque, {}).context->model));
  EXPECT_THAT(error_of([&] { substeps_of(7, section, opaque); }), testing::Not(HasSubstr("integrator: implicit")));
}

}  // namespace integration_test
}  // namespace rhec
