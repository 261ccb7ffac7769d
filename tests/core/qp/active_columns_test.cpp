// core/qp/active_columns.cpp, part of the dual active-set method: bounds that need no factorisation, linearly dependent
// ones, and those that exceed the capacity.
#include <gtest/gtest.h>

#include <limits>

#include "rhec/core/qp/stage_qp_solver.hpp"
#include "support/active_set_attempt.hpp"

namespace rhec {
namespace active_columns_test {

using namespace testing;

TEST(ActiveColumns, AddsBoundsWithoutAnotherFactorisation) {
  RandomQp random(23);
  int with_bounds = 0;
  for (int trial = 0; trial < 50; ++trial) {
    const StageQp qp = feasible_qp(random, true, 0.5);
    const Attempt attempt(qp, nullptr);
    if (attempt.outcome != DualActiveSet::Outcome::solved) continue;
    EXPECT_EQ(attempt.method.factorisations(), 1);
    with_bounds += count_active(qp, attempt.active) > 0;
  }
  EXPECT_GT(with_bounds, 30);
}

TEST(ActiveColumns, SettlesWhereActiveBoundsDependOnEachOther) {
  // Controls at their bounds already bring the state to its bound: any of these bounds may be reported active.
  StageQp qp = integrator(10, 20.0);
  for (int i = 0; i < 10; ++i) {
    qp.control_lower(i)[0] = -0.5;
    qp.control_upper(i)[0] = 0.5;
    qp.state_upper(i + 1)[0] = 0.5 * (i + 1);
  }
  ActiveSet all(qp.capacity());
  for (int i = 0; i < 10; ++i) all.control(i)[0] = all.state(i + 1)[0] = 1;
  for (const ActiveSet* claimed : {static_cast<const ActiveSet*>(nullptr), static_cast<const ActiveSet*>(&all)}) {
    const Attempt attempt(qp, claimed);
    ASSERT_EQ(attempt.outcome, DualActiveSet::Outcome::solved);
    EXPECT_LT(kkt_violation(qp, attempt.step), 1e-9);
    for (int i = 0; i <= 10; ++i) EXPECT_NEAR(attempt.step.state(i)[0], 0.5 * i, 1e-9);
  }
}

TEST(ActiveColumns, KeepsBoundsThatCoincide) {
  StageQp qp = integrator(8, -3.0);
  qp.state_lower(4)[0] = qp.state_upper(4)[0] = 1.0;
  qp.control_lower(6)[0] = qp.control_upper(6)[0] = 0.25;
  ActiveSet claimed(qp.capacity());
  claimed.state(4)[0] = claimed.control(6)[0] = 1;
  const Attempt attempt(qp, &claimed);
  ASSERT_EQ(attempt.outcome, DualActiveSet::Outcome::solved);
  EXPECT_NEAR(attempt.step.state(4)[0], 1.0, 1e-12);
  EXPECT_NEAR(attempt.step.control(6)[0], 0.25, 1e-12);
  EXPECT_LT(attempt.step.state_bound(4)[0], 0.0) << "held up, although the upper side was claimed";
  EXPECT_LT(kkt_violation(qp, attempt.step), 1e-9);
}

TEST(ActiveColumns, LeavesMoreBoundsThanItProvidesForToOthers) {
  constexpr int intervals = 2 * DualActiveSet::max_columns;
  StageQp qp = integrator(intervals, 1000.0);
  for (int i = 0; i < intervals; ++i) qp.control_upper(i)[0] = 1.0 + 0.001 * i;
  const Attempt attempt(qp, nullptr);
  EXPECT_EQ(attempt.outcome, DualActiveSet::Outcome::too_much);
  StageQpSolver solver(qp.capacity());
  Iterate step(qp.capacity());
  solver.guess_from(qp, step);
  ASSERT_NE(solver.solve(qp, step), StageQpSolver::Outcome::infeasible);
  EXPECT_LT(kkt_violation(qp, step), 1e-7);
  // Claimed, they are held inside the factorisation, however many they are.
  solver.guess_from(qp, step);
  Iterate again(qp.capacity());
  ASSERT_EQ(solver.solve(qp, again), StageQpSolver::Outcome::active_set);
  EXPECT_EQ(solver.factorisations(), 1);
  EXPECT_LT(distance(qp, step, again), 1e-9);
}

TEST(ActiveColumns, HaveRoomForManyLimits) {
  constexpr double infinity = std::numeric_limits<double>::infinity();
  constexpr int intervals = 2 * DualActiveSet::max_columns;
  StageQp qp(Capacity{intervals, 1, 1, 1});
  qp.set_intervals(intervals);
  qp.initial_state_is_given = true;
  for (int i = 0; i <= intervals; ++i) {
    const bool has_control = i < intervals;
    qp.set_sizes(i, 1, has_control);
    qp.H(i)[0] = 1.0;
    qp.h(i)[0] = -100.0;
    if (!has_control) break;
    qp.AB(i)[0] = qp.AB(i)[1] = 1.0;
    qp.H(i)[qp.stride() + 1] = 1.0;
    qp.control_lower(i)[0] = -infinity;
    qp.control_upper(i)[0] = infinity;
    // As a limit, not as a bound of the control, which would be held.
    qp.set_limits(i, 1);
    qp.G(i)[1] = 1.0;
    qp.limit_lower(i)[0] = -infinity;
    qp.limit_upper(i)[0] = 0.1;
    qp.limit_linear(i)[0] = infinity;
  }
  StageQpSolver solver(qp.capacity());
  Iterate step(qp.capacity());
  solver.guess_from(qp, step);
  ASSERT_EQ(solver.solve(qp, step), StageQpSolver::Outcome::active_set);
  for (int i = 0; i < intervals; ++i) EXPECT_NEAR(step.control(i)[0], 0.1, 1e-9);
  EXPECT_LT(testing::kkt_violation(qp, step), 1e-7);  // of multipliers of some thousand
}

}  // namespace active_columns_test
}  // namespace rhec
