#include "rhec/core/qp/dual_active_set.hpp"

#include <gtest/gtest.h>

#include "rhec/core/qp/stage_qp_solver.hpp"
#include "rhec/core/qp/stage_qp_views.hpp"
#include "support/active_set_attempt.hpp"

namespace rhec {
namespace dual_active_set_test {

using namespace rhec::testing;

constexpr double infinity = std::numeric_limits<double>::infinity();

TEST(DualActiveSet, AgreesWithTheInteriorPointMethodWhereManyBoundsAreActive) {
  RandomQp random(21);
  int solved = 0, compared = 0, active_bounds = 0;
  constexpr int trials = 300;
  for (int trial = 0; trial < trials; ++trial) {
    StageQp qp = feasible_qp(random, trial % 2 == 0, trial % 3 == 0 ? 0.1 : 0.5);
    const Attempt attempt(qp, nullptr);
    if (attempt.outcome != DualActiveSet::Outcome::solved) continue;
    ++solved;
    active_bounds += count_active(qp, attempt.active);
    ASSERT_LT(kkt_violation(qp, attempt.step), 1e-8) << "trial " << trial;
    StageQpSolver other(qp.capacity());
    Iterate expected(qp.capacity());
    // If the feasible set has almost no interior, the interior-point method may fail.
    if (other.solve_by_interior_point(qp, expected) == StageQpSolver::Outcome::infeasible) continue;
    ++compared;
    ASSERT_LT(distance(qp, attempt.step, expected), 1e-6) << "trial " << trial;
  }
  // The rest has more active bounds, or changes of the active set, than the method provides for.
  EXPECT_GT(solved, trials * 9 / 10);
  EXPECT_GT(compared, trials * 8 / 10);
  EXPECT_GT(active_bounds, 8 * solved);
}

TEST(DualActiveSet, ComesToTheSameSolutionFromAnyClaim) {
  RandomQp random(22);
  int compared = 0;
  for (int trial = 0; trial < 200; ++trial) {
    const StageQp qp = feasible_qp(random, trial % 2 == 0, 0.4);
    const Attempt cold(qp, nullptr);
    if (cold.outcome != DualActiveSet::Outcome::solved) continue;
    ActiveSet claimed(qp.capacity());
    const double share = random.uniform(0.0, 0.5);
    for (int i = 0; i <= qp.intervals(); ++i) {
      const auto claim = [&](std::int8_t& side, std::int8_t right, double lower, double upper) {
        side = right;
        if (random.uniform(0.0, 1.0) > share) return;
        side = static_cast<std::int8_t>(random.integer(-1, 1));
        if (!std::isfinite(side < 0 ? lower : upper)) side = 0;
      };
      if (i > 0 || !qp.initial_state_is_given)
        for (int j = 0; j < qp.states(i); ++j)
          claim(claimed.state(i)[j], cold.active.state(i)[j], qp.state_lower(i)[j], qp.state_upper(i)[j]);
      for (int j = 0; j < qp.controls(i); ++j)
        claim(claimed.control(i)[j], cold.active.control(i)[j], qp.control_lower(i)[j], qp.control_upper(i)[j]);
    }
    const Attempt warm(qp, &claimed);
    if (warm.outcome == DualActiveSet::Outcome::too_much) continue;
    ASSERT_EQ(warm.outcome, DualActiveSet::Outcome::solved) << "trial " << trial;
    ++compared;
    ASSERT_LT(kkt_violation(qp, warm.step), 1e-8) << "trial " << trial;
    ASSERT_LT(distance(qp, warm.step, cold.step), 1e-8) << "trial " << trial;
    // With the right initial active set, one factorisation suffices.
    const Attempt again(qp, &cold.active);
    ASSERT_EQ(again.outcome, DualActiveSet::Outcome::solved) << "trial " << trial;
    EXPECT_EQ(again.method.factorisations(), 1);
    EXPECT_TRUE(again.active == cold.active) << "trial " << trial;
    ASSERT_LT(distance(qp, again.step, cold.step), 1e-8) << "trial " << trial;
  }
  EXPECT_GT(compared, 160);
}

TEST(DualActiveSet, GivesThePolicyOfItsSolution) {
  RandomQp random(24);
  int compared = 0;
  for (int trial = 0; trial < 60; ++trial) {
    const StageQp qp = feasible_qp(random, true, 0.8);
    const Attempt cold(qp, nullptr);
    if (cold.outcome != DualActiveSet::Outcome::solved) continue;
    Attempt warm(qp, &cold.active);
    ASSERT_EQ(warm.outcome, DualActiveSet::Outcome::solved);
    warm.method.complete_policy(qp, warm.riccati);
    for (int i = 0; i < qp.intervals(); ++i) {
      Eigen::VectorXd control(qp.controls(i));
      warm.riccati.feedback(qp, i, warm.step.state(i), control.data());
      for (int j = 0; j < qp.controls(i); ++j) ASSERT_NEAR(control[j], warm.step.control(i)[j], 1e-9);
    }
    ++compared;
  }
  EXPECT_GT(compared, 50);
}

TEST(DualActiveSet, SeesThatBoundsContradictEachOther) {
  RandomQp random(25);
  int seen = 0;
  for (int trial = 0; trial < 60; ++trial) {
    StageQp qp = feasible_qp(random, true, 0.5);
    // Bounded controls cannot reach that far.
    for (int i = 0; i < qp.intervals(); ++i)
      for (int j = 0; j < qp.controls(i); ++j) qp.control_lower(i)[j] = -1.0, qp.control_upper(i)[j] = 1.0;
    qp.state_lower(qp.intervals())[0] = 50.0;
    qp.state_upper(qp.intervals())[0] = infinity;
    const Attempt attempt(qp, nullptr);
    EXPECT_NE(attempt.outcome, DualActiveSet::Outcome::solved) << "trial " << trial;
    seen += attempt.outcome == DualActiveSet::Outcome::no_solution;
  }
  EXPECT_GT(seen, 40);
}

TEST(DualActiveSet, StopsAtTheDeadline) {
  StageQp qp = integrator(10, 20.0);
  for (int i = 0; i < 10; ++i) qp.control_upper(i)[0] = 0.5;
  const Attempt late(qp, nullptr, Clock::now() - std::chrono::hours(1));
  EXPECT_EQ(late.outcome, DualActiveSet::Outcome::out_of_time);
  // What needs no change is done in any case.
  qp = integrator(10, 20.0);
  const Attempt free_of_bounds(qp, nullptr, Clock::now() - std::chrono::hours(1));
  EXPECT_EQ(free_of_bounds.outcome, DualActiveSet::Outcome::solved);
}

TEST(DualActiveSet, LeavesWhatIsNotConvexToConvexification) {
  RandomQp random(26);
  int bent = 0;
  for (int trial = 0; trial < 100; ++trial) {
    StageQp qp = feasible_qp(random, true, 0.5);
    for (int i = 0; i < qp.intervals(); ++i)
      for (int j = 0; j < qp.controls(i); ++j) R_of(qp, i)(j, j) -= random.uniform(0.0, 2.0);
    if (Attempt(qp, nullptr).outcome != DualActiveSet::Outcome::not_convex) continue;
    StageQpSolver solver(qp.capacity());
    Iterate step(qp.capacity());
    solver.guess_from(qp, step);
    ASSERT_NE(solver.solve(qp, step), StageQpSolver::Outcome::infeasible) << "trial " << trial;
    ASSERT_TRUE(solver.was_convexified());
    // The multipliers belong to the QP as it was bent; the bounds are those that were given.
    for (int i = 0; i <= qp.intervals(); ++i) {
      for (int j = 0; i > 0 && j < qp.states(i); ++j) {
        ASSERT_GT(step.state(i)[j], qp.state_lower(i)[j] - 1e-8);
        ASSERT_LT(step.state(i)[j], qp.state_upper(i)[j] + 1e-8);
      }
    }
    ++bent;
  }
  EXPECT_GT(bent, 50);
}

TEST(DualActiveSet, FollowsBoundsThatAreNoLongerThere) {
  StageQp qp = integrator(6, 5.0);
  for (int i = 0; i < 6; ++i) qp.control_upper(i)[0] = 0.5;
  qp.state_upper(3)[0] = 1.0;
  ActiveSet claimed(qp.capacity());
  claimed.control(0)[0] = claimed.control(1)[0] = claimed.state(3)[0] = 1;
  Riccati riccati(qp.capacity());
  DualActiveSet method(qp.capacity());
  method.prepare(qp, riccati, &claimed);
  qp.control_upper(1)[0] = qp.state_upper(3)[0] = infinity;
  Iterate step(qp.capacity());
  ASSERT_EQ(method.solve(qp, riccati, claimed, step, never), DualActiveSet::Outcome::solved);
  EXPECT_EQ(claimed.control(1)[0], 0);
  EXPECT_LT(kkt_violation(qp, step), 1e-9);
}

}  // namespace dual_active_set_test
}  // namespace rhec
