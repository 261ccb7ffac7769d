#include "solvers/sparse_sqp/sparse_qp.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <cstdio>

#include "test_qps.hpp"

namespace rhec::sparse_sqp {
namespace sparse_qp_test {

using namespace testing;

constexpr auto no_deadline = Clock::time_point::max();

struct QpSolution {
  Eigen::VectorXd step, multipliers, bounds;
  SparseQp::Outcome outcome = SparseQp::Outcome::failed;

  /// What is left of the optimality conditions; with a penalty, of the QP with relaxed equations.
  double residual(const TestQp& test) const {
    double worst = (test.H * step + test.g() + test.J.transpose() * multipliers + bounds).lpNorm<Eigen::Infinity>();
    worst = std::max(worst, (test.J * step + test.c()).lpNorm<Eigen::Infinity>());
    for (int k = 0; k < test.n; ++k) {
      worst = std::max({worst, test.lower[k] - step[k], step[k] - test.upper[k]});
      if (bounds[k] > 0.0) worst = std::max(worst, bounds[k] * (test.upper[k] - step[k]));
      if (bounds[k] < 0.0) worst = std::max(worst, -bounds[k] * (step[k] - test.lower[k]));
    }
    return worst;
  }
};
QpSolution start_of(const TestQp& test) {
  return {Eigen::VectorXd::Zero(test.n), Eigen::VectorXd::Zero(test.m), Eigen::VectorXd::Zero(test.n)};
}
QpSolution solve(SparseQp& qp, const TestQp& test, bool is_convex = true) {
  QpSolution solution = start_of(test);
  qp.take_structure(test.nlp);
  solution.outcome = qp.solve(test.view(is_convex), solution.step.data(), solution.multipliers.data(),
                              solution.bounds.data(), no_deadline);
  return solution;
}

/// Bounds about zero, on controls and on states.
void bound(StageQp& qp, RandomQp& random, double controls, double states) {
  for (int i = 0; i <= qp.intervals(); ++i) {
    for (int j = 0; j < qp.controls(i); ++j) {
      qp.control_lower(i)[j] = -random.uniform(0.1, 1.0) * controls;
      qp.control_upper(i)[j] = random.uniform(0.1, 1.0) * controls;
    }
    for (int j = 0; j < qp.states(i); ++j) {
      qp.state_lower(i)[j] = -states;
      qp.state_upper(i)[j] = states;
    }
    for (int j = 0; i < qp.intervals() && j < qp.states(i + 1); ++j) qp.b(i)[j] *= 0.3;
  }
}

TEST(SparseQp, SolvesRandomQpsToTheirOptimalityConditions) {
  RandomQp random(6);
  SparseQp qp;
  int active = 0, by_interior_point = 0;
  for (int trial = 0; trial < 150; ++trial) {
    StageQp stages = random_stages(random);
    bound(stages, random, std::pow(10.0, random.uniform(-1.0, 0.5)), 4.0);
    const TestQp test(stages);
    const QpSolution solution = solve(qp, test);
    ASSERT_EQ(solution.outcome, SparseQp::Outcome::solved) << trial;
    EXPECT_LT(solution.residual(test), 1e-8) << trial;
    active += (solution.bounds.array() != 0.0).any();
    by_interior_point += qp.used_interior_point();
    // Its own active set as the guess: one factorisation says that it is right.
    QpSolution again = solution;
    const int factorisations = qp.factorisations();
    again.outcome =
        qp.solve(test.view(true), again.step.data(), again.multipliers.data(), again.bounds.data(), no_deadline);
    ASSERT_EQ(again.outcome, SparseQp::Outcome::solved) << trial;
    EXPECT_LT((again.step - solution.step).lpNorm<Eigen::Infinity>(), 1e-8) << trial;
    EXPECT_LE(qp.factorisations() - factorisations, 3) << trial;
  }
  EXPECT_GT(active, 100);
  std::printf("%d of 150 had active bounds, %d needed the interior point\n", active, by_interior_point);
}

TEST(SparseQp, RelaxedEquationsAreMetAsNearlyAsBoundsAllow) {
  RandomQp random(7);
  SparseQp qp;
  int infeasible = 0;
  for (int trial = 0; trial < 60; ++trial) {
    StageQp stages = random_stages(random);
    bound(stages, random, 0.05, 0.1);
    for (int i = 0; i < stages.intervals(); ++i)
      for (int j = 0; j < stages.states(i + 1); ++j) stages.b(i)[j] = random.uniform(-1.0, 1.0);
    const TestQp test(stages);
    if (solve(qp, test).outcome == SparseQp::Outcome::solved) continue;
    ++infeasible;
    QpSolution solution = start_of(test);
    const double penalty = 1e5;
    solution.outcome = qp.solve_relaxed(test.view(true), penalty, solution.step.data(), solution.multipliers.data(),
                                        solution.bounds.data(), no_deadline);
    ASSERT_EQ(solution.outcome, SparseQp::Outcome::relaxed) << trial;
    const double reached = (test.J * solution.step + test.c()).lpNorm<1>();
    for (int k = 0; k < test.n; ++k) {
      EXPECT_GE(solution.step[k], test.lower[k] - 1e-9);
      EXPECT_LE(solution.step[k], test.upper[k] + 1e-9);
    }
    // For every y with |y| <= 1 and every step within the bounds, |J d + c|_1 >= y'(J d + c): the least value over the
    // bounds' box is a limit that no step goes below. The multipliers give the best such y.
    const Eigen::VectorXd y = (solution.multipliers / penalty).cwiseMax(-1.0).cwiseMin(1.0),
                          slope = test.J.transpose() * y;
    double limit = y.dot(test.c());
    for (int k = 0; k < test.n; ++k) limit += slope[k] * (slope[k] > 0.0 ? test.lower[k] : test.upper[k]);
    EXPECT_GT(limit, 0.0) << trial << ": the equations can be met";
    EXPECT_NEAR(reached, limit, 1e-3 * (1.0 + limit)) << trial;
  }
  EXPECT_GT(infeasible, 30);
}

TEST(SparseQp, SaysWhereCurvatureIsMissing) {
  RandomQp random(8);
  SparseQp qp;
  int indefinite = 0;
  for (int trial = 0; trial < 30; ++trial) {
    TestQp test(random_stages(random));  // without bounds, which could help
    test.shift_hessian(-random.uniform(0.0, 3.0));
    const double least = test.least_reduced_eigenvalue();
    if (std::abs(least) < 1e-3) continue;
    const QpSolution solution = solve(qp, test, false);
    if (least < 0.0) {
      ++indefinite;
      EXPECT_EQ(solution.outcome, SparseQp::Outcome::indefinite) << trial;
    } else {
      ASSERT_EQ(solution.outcome, SparseQp::Outcome::solved) << trial;
      EXPECT_LT(solution.residual(test), 1e-7) << trial;
    }
  }
  EXPECT_GT(indefinite, 5);
}

TEST(SparseQp, KeepsADeadlineThatIsPast) {
  RandomQp random(9);
  StageQp stages = random.make(10, 4, 2, true);
  bound(stages, random, 0.05, 0.1);
  const TestQp test(stages);
  SparseQp qp;
  qp.take_structure(test.nlp);
  QpSolution solution = start_of(test);
  EXPECT_EQ(qp.solve_relaxed(test.view(true), 1e5, solution.step.data(), solution.multipliers.data(),
                             solution.bounds.data(), Clock::now() - std::chrono::seconds(1)),
            SparseQp::Outcome::deadline);
}

}  // namespace sparse_qp_test
}  // namespace rhec::sparse_sqp
