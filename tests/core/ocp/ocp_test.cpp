#include "rhec/core/ocp/ocp.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "rhec/core/base/infinity.hpp"
#include "rhec/core/ocp/iterate_checks.hpp"
#include "rhec/core/ocp/linearisation.hpp"
#include "support/cart.hpp"
#include "support/same_ocp.hpp"
#include "support/test_models.hpp"

namespace rhec {
namespace ocp_test {

using testing::cart_control;
using testing::cart_estimation;
using ::testing::Each;
using testing::SameOcp;
using testing::scattered_point;

TEST(RollOut, ClipsControlsAndLeavesNoDefect) {
  const auto problem = cart_control(5);
  Iterate point = scattered_point(*problem);
  point.control(1)[0] = 3.0;
  point.control(2)[0] = -3.0;
  const double kept = point.control(3)[0];
  std::vector<double> scratch(problem->scratch_size()), defects(5 * problem->capacity().states, 1.0);
  roll_out(*problem, point, scratch);
  EXPECT_EQ(point.control(1)[0], 1.0);
  EXPECT_EQ(point.control(2)[0], -1.0);
  EXPECT_EQ(point.control(3)[0], kept);
  EXPECT_EQ(point.state(0)[0], problem->given_state()[0]);
  problem->evaluate(point, defects.data(), scratch);
  EXPECT_THAT(defects, Each(0.0));
}

TEST(RollOut, ClipsAFreeInitialState) {
  const auto problem = cart_estimation(4);
  Iterate point = scattered_point(*problem);
  point.state(0)[0] = 123.0;  // has no bounds
  point.state(0)[1] = 9.0;    // a speed of at most 5
  point.state(0)[2] = -1.0;   // the drag is positive
  std::vector<double> scratch(problem->scratch_size()), defects(4 * problem->capacity().states, 1.0);
  roll_out(*problem, point, scratch);
  EXPECT_EQ(point.state(0)[0], 123.0);
  EXPECT_EQ(point.state(0)[1], 5.0);
  EXPECT_EQ(point.state(0)[2], 0.0);
  problem->evaluate(point, defects.data(), scratch);
  EXPECT_THAT(defects, Each(0.0));
}

TEST(Ocp, PrefersTheCurvatureThatConverges) {
  EXPECT_EQ(cart_control(3)->preferred_hessian(), Hessian::exact);
  EXPECT_EQ(cart_estimation(3)->preferred_hessian(), Hessian::gauss_newton) << "its residuals are small";
  RhcProblem::Setup setup = cart_control(3)->setup();
  const RhcProblem blunt(std::make_shared<testing::WithoutSecondDerivatives>(testing::cart()), setup);
  EXPECT_EQ(blunt.preferred_hessian(), Hessian::gauss_newton) << "there is no other";
}

TEST(Ocp, CanRollOutWhereTheInitialStateIsGiven) {
  EXPECT_TRUE(cart_control(3)->can_roll_out());
  EXPECT_FALSE(cart_estimation(3)->can_roll_out());
}

TEST(Ocp, MayDependOnEverythingUnlessItSaysOtherwise) {
  const auto problem = cart_control(3);
  const SameOcp plain(*problem);
  const auto ns = static_cast<std::size_t>(problem->capacity().states);
  std::vector<std::uint8_t> states(ns * ns, 7), controls(ns, 7);
  plain.mark_dynamics(1, states.data(), controls.data());
  EXPECT_THAT(states, Each(1));
  EXPECT_THAT(controls, Each(1));
  problem->mark_dynamics(1, states.data(), controls.data());
  EXPECT_EQ(states[1 * ns + 0], 1) << "the speed changes the position";
  EXPECT_EQ(states[2 * ns + 2], 1) << "a parameter is carried along";
  EXPECT_EQ(states[1 * ns + 2], 0) << "and the speed does not change it";
  EXPECT_EQ(controls[2], 0);
}

TEST(Ocp, RefreshesByLinearisingAnewUnlessItKnowsBetter) {
  const auto problem = cart_control(4);
  const SameOcp plain(*problem);
  const Iterate point = scattered_point(*problem);
  std::vector<double> scratch(problem->scratch_size());
  StageQp qp(problem->capacity()), expected(problem->capacity());
  plain.linearise(all_stages(plain), point, Hessian::gauss_newton, qp, scratch);
  problem->state_reference(2)[0] += 1.0;
  problem->given_state()[0] += 0.25;
  plain.refresh(point, qp, scratch);
  problem->linearise(all_stages(*problem), point, Hessian::gauss_newton, expected, scratch);
  for (int i = 0; i <= 4; ++i)
    for (int j = 0; j < qp.states(i); ++j) EXPECT_EQ(qp.q(i)[j], expected.q(i)[j]) << i;
  EXPECT_EQ(qp.initial_step()[0], problem->given_state()[0] - point.state(0)[0]);
  const auto linearisation = plain.make_linearisation();
  EXPECT_EQ(&linearisation->ocp(), &plain);
}

/// Two limits at each node: a hard one and a soft one.
class WithLimits final : public SameOcp {
 public:
  using SameOcp::SameOcp;
  int limit_count(int) const noexcept override { return 2; }
  const double* limit_lower(int) const noexcept override { return lower_; }
  const double* limit_upper(int) const noexcept override { return upper_; }
  const double* limit_linear(int) const noexcept override { return linear_; }
  const double* limit_quadratic(int) const noexcept override { return quadratic_; }

 private:
  double lower_[2] = {-1.0, -infinity}, upper_[2] = {1.0, 2.0}, linear_[2] = {infinity, 3.0},
         quadratic_[2] = {0.0, 8.0};
};

TEST(Ocp, WhatIsBeyondALimitCostsOrIsAViolation) {
  const auto problem = cart_control(3);
  const WithLimits limited(*problem);
  const auto costs = [&](double hard, double soft) {
    const double values[2] = {hard, soft};
    return limit_costs(limited, 1, values);
  };
  EXPECT_EQ(costs(0.5, -100.0).slack, 0.0);
  EXPECT_EQ(costs(0.5, -100.0).violation, 0.0);
  EXPECT_EQ(costs(-1.5, 2.0).violation, 0.5);
  EXPECT_EQ(costs(1.25, 2.0).violation, 0.25);
  EXPECT_EQ(costs(0.0, 2.5).slack, 3.0 * 0.5 + 0.5 * 8.0 * 0.25);
  EXPECT_TRUE(std::isnan(costs(0.0, std::nan("")).slack));
  std::vector<std::uint8_t> states(2 * static_cast<std::size_t>(limited.state_count(3)), 7);
  limited.mark_limits(3, states.data(), nullptr);
  EXPECT_THAT(states, Each(1));

  StageQp qp({.intervals = 1, .states = 1, .controls = 1, .limits = 1});
  qp.set_intervals(1);
  qp.set_limits(1, 1);
  qp.limit_upper(1)[0] = -0.5;  // the iterate is beyond it by a half
  qp.limit_lower(1)[0] = -infinity;
  qp.limit_linear(1)[0] = 3.0;
  qp.limit_quadratic(1)[0] = 8.0;
  EXPECT_EQ(slack_costs(qp, {0, 1}), 2.5);
  EXPECT_EQ(slack_costs(qp, {0, 0}), 0.0);
  qp.limit_linear(1)[0] = infinity;
  EXPECT_EQ(slack_costs(qp, {0, 1}), 0.0);
}

}  // namespace ocp_test
}  // namespace rhec
