#include "solvers/sparse_sqp/sparse_qp.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <cstdio>

#include "test_qps.hpp"

namespace rhec::sparse_sqp {
namespace sparse_qp_test {

using namespace testing;

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

TEST(SparseQp, SolvesRandomQpsWithLimitsToTheirOptimalityConditions) {
  RandomQp random(16);
  SparseQp qp;
  int solved = 0, active = 0, beyond = 0, by_interior_point = 0, recognised = 0;
  for (int trial = 0; trial < 200; ++trial) {
    StageQp stages = random_stages(random);
    bound(stages, random, std::pow(10.0, random.uniform(-0.5, 0.5)), 6.0);
    for (int i = 0; i < stages.intervals(); ++i)
      for (int j = 0; j < stages.states(i + 1); ++j) stages.b(i)[j] *= 0.1;
    const TestQp test(with_limits(stages, random, std::pow(10.0, random.uniform(-0.5, 1.0))));
    const QpSolution solution = solve(qp, test);
    if (solution.outcome == SparseQp::Outcome::failed) continue;  // hard limits may contradict each other
    ASSERT_EQ(solution.outcome, SparseQp::Outcome::solved) << trial;
    EXPECT_LT(solution.residual(test), 1e-8) << trial;
    ++solved;
    by_interior_point += qp.used_interior_point();
    for (const int r : test.limits) {
      active += solution.multipliers[r] != 0.0;
      beyond += std::abs(solution.multipliers[r]) > test.row_linear[r];
    }
    QpSolution again = solution;
    const int factorisations = qp.factorisations();
    again.outcome =
        qp.solve(test.view(true), again.step.data(), again.multipliers.data(), again.bounds.data(), no_deadline);
    ASSERT_EQ(again.outcome, SparseQp::Outcome::solved) << trial;
    EXPECT_LT((again.step - solution.step).lpNorm<Eigen::Infinity>(), 1e-7) << trial;
    recognised += qp.factorisations() - factorisations <= 3;
  }
  EXPECT_GT(solved, 150);
  EXPECT_GE(recognised, solved - 2) << "but for limits that are active by rounding alone";
  EXPECT_GT(active, 300);
  EXPECT_GT(beyond, 50);
  std::printf("%d of 200 solved, %d of them by the interior point; %d limits active, %d violated\n", solved,
              by_interior_point, active, beyond);
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

}  // namespace sparse_qp_test
}  // namespace rhec::sparse_sqp
