#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include "rhec/core/qp/stage_qp_solver.hpp"
#include "support/active_set_attempt.hpp"

namespace rhec {
namespace augmented_limits_test {

using namespace rhec::testing;

struct Count {
  int bent = 0, exact = 0, convexified = 0;
};

/// Takes curvature away across the limits that are active in a convex QP's solution, by which it remains a strict
/// minimiser with the same multipliers, and solves from these.
Count solve_bent(unsigned seed, int trials, double curvature, const LimitFamily& family) {
  RandomQp random(seed);
  Count count;
  for (int trial = 0; trial < trials; ++trial) {
    StageQp qp = limited_qp(random, trial % 2 == 0, family);
    StageQpSolver solver(qp.capacity());
    Iterate solution(qp.capacity()), step(qp.capacity());
    solver.guess_from(qp, solution);
    if (solver.solve(qp, solution) == StageQpSolver::Outcome::infeasible) continue;
    int active = 0;
    for (int i = 0; i <= qp.intervals(); ++i) {
      for (int r = 0; r < qp.limits(i); ++r) {
        const double multiplier = solution.limit_bound(i)[r], size = std::abs(multiplier);
        const bool is_violated = size >= qp.limit_linear(i)[r];
        if (size < 1e-3 || (is_violated && qp.limit_quadratic(i)[r] == 0.0)) continue;
        // Of a violated limit, less than its slack costs.
        const double taken = is_violated ? 0.5 * qp.limit_quadratic(i)[r] : curvature;
        const double* row = qp.G(i) + r * qp.stride();
        double value = 0.0;
        for (int j = 0; j < qp.stride(); ++j) value += row[j] * solution.row(i)[j];
        for (int j = 0; j < qp.stride(); ++j) {
          qp.h(i)[j] += taken * value * row[j];
          for (int k = 0; k < qp.stride() && row[j] != 0.0; ++k)
            qp.H(i)[j * qp.stride() + k] -= taken * row[j] * row[k];
        }
        ++active;
      }
    }
    if (active == 0) continue;
    Riccati riccati(qp.capacity());
    riccati.factor(qp, ActiveSet(qp.capacity()));
    if (!riccati.was_convexified()) continue;
    ++count.bent;
    solver.guess_from(qp, solution);
    solver.prepare(qp);
    EXPECT_NE(solver.solve(qp, step), StageQpSolver::Outcome::infeasible) << "trial " << trial;
    if (solver.was_convexified()) {
      ++count.convexified;
      continue;
    }
    EXPECT_LT(kkt_violation(qp, step), 1e-6) << "trial " << trial;
    count.exact += distance(qp, step, solution) < 1e-6;
  }
  return count;
}

TEST(AugmentedLimits, HardOnesMakeUpForNegativeCurvature) {
  const Count count = solve_bent(41, 300, 30.0, {.room = 0.5});
  EXPECT_GT(count.bent, 200);
  EXPECT_GT(count.exact, 0.9 * count.bent);
}

TEST(AugmentedLimits, SoftOnesDoByTheirQuadraticWeight) {
  const Count count = solve_bent(42, 300, 30.0, {.room = 0.5, .soft = 0.7});
  EXPECT_GT(count.bent, 200);
  EXPECT_GT(count.exact, 0.9 * count.bent);
}

TEST(AugmentedLimits, StandBesideBoundsOfStates) {
  const Count count = solve_bent(43, 300, 30.0, {.room = 0.5, .has_state_bounds = true});
  EXPECT_GT(count.bent, 150);
  EXPECT_GT(count.exact, 0.9 * count.bent);
}

TEST(AugmentedLimits, WaitForASecondQpWhereEachHasToBeCheap) {
  constexpr double infinity = std::numeric_limits<double>::infinity();
  // Of x and u = 0, the objective 1/2 x^2 - 1/2 u^2 + 4 u with u >= -1 as a limit has a minimiser only on the limit.
  StageQp qp(Capacity{1, 1, 1, 1});
  qp.set_intervals(1);
  qp.initial_state_is_given = true;
  qp.set_sizes(0, 1, 1);
  qp.set_sizes(1, 1, 0);
  qp.set_limits(0, 1);
  qp.AB(0)[0] = 1.0;
  qp.control_lower(0)[0] = -infinity;
  qp.control_upper(0)[0] = infinity;
  qp.H(0)[0] = qp.H(1)[0] = 1.0;
  qp.H(0)[qp.stride() + 1] = -1.0;
  qp.h(0)[1] = 4.0;
  qp.G(0)[1] = 1.0;
  qp.limit_lower(0)[0] = -1.0;
  qp.limit_upper(0)[0] = infinity;
  qp.limit_linear(0)[0] = infinity;
  Iterate claim(qp.capacity()), step(qp.capacity());
  claim.limit_bound(0)[0] = -5.0;
  for (const bool is_cheap : {false, true}) {
    StageQpSolver solver(qp.capacity());
    solver.set_cheap(is_cheap);
    for (int sample = 0; sample < 20; ++sample) {
      solver.guess_from(qp, claim);
      solver.prepare(qp);
      ASSERT_EQ(solver.solve(qp, step), StageQpSolver::Outcome::active_set);
      EXPECT_EQ(solver.was_convexified(), is_cheap && sample < 16) << sample;
      EXPECT_NEAR(step.control(0)[0], -1.0, 1e-9);
    }
    EXPECT_NEAR(step.limit_bound(0)[0], -5.0, 1e-9);
  }
}

/// Of x and u, with u_0 >= -1 as a limit and |u_1| <= 1: 1/2 x^2 + 1/2 u_0^2 + 4 u_0 + 1/2 curvature u_1^2 + pull u_1.
StageQp two_controls(double curvature, double pull) {
  constexpr double infinity = std::numeric_limits<double>::infinity();
  StageQp qp(Capacity{1, 1, 2, 1});
  qp.set_intervals(1);
  qp.initial_state_is_given = true;
  qp.set_sizes(0, 1, 2);
  qp.set_sizes(1, 1, 0);
  qp.set_limits(0, 1);
  qp.AB(0)[0] = 1.0;
  qp.control_lower(0)[0] = -infinity;
  qp.control_upper(0)[0] = infinity;
  qp.control_lower(0)[1] = -1.0;
  qp.control_upper(0)[1] = 1.0;
  qp.H(0)[0] = qp.H(1)[0] = qp.H(0)[qp.stride() + 1] = 1.0;
  qp.H(0)[2 * qp.stride() + 2] = curvature;
  qp.h(0)[1] = 4.0;
  qp.h(0)[2] = pull;
  qp.G(0)[1] = 1.0;
  qp.limit_lower(0)[0] = -1.0;
  qp.limit_upper(0)[0] = infinity;
  qp.limit_linear(0)[0] = infinity;
  return qp;
}

TEST(AugmentedLimits, GiveWayToConvexificationWhereTheyHaveFailed) {
  // The limit does not help u_1.
  const StageQp bent = two_controls(-1.0, 0.5), convex = two_controls(1.0, 0.5);
  Iterate claim(bent.capacity()), step(bent.capacity());
  claim.limit_bound(0)[0] = -3.0;
  StageQpSolver solver(bent.capacity());
  solver.set_cheap(true);
  const auto factorisations = [&](const StageQp& qp) {
    solver.guess_from(qp, claim);
    solver.prepare(qp);
    EXPECT_EQ(solver.solve(qp, step), StageQpSolver::Outcome::active_set);
    EXPECT_NEAR(step.control(0)[0], -1.0, 1e-9);
    EXPECT_NEAR(step.control(0)[1], -0.5, 1e-9);
    EXPECT_EQ(solver.was_convexified(), &qp == &bent);
    return solver.factorisations();
  };
  // Of the first one it is seen that it is not convex, of one after many also that the limit does not make it so. What
  // is convexified is factorised with it.
  EXPECT_EQ(factorisations(bent), 2);
  for (const char* when : {"after many in a row it is tried", "now and then it is tried again"}) {
    for (int sample = 1; sample < 16; ++sample) EXPECT_EQ(factorisations(bent), 1) << sample;
    EXPECT_EQ(factorisations(bent), 3) << when;
  }
  EXPECT_EQ(factorisations(bent), 1);
  EXPECT_EQ(factorisations(convex), 1) << "which shows that it is convex";
  EXPECT_EQ(factorisations(convex), 1);
  // They have to be many in a row.
  EXPECT_EQ(factorisations(bent), 2);
  for (int sample = 1; sample < 16; ++sample) EXPECT_EQ(factorisations(bent), 1) << sample;
  EXPECT_EQ(factorisations(bent), 3);
}

TEST(AugmentedLimits, AreNotAskedForWhatIsConvexOnlyWithAllItsClaims) {
  const StageQp qp = two_controls(-1.0, -2.0);
  Iterate claim(qp.capacity()), step(qp.capacity());
  claim.limit_bound(0)[0] = -3.0;
  claim.control_bound(0)[1] = 3.0;
  for (const bool is_cheap : {false, true}) {
    StageQpSolver solver(qp.capacity());
    solver.set_cheap(is_cheap);
    solver.guess_from(qp, claim);
    solver.prepare(qp);
    ASSERT_EQ(solver.solve(qp, step), StageQpSolver::Outcome::active_set);
    EXPECT_EQ(solver.was_convexified(), is_cheap);
    EXPECT_NEAR(step.control(0)[0], -1.0, 1e-9);
    EXPECT_NEAR(step.control(0)[1], 1.0, 1e-9);
    EXPECT_NEAR(step.control_bound(0)[1], is_cheap ? 1.0 : 3.0, 1e-9);
  }
}

}  // namespace augmented_limits_test
}  // namespace rhec
