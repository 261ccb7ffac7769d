#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include "rhec/core/qp/stage_qp_solver.hpp"
#include "support/qp_conditions.hpp"

namespace rhec {
namespace limit_checks_test {

using namespace rhec::testing;

constexpr double infinity = std::numeric_limits<double>::infinity();

/// s+ = s + w from 0, cost w^2 / 2 + s_1^2 / 2 - s_1, and one limit on s_1 + w_0 (at node 1: on s_1).
struct Small {
  StageQp qp{{1, 1, 1, 1}};
  Iterate step{qp.capacity()};
  StageQpSolver::Outcome outcome = StageQpSolver::Outcome::out_of_time;

  Small(double lower, double upper, double linear, double quadratic, double entry = 1.0) {
    qp.set_intervals(1);
    qp.initial_state_is_given = true;
    qp.set_sizes(0, 1, 1);
    qp.set_sizes(1, 1, 0);
    qp.AB(0)[0] = qp.AB(0)[1] = 1.0;
    R_of(qp, 0)(0, 0) = Q_of(qp, 1)(0, 0) = 1.0;
    qp.q(1)[0] = -1.0;
    qp.set_limits(1, 1);
    qp.G(1)[0] = entry;
    qp.limit_lower(1)[0] = lower;
    qp.limit_upper(1)[0] = upper;
    qp.limit_linear(1)[0] = linear;
    qp.limit_quadratic(1)[0] = quadratic;
    StageQpSolver solver(qp.capacity());
    solver.guess_from(qp, step);
    outcome = solver.solve(qp, step);
  }
  double state() const { return step.state(1)[0]; }
  double multiplier() const { return step.limit_bound(1)[0]; }
};

TEST(LimitChecks, TheSolutionsOfOneRow) {
  // Without limits s_1 = 1/2; the derivative of the cost by s_1 is 2 s_1 - 1.
  const Small inactive(-1.0, 1.0, infinity, 0.0);
  EXPECT_NEAR(inactive.state(), 0.5, 1e-12);
  EXPECT_EQ(inactive.multiplier(), 0.0);
  const Small hard(-infinity, 0.2, infinity, 0.0);
  EXPECT_NEAR(hard.state(), 0.2, 1e-12);
  EXPECT_NEAR(hard.multiplier(), 0.6, 1e-12);
  const Small lower(0.7, infinity, infinity, 0.0);
  EXPECT_NEAR(lower.state(), 0.7, 1e-12);
  EXPECT_NEAR(lower.multiplier(), -0.4, 1e-12);
  const Small kept(-infinity, 0.2, 0.8, 0.0);  // costs more than it gains
  EXPECT_NEAR(kept.state(), 0.2, 1e-12);
  const Small violated(-infinity, 0.2, 0.4, 0.0);  // 2 s - 1 + 0.4 = 0
  EXPECT_NEAR(violated.state(), 0.3, 1e-12);
  EXPECT_NEAR(violated.multiplier(), 0.4, 1e-12);
  const Small squared(-infinity, 0.2, 0.4, 2.0);  // 2 s - 1 + 0.4 + 2 (s - 0.2) = 0
  EXPECT_NEAR(squared.state(), 0.25, 1e-12);
  EXPECT_NEAR(squared.multiplier(), 0.5, 1e-12);
  const Small only_squared(-infinity, 0.2, 0.0, 2.0);  // 2 s - 1 + 2 (s - 0.2) = 0
  EXPECT_NEAR(only_squared.state(), 0.35, 1e-12);
}

TEST(LimitChecks, RefusesWhatCannotHold) {
  using Outcome = StageQpSolver::Outcome;
  const double nan = std::nan("");
  EXPECT_EQ(Small(1.0, -1.0, infinity, 0.0).outcome, Outcome::infeasible);
  EXPECT_EQ(Small(nan, 1.0, infinity, 0.0).outcome, Outcome::infeasible);
  EXPECT_EQ(Small(-1.0, 1.0, nan, 0.0).outcome, Outcome::infeasible);
  EXPECT_EQ(Small(-1.0, 1.0, infinity, 0.0, nan).outcome, Outcome::infeasible);
  EXPECT_EQ(Small(infinity, infinity, infinity, 0.0).outcome, Outcome::infeasible);
}

TEST(LimitChecks, RowsOfZerosHoldOrNot) {
  using Outcome = StageQpSolver::Outcome;
  EXPECT_EQ(Small(-1.0, 1.0, infinity, 0.0, 0.0).outcome, Outcome::active_set);
  EXPECT_EQ(Small(1.0, 2.0, infinity, 0.0, 0.0).outcome, Outcome::infeasible);
  for (const double quadratic : {0.0, 3.0}) {
    const Small soft(1.0, 2.0, 0.5, quadratic, 0.0);
    EXPECT_EQ(soft.outcome, Outcome::active_set);
    EXPECT_NEAR(soft.state(), 0.5, 1e-12);
    EXPECT_NEAR(soft.multiplier(), -0.5 - quadratic, 1e-12);
  }
}

}  // namespace limit_checks_test
}  // namespace rhec
