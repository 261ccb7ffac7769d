#include "rhec/core/model/step_requirement.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <memory>
#include <vector>

#include "rhec/core/model/formula_model.hpp"
#include "rhec/core/model/implicit_model.hpp"
#include "support/cart.hpp"

namespace rhec {
namespace step_requirement_test {

/// A position driven by a speed that follows its set point with a lag of tau, and an oscillator of 1/p rad/s.
template <class Scalar>
struct Lagging {
  static constexpr int state_count = 4, input_count = 1, parameter_count = 1, output_count = 1;
  Scalar tau{0.01};
  template <class Visitor>
  void options(Visitor&& option) {
    option("tau", tau, "time constant [s]", greater_than(0.0));
  }
  void dynamics(const Scalar* x, const Scalar* u, const Scalar* p, Scalar* dxdt) const {
    dxdt[0] = x[1];
    dxdt[1] = (u[0] - x[1]) / tau;
    dxdt[2] = x[3] / p[0];
    dxdt[3] = -1.0 * x[2] / p[0];
  }
  void outputs(const Scalar* x, Scalar* y) const { y[0] = x[0]; }
};

std::shared_ptr<const Model> lagging(double tau) {
  ModelDescription about;
  about.name = "lagging";
  about.states = {{.name = "x", .unit = "m", .meaning = "position"},
                  {.name = "v", .unit = "m/s", .meaning = "speed"},
                  {.name = "a", .unit = "1", .meaning = "oscillator"},
                  {.name = "b", .unit = "1", .meaning = "its rate"}};
  about.inputs = {{.name = "set_point", .unit = "m/s", .meaning = "wanted speed"}};
  about.parameters = {{.name = "period", .unit = "s", .meaning = "of a radian of the oscillator", .nominal = 1e3}};
  about.outputs = {{.name = "x", .unit = "m", .meaning = "position"}};
  about.roles = {.position_x = 0, .speed = 0};
  Lagging<double> formula;
  formula.tau = tau;
  return std::make_shared<FormulaModel<Lagging>>(formula, about);
}

/// A lateral speed that a tyre takes away with a force over the speed: at rest a hundred times as fast as at 1 m/s.
template <class Scalar>
struct Sideways {
  static constexpr int state_count = 2, input_count = 1, parameter_count = 1, output_count = 1;
  void dynamics(const Scalar* x, const Scalar* u, const Scalar* p, Scalar* dxdt) const {
    using std::sqrt;
    dxdt[0] = u[0];
    dxdt[1] = -1.0 * p[0] * x[1] / sqrt(u[0] * u[0] + 1e-4);
  }
  void outputs(const Scalar* x, Scalar* y) const { y[0] = x[0]; }
};

std::shared_ptr<const Model> sideways() {
  ModelDescription about;
  about.name = "sideways";
  about.states = {{.name = "x", .unit = "m", .meaning = "position"},
                  {.name = "v", .unit = "m/s", .meaning = "lateral speed"}};
  about.inputs = {{.name = "u", .unit = "m/s", .meaning = "speed"}};
  about.parameters = {{.name = "c", .unit = "m/s^2", .meaning = "of the tyre", .nominal = 1.0}};
  about.outputs = {{.name = "x", .unit = "m", .meaning = "position"}};
  about.roles = {.position_x = 0, .speed = 0};
  return std::make_shared<FormulaModel<Sideways>>(Sideways<double>(), about);
}

StepRequirement of(const Model& model, double duration, double period = 1e3) {
  const OperatingPoint point{.state = {0, 1, 0, 0}, .inputs = {1}, .parameters = {period}};
  return step_requirement(model, {&point, 1}, duration);
}

TEST(StepRequirement, SlowModelsNeedOneStep) {
  const StepRequirement needed = of(*lagging(10.0), 0.2);
  EXPECT_EQ(needed.stable_substeps, 1);
  EXPECT_EQ(needed.substeps, 1);
}

TEST(StepRequirement, ALagIsStableBelow2Point785TimeConstants) {
  // The interval of absolute stability of the classical method on the negative real axis is [-2.7853, 0].
  for (const double tau : {0.05, 0.01, 0.002}) {
    const StepRequirement needed = of(*lagging(tau), 0.2);
    EXPECT_EQ(needed.stable_substeps, static_cast<int>(std::ceil(0.2 / tau / 2.785293563))) << tau;
    EXPECT_NEAR(needed.time_constant, tau, 1e-6 * tau) << tau;
    EXPECT_EQ(needed.state, 1) << tau;
    EXPECT_GE(needed.substeps, needed.stable_substeps);
  }
}

TEST(StepRequirement, ImplicitStepsAreStableWhateverTheirLength) {
  for (const double tau : {10.0, 0.05, 0.01, 1e-3, 1e-5}) {
    const StepRequirement needed = of(ImplicitModel(lagging(tau)), 0.2);
    EXPECT_EQ(needed.stable_substeps, 1) << tau;
    EXPECT_EQ(needed.mode_substeps, 1) << tau;
  }
  // What neither decays nor grows is followed: 40 rad in an interval take several steps.
  const StepRequirement needed = of(ImplicitModel(lagging(10.0)), 0.2, 0.005);
  EXPECT_EQ(needed.stable_substeps, 1);
  EXPECT_GT(needed.mode_substeps, 5);
  EXPECT_LT(needed.mode_substeps, of(*lagging(10.0), 0.2, 0.005).mode_substeps);
}

TEST(StepError, OfImplicitStepsIsWhatLasts) {
  const ImplicitModel implicit(lagging(1e-4));
  StepError error(implicit);
  const std::vector<double> state{0, 0, 0, 0}, far{0, 0, 0, 1};
  const double input = 5.0, slow = 1e3, fast = 0.02;
  EXPECT_LT(error(state.data(), &input, &slow, 0.2, 1), 1e-3) << "the speed has jumped, and settled";
  EXPECT_GT(error(far.data(), &input, &fast, 0.2, 1), 1e-3) << "an oscillation of 10 rad";
}

TEST(StepRequirement, AStepThatIsExactEnoughIsAskedForToo) {
  // At 2.5 time constants a step is stable and wrong: R(-2.5) = 0.648, exp(-2.5) = 0.082.
  const StepRequirement needed = of(*lagging(0.08), 0.2);
  EXPECT_EQ(needed.stable_substeps, 1);
  EXPECT_GT(needed.substeps, 1);
  const auto factor = [](double z) { return 1 + z * (1 + z / 2 * (1 + z / 3 * (1 + z / 4))); };
  EXPECT_LE(std::abs(std::pow(factor(-2.5 / needed.substeps), needed.substeps) - std::exp(-2.5)), 0.01);
}

TEST(StepRequirement, OscillationsAreBoundedOnTheImaginaryAxis) {
  // |R(iy)| <= 1 up to y = 2 sqrt(2).
  const StepRequirement needed = of(*lagging(10.0), 0.2, 0.005);
  EXPECT_EQ(needed.stable_substeps, static_cast<int>(std::ceil(0.2 / 0.005 / (2.0 * std::sqrt(2.0)))));
  EXPECT_GT(needed.substeps, needed.stable_substeps);
  EXPECT_TRUE(needed.state == 2 || needed.state == 3);
  EXPECT_NEAR(needed.time_constant, 0.005, 1e-7);
}

TEST(StepRequirement, WhatTakesOverAThousandStepsIsSaidToBe) {
  const StepRequirement needed = of(*lagging(1e-5), 0.2);
  EXPECT_EQ(needed.stable_substeps, 0);
  EXPECT_EQ(needed.substeps, 0);
  EXPECT_EQ(needed.state, 1);
  EXPECT_NEAR(needed.time_constant, 1e-5, 1e-10);
}

TEST(StepRequirement, TheStiffestOfSeveralPointsCounts) {
  const auto model = lagging(10.0);
  const std::vector<OperatingPoint> points = {
      {.state = {0, 1, 0, 0}, .inputs = {1}, .parameters = {1e3}},
      {.state = {0, 1, 0, 0}, .inputs = {1}, .parameters = {0.01}},
      {.state = {0, 1, 0, 0}, .inputs = {1}, .parameters = {std::numeric_limits<double>::quiet_NaN()}}};
  EXPECT_EQ(step_requirement(*model, points, 0.2).stable_substeps, 8);
  EXPECT_EQ(step_requirement(*model, {points.data(), 1}, 0.2).stable_substeps, 1);
}

TEST(StepRequirement, CurvedMotionIsFollowedToATypicalMagnitude) {
  // A speed of -4 m/s under drag of 0.45 /m grows without bound, as the model has it: no mode asks for anything.
  const auto model = testing::cart();
  const OperatingPoint point{.state = {0, -4.0}, .inputs = {0}, .parameters = {0.45, 1.0}};
  const StepRequirement needed = step_requirement(*model, {&point, 1}, 0.4);
  ASSERT_GT(needed.substeps, 1);
  EXPECT_EQ(needed.stable_substeps, 1);
  StepError error(*model);
  EXPECT_LE(error(point.state.data(), point.inputs.data(), point.parameters.data(), 0.4, needed.substeps),
            StepRequirement::state_tolerance);
  EXPECT_GT(error(point.state.data(), point.inputs.data(), point.parameters.data(), 0.4, 1),
            StepRequirement::state_tolerance);
}

TEST(OperatingPoints, LieWithinTheBoundsAndMoveEveryInput) {
  const auto model = testing::cart();
  const std::vector<double> parameters = {0.25, 1.5};
  const std::vector<OperatingPoint> points = operating_points(*model, model->description(), parameters, 2.0);
  double least = 0.0, most = 0.0;
  bool without_slip = false, with_slip = false;
  for (const OperatingPoint& point : points) {
    ASSERT_EQ(point.state.size(), 2u);
    EXPECT_GE(point.state[1], -5.0);
    EXPECT_LE(point.state[1], 5.0);
    least = std::min(least, point.inputs[0]);
    most = std::max(most, point.inputs[0]);
    without_slip = without_slip || point.parameters == nominal_values(model->description().parameters);
    with_slip = with_slip || point.parameters == parameters;
  }
  EXPECT_EQ(least, -1.0);
  EXPECT_EQ(most, 1.0);
  EXPECT_TRUE(without_slip);
  EXPECT_TRUE(with_slip);
}

TEST(OperatingPoints, KnowWhatStandingAsksFor) {
  const auto model = sideways();
  const std::vector<double> nominal = {1.0};
  const StepRequirement needed =
      step_requirement(*model, operating_points(*model, model->description(), nominal, 1.0), 0.2);
  EXPECT_NEAR(needed.time_constant, 0.01, 1e-4) << "of the slowest speed, that of a stop";
  EXPECT_GE(needed.stable_substeps, 8) << "0.2 s / (2.785 x 0.01 s)";
}

TEST(StepError, IsThatOfTwiceAsManyStepsInTypicalMagnitudes) {
  const auto model = lagging(0.1);
  StepError error(*model);
  const std::vector<double> state = {0, 1, 0, 0}, inputs = {0}, parameters = {1e3};
  int worst = -1;
  const double found = error(state.data(), inputs.data(), parameters.data(), 0.2, 1, &worst);
  const auto factor = [](double z) { return 1 + z * (1 + z / 2 * (1 + z / 3 * (1 + z / 4))); };
  EXPECT_NEAR(found, std::abs(factor(-2.0) - factor(-1.0) * factor(-1.0)), 1e-14);
  EXPECT_EQ(worst, 1);
  const auto unstable = lagging(1e-9);
  StepError infinite(*unstable);
  EXPECT_EQ(infinite(state.data(), inputs.data(), parameters.data(), 1e200, 2),
            std::numeric_limits<double>::infinity());
}

}  // namespace step_requirement_test
}  // namespace rhec
