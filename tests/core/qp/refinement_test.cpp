#include <algorithm>
#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include "rhec/core/qp/kkt.hpp"
#include "rhec/core/qp/stage_qp_solver.hpp"
#include "support/active_set_attempt.hpp"
#include "support/qp_conditions.hpp"

namespace rhec {
namespace refinement_test {

using namespace rhec::testing;

constexpr double infinity = std::numeric_limits<double>::infinity();

/// Disturbs all multipliers and values by a share of their sizes.
void disturb(RandomQp& random, const StageQp& qp, double share, Iterate& step) {
  const auto each = [&](double* values, int count) {
    for (int j = 0; j < count; ++j) values[j] *= 1.0 + share * random.uniform(-1.0, 1.0);
  };
  for (int i = 0; i <= qp.intervals(); ++i) {
    if (i > 0 || !qp.initial_state_is_given) each(step.state(i), qp.states(i));
    each(step.costate(i), qp.states(i));
    each(step.state_bound(i), qp.states(i));
    each(step.limit_bound(i), qp.limits(i));
    each(step.control(i), qp.controls(i));
    each(step.control_bound(i), qp.controls(i));
  }
}

/// An unstable system over a long horizon that follows a sine, with limits of x, of 2 x (which depends on it) and of
/// x + u that are active at most nodes.
StageQp long_qp(int intervals, double growth, double linear) {
  StageQp qp(Capacity{intervals, 1, 1, 3});
  qp.set_intervals(intervals);
  qp.initial_state_is_given = true;
  for (int i = 0; i <= intervals; ++i) {
    const bool is_last = i == intervals;
    qp.set_sizes(i, 1, is_last ? 0 : 1);
    qp.set_limits(i, is_last ? 2 : 3);
    qp.H(i)[0] = 1.0;
    qp.q(i)[0] = -2.0 * std::sin(0.3 * i);
    qp.state_lower(i)[0] = -infinity;
    qp.state_upper(i)[0] = infinity;
    const double rows[3][2] = {{1.0, 0.0}, {2.0, 0.0}, {1.0, 1.0}}, sides[3] = {0.5, 1.0, 0.8};
    for (int r = 0; r < qp.limits(i); ++r) {
      for (int j = 0; j < (is_last ? 1 : 2); ++j) qp.G(i)[r * qp.stride() + j] = rows[r][j];
      qp.limit_lower(i)[r] = -sides[r];
      qp.limit_upper(i)[r] = sides[r];
      qp.limit_linear(i)[r] = linear;
      qp.limit_quadratic(i)[r] = 0.0;
    }
    if (is_last) break;
    qp.AB(i)[0] = growth;
    qp.AB(i)[1] = 0.2;
    qp.H(i)[qp.stride() + 1] = 0.1;
    qp.control_lower(i)[0] = -infinity;
    qp.control_upper(i)[0] = infinity;
  }
  return qp;
}

int active_limits(const StageQp& qp, const Iterate& step) {
  int count = 0;
  for (int i = 0; i <= qp.intervals(); ++i)
    count += static_cast<int>(
        std::count_if(step.limit_bound(i), step.limit_bound(i) + qp.limits(i), [](double m) { return m != 0.0; }));
  return count;
}

TEST(Refinement, TakesDisturbancesFromSolutions) {
  RandomQp random(51);
  int disturbed = 0, refined = 0;
  for (int trial = 0; trial < 200; ++trial) {
    const StageQp qp =
        limited_qp(random, trial % 2 == 0,
                   {.room = 0.5, .soft = 0.4, .equalities = 0.1, .dependent = 0.2, .has_state_bounds = trial % 3 == 0});
    StageQpSolver solver(qp.capacity());
    Iterate solution(qp.capacity());
    solver.guess_from(qp, solution);
    if (solver.solve(qp, solution) == StageQpSolver::Outcome::infeasible) continue;
    ++disturbed;
    Iterate step = solution;
    disturb(random, qp, 1e-3, step);
    const double before = kkt_violation(qp, step);
    const double residual = solver.refine(qp, step, 1e-10);
    EXPECT_LE(kkt_violation(qp, step), std::max(before, 1e-6)) << "trial " << trial;
    if (residual > 1e-9) continue;
    ++refined;
    EXPECT_LT(kkt_violation(qp, step), 1e-6) << "trial " << trial;
    EXPECT_LT(distance(qp, step, solution), 1e-6) << "trial " << trial;
  }
  EXPECT_GT(disturbed, 100);
  EXPECT_GT(refined, 0.9 * disturbed);
}

TEST(Refinement, SolvesWhatHasMoreActiveLimitsThanTheDualMethodHasRoomFor) {
  for (const double linear : {infinity, 3.0}) {
    const StageQp qp = long_qp(120, 1.3, linear);
    StageQpSolver solver(qp.capacity());
    Iterate step(qp.capacity());
    solver.guess_from(qp, step);
    ASSERT_EQ(solver.solve(qp, step), StageQpSolver::Outcome::interior_point);
    EXPECT_GT(active_limits(qp, step), 96);
    // Nothing is left to be done.
    Iterate again = step;
    EXPECT_LE(solver.refine(qp, again, 1e-8), 1e-8);
    EXPECT_EQ(distance(qp, again, step), 0.0);
  }
}

TEST(Refinement, ItsPolicyLeadsToTheSolution) {
  const StageQp qp = long_qp(120, 1.3, infinity);
  StageQpSolver solver(qp.capacity());
  Iterate step(qp.capacity());
  solver.guess_from(qp, step);
  ASSERT_EQ(solver.solve(qp, step), StageQpSolver::Outcome::interior_point);
  solver.prepare_feedback(qp);
  double state = 0.0, control = 0.0;
  for (int i = 0; i < qp.intervals(); ++i) {
    solver.feedback(qp, i, &state, &control);
    EXPECT_NEAR(control, step.control(i)[0], 1e-6) << "interval " << i;
    state = qp.AB(i)[0] * state + qp.AB(i)[1] * control;
    EXPECT_NEAR(state, step.state(i + 1)[0], 1e-6) << "interval " << i;
  }
}

TEST(Refinement, LeavesStepsOfQpsThatItCannotRefine) {
  // Without limits.
  RandomQp random(52);
  const StageQp without = random.make(5, 2, 1, true);
  StageQpSolver solver(without.capacity());
  Iterate step(without.capacity());
  EXPECT_EQ(solver.refine(without, step, 1e-8), infinity);
  // Not convex, even with its active limits.
  StageQp qp = long_qp(5, 1.0, infinity);
  for (int i = 0; i < qp.intervals(); ++i) qp.H(i)[qp.stride() + 1] = -10.0;
  StageQpSolver other(qp.capacity());
  Iterate zero(qp.capacity()), before = zero;
  other.refine(qp, zero, 1e-8);
  EXPECT_EQ(distance(qp, zero, before), 0.0);
}

}  // namespace refinement_test
}  // namespace rhec
