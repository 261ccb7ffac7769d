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

}  // namespace augmented_limits_test
}  // namespace rhec
