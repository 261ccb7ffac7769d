#include "rhec/core/qp/stage_qp_solver.hpp"

#include <cmath>
#include <utility>

#include <gtest/gtest.h>

#include "support/qp_conditions.hpp"

namespace rhec::gn_rti {
namespace stage_qp_solver_test {

using rhec::testing::bounded_qp;
using rhec::testing::feasible_qp;
using rhec::testing::kkt_violation;
using rhec::testing::RandomQp;

TEST(StageQpSolver, SolvesRandomQpsToTheirKktConditions) {
  RandomQp random(11);
  int exact = 0, interior = 0;
  for (int trial = 0; trial < 500; ++trial) {
    StageQp qp = bounded_qp(random, trial % 2 == 0, trial % 3 == 0 ? 0.3 : 2.0);
    StageQpSolver solver(qp.capacity());
    Iterate step(qp.capacity());
    solver.guess_from(qp, step);
    const auto outcome = solver.solve(qp, step);
    if (outcome == StageQpSolver::Outcome::infeasible) continue;
    (outcome == StageQpSolver::Outcome::active_set ? exact : interior)++;
    ASSERT_LT(kkt_violation(qp, step), 1e-7) << "trial " << trial;
  }
  EXPECT_GT(exact, 400);
  RecordProperty("interior_point", interior);
}

TEST(StageQpSolver, TheInteriorPointMethodAgreesWithActiveSets) {
  RandomQp random(12);
  int compared = 0;
  for (int trial = 0; trial < 100; ++trial) {
    StageQp qp = bounded_qp(random, true, 0.5);
    StageQpSolver solver(qp.capacity());
    Iterate by_sets(qp.capacity()), by_interior(qp.capacity());
    solver.guess_from(qp, by_sets);
    if (solver.solve(qp, by_sets) != StageQpSolver::Outcome::active_set) continue;
    if (solver.solve_by_interior_point(qp, by_interior) == StageQpSolver::Outcome::infeasible) {
      ADD_FAILURE() << "trial " << trial << ": the interior-point method failed on a feasible program";
      continue;
    }
    ++compared;
    for (int i = 0; i <= qp.intervals(); ++i)
      for (int j = 0; j < qp.states(i); ++j) ASSERT_NEAR(by_sets.state(i)[j], by_interior.state(i)[j], 1e-7);
  }
  EXPECT_GT(compared, 80);
}

TEST(StageQpSolver, StartsFromTheMultipliersOfAPoint) {
  RandomQp random(14);
  int with_states = 0;
  for (int trial = 0; trial < 200; ++trial) {
    StageQp qp = feasible_qp(random, trial % 2 == 0, 0.8);
    StageQpSolver solver(qp.capacity());
    Iterate solution(qp.capacity()), step(qp.capacity());
    solver.guess_from(qp, solution);
    if (solver.solve(qp, solution) != StageQpSolver::Outcome::active_set) continue;
    solver.guess_from(qp, solution);
    solver.prepare(qp);
    ASSERT_EQ(solver.solve(qp, step), StageQpSolver::Outcome::active_set) << "trial " << trial;
    EXPECT_EQ(solver.factorisations(), 1) << "trial " << trial;
    ASSERT_LT(kkt_violation(qp, step), 1e-7) << "trial " << trial;
    // Multipliers that claim too much, too little, or the other side.
    Iterate wrong = solution;
    int states = 0;
    for (int i = 1; i <= qp.intervals(); ++i) {
      for (int j = 0; j < qp.states(i); ++j) {
        states += solution.state_bound(i)[j] != 0.0;
        if (random.uniform(0.0, 1.0) < 0.1) wrong.state_bound(i)[j] = random.uniform(-1.0, 1.0);
      }
      for (int j = 0; j < qp.controls(i); ++j)
        if (random.uniform(0.0, 1.0) < 0.3) wrong.control_bound(i)[j] = random.uniform(-1.0, 1.0);
    }
    with_states += states > 0;
    solver.guess_from(qp, wrong);
    solver.prepare(qp);
    ASSERT_NE(solver.solve(qp, step), StageQpSolver::Outcome::infeasible) << "trial " << trial;
    ASSERT_LT(kkt_violation(qp, step), 1e-7) << "trial " << trial;
  }
  EXPECT_GT(with_states, 60);
}

TEST(StageQpSolver, SeesThatAHeldBoundHasPassedTheOtherOne) {
  RandomQp random(15);
  int seen = 0;
  for (int trial = 0; trial < 300; ++trial) {
    StageQp qp = feasible_qp(random, false, 0.8);
    StageQpSolver solver(qp.capacity());
    Iterate solution(qp.capacity()), step(qp.capacity());
    solver.guess_from(qp, solution);
    if (solver.solve(qp, solution) != StageQpSolver::Outcome::active_set) continue;
    // With few state bounds the set is held in the factorisation, whose solution is at the bound, whatever the other
    // is.
    int held = 0;
    double *lower = nullptr, *upper = nullptr;
    for (int i = 0; i <= qp.intervals(); ++i)
      for (int j = 0; j < qp.states(i); ++j) {
        if (solution.state_bound(i)[j] == 0.0) continue;
        ++held;
        lower = qp.state_lower(i) + j;
        upper = qp.state_upper(i) + j;
      }
    if (held != 1 || !std::isfinite(*upper - *lower)) continue;
    ++seen;
    solver.guess_from(qp, solution);
    solver.prepare(qp);
    std::swap(*lower, *upper);
    EXPECT_EQ(solver.solve(qp, step), StageQpSolver::Outcome::infeasible) << "trial " << trial;
    // And back again, it is solved by the same factorisation.
    std::swap(*lower, *upper);
    solver.guess_from(qp, solution);
    solver.prepare(qp);
    EXPECT_EQ(solver.solve(qp, step), StageQpSolver::Outcome::active_set) << "trial " << trial;
    EXPECT_EQ(solver.factorisations(), 1) << "trial " << trial;
  }
  EXPECT_GT(seen, 30);
}

TEST(StageQpSolver, SaysSoWhenTheBoundsCannotBeSatisfied) {
  RandomQp random(13);
  for (int trial = 0; trial < 20; ++trial) {
    StageQp qp = bounded_qp(random, true, 0.5);
    const int N = qp.intervals();
    qp.state_lower(N)[0] = 50.0;
    qp.state_upper(N)[0] = 60.0;
    StageQpSolver solver(qp.capacity());
    Iterate step(qp.capacity());
    solver.guess_from(qp, step);
    EXPECT_EQ(solver.solve(qp, step), StageQpSolver::Outcome::infeasible) << "trial " << trial;
    // And the next QP is solved as if nothing had happened.
    StageQp good = bounded_qp(random, true, 1.0);
    StageQpSolver fresh(good.capacity());
    Iterate answer(good.capacity());
    fresh.guess_from(good, answer);
    EXPECT_NE(fresh.solve(good, answer), StageQpSolver::Outcome::infeasible);
  }
}

}  // namespace stage_qp_solver_test
}  // namespace rhec::gn_rti
