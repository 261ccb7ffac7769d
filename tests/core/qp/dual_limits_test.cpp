#include <algorithm>
#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include "rhec/core/qp/kkt.hpp"
#include "rhec/core/qp/stage_qp_solver.hpp"
#include "support/active_set_attempt.hpp"

namespace rhec {
namespace dual_limits_test {

using namespace rhec::testing;

constexpr double infinity = std::numeric_limits<double>::infinity();

struct Count {
  int solved = 0, by_sets = 0, infeasible = 0, active = 0, violated = 0;
};

Count solve_family(unsigned seed, int trials, const LimitFamily& family) {
  RandomQp random(seed);
  Count count;
  for (int trial = 0; trial < trials; ++trial) {
    const StageQp qp = limited_qp(random, trial % 2 == 0, family);
    StageQpSolver solver(qp.capacity());
    Iterate step(qp.capacity());
    solver.guess_from(qp, step);
    const auto outcome = solver.solve(qp, step);
    if (outcome == StageQpSolver::Outcome::infeasible) {
      ++count.infeasible;
      continue;
    }
    ++count.solved;
    count.by_sets += outcome == StageQpSolver::Outcome::active_set;
    EXPECT_LT(kkt_violation(qp, step), 1e-6) << "trial " << trial << ", outcome " << static_cast<int>(outcome);
    for (int i = 0; i <= qp.intervals(); ++i)
      for (int r = 0; r < qp.limits(i); ++r) {
        const double size = std::abs(step.limit_bound(i)[r]);
        count.active += size > 0.0;
        count.violated += size > 0.0 && size >= qp.limit_linear(i)[r];
      }
    // The solution's own multipliers lead back to it at once.
    Iterate again(qp.capacity());
    solver.guess_from(qp, step);
    solver.prepare(qp);
    EXPECT_NE(solver.solve(qp, again), StageQpSolver::Outcome::infeasible) << "trial " << trial;
    EXPECT_LT(kkt_violation(qp, again), 1e-6) << "trial " << trial << ", warm";
    EXPECT_LT(distance(qp, step, again), 1e-5) << "trial " << trial;
  }
  return count;
}

TEST(DualLimits, SolvesHardLimits) {
  const Count count = solve_family(31, 300, {.room = 0.5});
  EXPECT_GT(count.by_sets, 270);
  EXPECT_LT(count.infeasible, 3);
  EXPECT_GT(count.active, 800);
}

TEST(DualLimits, SolvesSoftLimits) {
  const Count count = solve_family(32, 300, {.room = 0.5, .soft = 1.0});
  EXPECT_GT(count.by_sets, 270);
  EXPECT_EQ(count.infeasible, 0);
  EXPECT_GT(count.violated, 1000);
}

TEST(DualLimits, SolvesHardAndSoftLimitsThatDependOnEachOther) {
  const Count count = solve_family(33, 300, {.room = 0.4, .soft = 0.5, .equalities = 0.1, .dependent = 0.3});
  EXPECT_GT(count.by_sets, 250);
  EXPECT_GT(count.active, 1000);
}

TEST(DualLimits, SolvesWithRowsThatChangeAfterThePreparation) {
  RandomQp random(34);
  int active = 0;
  for (int trial = 0; trial < 100; ++trial) {
    StageQp qp = limited_qp(random, trial % 2 == 0, {.room = 0.5, .soft = 0.5});
    StageQpSolver solver(qp.capacity());
    Iterate step(qp.capacity());
    solver.guess_from(qp, step);
    if (solver.solve(qp, step) == StageQpSolver::Outcome::infeasible) continue;
    // Twice: the second time the solver expects the change.
    for (int sample = 0; sample < 2; ++sample) {
      solver.guess_from(qp, step);
      solver.prepare(qp);
      for (int i = 0; i <= qp.intervals(); ++i)
        for (int k = 0; k < qp.limits(i) * qp.stride(); ++k) qp.G(i)[k] *= k % 3 == 0 ? 0.9 : 1.05;
      if (solver.solve(qp, step) == StageQpSolver::Outcome::infeasible) break;
      EXPECT_LT(kkt_violation(qp, step), 1e-6) << "trial " << trial << ", sample " << sample;
      for (int i = 0; i <= qp.intervals(); ++i)
        for (int r = 0; r < qp.limits(i); ++r) active += step.limit_bound(i)[r] != 0.0;
    }
  }
  EXPECT_GT(active, 500);
}

TEST(DualLimits, DropsAFewWrongClaimsWithoutAnotherFactorisation) {
  RandomQp random(37);
  int wrong = 0, tried = 0;
  for (int trial = 0; trial < 200; ++trial) {
    const StageQp qp = limited_qp(random, true, {.room = 0.5});
    StageQpSolver solver(qp.capacity());
    Iterate step(qp.capacity()), again(qp.capacity());
    solver.guess_from(qp, step);
    if (solver.solve(qp, step) != StageQpSolver::Outcome::active_set) continue;
    int columns = 0, controls = 0;
    for (int i = 0; i <= qp.intervals(); ++i) {
      for (int r = 0; r < qp.limits(i); ++r) columns += step.limit_bound(i)[r] != 0.0;
      for (int j = 0; j < qp.states(i); ++j) columns += step.state_bound(i)[j] != 0.0;
      for (int j = 0; j < qp.controls(i); ++j) controls += step.control_bound(i)[j] != 0.0;
    }
    if (columns == 0 || columns >= 8 || columns + controls > 15) continue;
    Iterate claim = step;
    for (int i = 0; i < qp.intervals(); ++i) {
      for (int j = 0; j < qp.controls(i) && columns + controls < 16; ++j) {
        const double upper = qp.control_upper(i)[j];
        if (claim.control_bound(i)[j] != 0.0 || upper == infinity) continue;
        claim.control_bound(i)[j] = 1.0;
        ++controls;
        ++wrong;
      }
    }
    solver.guess_from(qp, claim);
    solver.prepare(qp);
    ASSERT_EQ(solver.solve(qp, again), StageQpSolver::Outcome::active_set) << trial;
    EXPECT_EQ(solver.factorisations(), 1) << trial;
    EXPECT_LT(kkt_violation(qp, again), 1e-6) << trial;
    EXPECT_LT(distance(qp, step, again), 1e-5) << trial;
    ++tried;
  }
  EXPECT_GT(tried, 50);
  EXPECT_GT(wrong, 200);
}

TEST(DualLimits, CorrectRoundingBySensitivitiesWhereEachQpHasToBeCheap) {
  // Large gradients, so that the minimiser is far away until all that holds it is found.
  constexpr double size = 1e4;
  RandomQp random(36);
  int corrected = 0;
  for (int trial = 0; trial < 300; ++trial) {
    StageQp qp = limited_qp(random, trial % 2 == 0, {.room = 0.5});
    for (int i = 0; i <= qp.intervals(); ++i)
      for (int j = 0; j < qp.stride(); ++j) qp.h(i)[j] *= size;
    StageQpSolver exact(qp.capacity()), cheap(qp.capacity());
    cheap.set_cheap(true);
    Iterate step(qp.capacity()), other(qp.capacity());
    exact.guess_from(qp, step);
    cheap.guess_from(qp, other);
    const auto outcome = exact.solve(qp, step);
    EXPECT_EQ(cheap.solve(qp, other), outcome);
    if (outcome != StageQpSolver::Outcome::active_set) continue;
    bool differs = false;
    for (int i = 0; i <= qp.intervals(); ++i)
      for (int j = 0; j < qp.stride(); ++j) differs |= step.row(i)[j] != other.row(i)[j];
    corrected += differs;
    EXPECT_LT(distance(qp, step, other), 1e-9 * size) << trial;
    EXPECT_LT(kkt_violation(qp, other), 1e-7 * size + 10.0 * kkt_violation(qp, step)) << trial;
    // Bounds and limits are met as well as by the other.
    for (int i = 0; i <= qp.intervals(); ++i) {
      for (int j = 0; i < qp.intervals() && j < qp.controls(i); ++j) {
        EXPECT_GE(other.control(i)[j], qp.control_lower(i)[j] - 1e-9);
        EXPECT_LE(other.control(i)[j], qp.control_upper(i)[j] + 1e-9);
      }
      for (int r = 0; r < qp.limits(i); ++r) {
        double value = 0.0;
        for (int j = 0; j < qp.stride(); ++j) value += qp.G(i)[r * qp.stride() + j] * other.row(i)[j];
        EXPECT_GE(value, qp.limit_lower(i)[r] - 1e-9) << trial;
        EXPECT_LE(value, qp.limit_upper(i)[r] + 1e-9) << trial;
      }
    }
  }
  EXPECT_GT(corrected, 5);
}

TEST(DualLimits, AcceptWhatRoundingLeaves) {
  // Only the last control is cheap enough to bring a state of some millions to zero, to which numbers of that size do
  // not add up by less than a few 1e-10.
  constexpr int N = 4;
  StageQp qp(Capacity{N, 1, 1, 1});
  qp.set_intervals(N);
  qp.initial_state_is_given = true;
  for (int i = 0; i <= N; ++i) {
    qp.set_sizes(i, 1, i < N ? 1 : 0);
    qp.set_limits(i, i < N ? 0 : 1);
    qp.state_lower(i)[0] = -infinity;
    qp.state_upper(i)[0] = infinity;
    if (i == N) continue;
    qp.control_lower(i)[0] = -infinity;
    qp.control_upper(i)[0] = infinity;
    qp.AB(i)[0] = 113.0;
    qp.AB(i)[1] = 1.0;
    qp.H(i)[qp.stride() + 1] = i + 1 < N ? 1e12 : 1.0;
  }
  qp.G(N)[0] = 1.0;
  qp.limit_lower(N)[0] = -infinity;
  qp.limit_upper(N)[0] = 0.0;
  qp.limit_linear(N)[0] = infinity;
  double largest = 0.0;
  for (int trial = 0; trial < 100; ++trial) {
    qp.b(0)[0] = 1.0 + 0.004 * trial;
    StageQpSolver solver(qp.capacity());
    Iterate step(qp.capacity());
    solver.guess_from(qp, step);
    EXPECT_EQ(solver.solve(qp, step), StageQpSolver::Outcome::active_set) << "trial " << trial;
    EXPECT_NEAR(step.state(N)[0], 0.0, 1e-9) << "trial " << trial;
    EXPECT_NEAR(step.limit_bound(N)[0], -step.control(N - 1)[0], 1e-3);
    largest = std::max(largest, std::abs(step.state(N)[0]));
  }
  EXPECT_GT(largest, 1e-10) << "beyond the tolerance for violations";
}

}  // namespace dual_limits_test
}  // namespace rhec
