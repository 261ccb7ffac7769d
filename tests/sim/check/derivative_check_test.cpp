#include "rhec/sim/check/derivative_check.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <limits>
#include <numbers>

#include "sim/support/unicycle.hpp"

namespace rhec::sim {
namespace derivative_check_test {

using testing::Pair;

constexpr double infinity = std::numeric_limits<double>::infinity();

Variable variable(const char* unit, double scale, double lower = -infinity, double upper = infinity) {
  Variable made;
  made.name = "a";
  made.unit = unit;
  made.scale = scale;
  made.lower = lower;
  made.upper = upper;
  return made;
}

TEST(RangeOf, IsThatOfTheBoundsOrOfScales) {
  EXPECT_THAT(range_of(variable("m", 1.0, -1.0, 3.0), 10.0), Pair(-1.0, 3.0));
  EXPECT_THAT(range_of(variable("m", 2.0), 10.0), Pair(-20.0, 20.0));
  EXPECT_THAT(range_of(variable("rad", 0.1), 1.0), Pair(-std::numbers::pi, std::numbers::pi));
  EXPECT_THAT(range_of(variable("m", 2.0, -1.0), 10.0), Pair(-1.0, 20.0));
  EXPECT_THAT(range_of(variable("m", 2.0, 5.0), 10.0), Pair(5.0, 25.0));
  EXPECT_THAT(range_of(variable("m", 2.0, -infinity, -5.0), 10.0), Pair(-25.0, -5.0));
}

TEST(RandomStages, KeepAwayFromBoundsAndStandStillNowAndThen) {
  const ModelDescription about = unicycle_description();
  const StagePoints stages = random_stages(about, 30, 1), same = random_stages(about, 30, 1),
                    other = random_stages(about, 30, 2);
  EXPECT_EQ(stages.states, same.states);
  EXPECT_EQ(stages.durations, same.durations);
  EXPECT_NE(stages.states, other.states);
  ASSERT_EQ(stages.states.size(), 30U * 4U);
  ASSERT_EQ(stages.parameters_end.size(), 30U * 2U);
  for (int i = 0; i < 30; ++i) {
    for (int j = 0; j < 4; ++j) EXPECT_EQ(stages.states[i * 4 + j] == 0.0, i % 5 == 4) << i;
    for (int j = 0; j < 2; ++j) {
      EXPECT_EQ(stages.inputs[i * 2 + j] == 0.0, i % 3 == 2) << i;
      for (const auto* parameters : {&stages.parameters, &stages.parameters_end}) {
        EXPECT_GE((*parameters)[i * 2 + j], 0.2 + 0.02 * 0.8);
        EXPECT_LE((*parameters)[i * 2 + j], 1.0 - 0.02 * 0.8);
      }
    }
    EXPECT_LE(std::abs(stages.states[i * 4 + 3]), 0.96 * 0.8) << "the yaw rate, which has bounds";
    EXPECT_GE(stages.durations[i], 0.05);
    EXPECT_LE(stages.durations[i], 0.25);
  }
}

TEST(DerivativeErrors, AreRoundingWhereDerivativesAreRight) {
  const PassedOn model;
  const StagePoints stages = random_stages(model.description(), 20, 3);
  for (const bool ramp : {false, true}) {
    const DerivativeErrors errors = derivative_errors(model, model.description(), stages, ramp, 2);
    EXPECT_LT(errors.first.error, 1e-7) << errors.first.where;
    EXPECT_LT(errors.second.error, 1e-7) << errors.second.where;
    EXPECT_LT(errors.output_first.error, 1e-7) << errors.output_first.where;
    EXPECT_LT(errors.output_second.error, 1e-7) << errors.output_second.where;
    EXPECT_GT(errors.compared, 20 * 4 * (ramp ? 10 : 8));
    EXPECT_EQ(errors.skipped, 0);
    EXPECT_LT(integration_error(model, model.description(), stages, ramp, 2).error, 1e-12);
  }
}

TEST(DerivativeErrors, NameTheEntryThatIsWrongAndByHowMuch) {
  Spoilt model;
  model.spoil_step = [](const Model::Intervals& q, int nz) {
    if (!q.jacobians) return;
    for (int i = 0; i < q.count; ++i) q.jacobians[i * 4 * nz + 4 * 4] += 0.125;  // column of v, row of x
  };
  model.second = false;
  const DerivativeErrors errors =
      derivative_errors(model, model.description(), random_stages(model.description(), 20, 3), false, 1);
  EXPECT_EQ(errors.first.where, "d next x / d v");
  EXPECT_NEAR(errors.first.given - errors.first.expected, 0.125, 1e-6);
  EXPECT_GT(errors.first.error, 0.01);
  EXPECT_EQ(errors.second.where, "") << "a model without second derivatives";
  EXPECT_LT(errors.output_first.error, 1e-7);
}

TEST(DerivativeErrors, OnARampTheEndsOfParametersAreVariablesToo) {
  Spoilt model;
  model.spoil_step = [](const Model::Intervals& q, int nz) {
    if (!q.jacobians || !q.parameters_end) return;
    for (int i = 0; i < q.count; ++i) q.jacobians[i * 4 * nz + 9 * 4 + 2] += 0.125;  // column of mu's end, row of psi
  };
  const StagePoints stages = random_stages(model.description(), 20, 3);
  model.second = false;
  EXPECT_LT(derivative_errors(model, model.description(), stages, false, 1).first.error, 1e-7);
  EXPECT_EQ(derivative_errors(model, model.description(), stages, true, 1).first.where,
            "d next psi / d mu at the interval's end");
}

TEST(DerivativeErrors, CountsWhatIsNotFinite) {
  Spoilt model;
  model.second = false;
  model.spoil_node = [](const Model::Nodes& q) {
    if (q.jacobians) q.jacobians[0] = std::nan("");
  };
  const DerivativeErrors errors =
      derivative_errors(model, model.description(), random_stages(model.description(), 20, 3), false, 1);
  EXPECT_EQ(errors.skipped, 1);
}

TEST(IntegrationError, NamesTheStateThatIsIntegratedOtherwise) {
  Spoilt model;
  model.spoil_step = [](const Model::Intervals& q, int) {
    if (!q.next_states) return;
    for (int i = 0; i < q.count; ++i) q.next_states[i * 4 + 1] += 1e-3;
  };
  const WorstEntry worst =
      integration_error(model, model.description(), random_stages(model.description(), 20, 3), false, 1);
  EXPECT_EQ(worst.where, "next y");
  EXPECT_NEAR(worst.given - worst.expected, 1e-3, 1e-12);
  EXPECT_GT(worst.error, 1e-5);
}

}  // namespace derivative_check_test
}  // namespace rhec::sim
