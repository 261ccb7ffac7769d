// The interior-point method of SparseQp: where active sets do not settle, and with relaxed equations and limits.
#include <gtest/gtest.h>

#include <chrono>
#include <cmath>

#include "test_qps.hpp"

namespace rhec::sparse_sqp {
namespace sparse_qp_interior_test {

using namespace testing;

TEST(SparseQpInterior, RelaxedEquationsAreMetAsNearlyAsBoundsAllow) {
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

TEST(SparseQpInterior, RelaxedLimitsThatContradictEachOtherShareTheViolation) {
  RandomQp random(17);
  SparseQp qp;
  for (int trial = 0; trial < 40; ++trial) {
    StageQp stages = with_limits(random_stages(random), random, 1.0);
    const int node = random.integer(0, stages.intervals() - 1);
    // The others are soft: they may contradict each other, too.
    for (int i = 0; i <= stages.intervals(); ++i)
      for (int r = 0; r < stages.limits(i); ++r) stages.limit_linear(i)[r] = std::min(stages.limit_linear(i)[r], 10.0);
    stages.set_limits(node, 2);
    for (int r = 0; r < 2; ++r) {
      std::fill_n(stages.G(node) + r * stages.stride(), stages.stride(), 0.0);
      stages.G(node)[r * stages.stride() + stages.capacity().states] = 1.0;  // the first control
      stages.limit_linear(node)[r] = infinity;
      stages.limit_quadratic(node)[r] = 0.0;
      stages.limit_lower(node)[r] = r == 0 ? 0.25 : -infinity;
      stages.limit_upper(node)[r] = r == 0 ? infinity : -0.5;
    }
    const TestQp test(stages);
    EXPECT_EQ(solve(qp, test).outcome, SparseQp::Outcome::failed) << trial;
    QpSolution solution = start_of(test);
    solution.outcome = qp.solve_relaxed(test.view(true), 1e4, solution.step.data(), solution.multipliers.data(),
                                        solution.bounds.data(), no_deadline);
    ASSERT_EQ(solution.outcome, SparseQp::Outcome::relaxed) << trial;
    const Eigen::VectorXd values = test.J * solution.step + test.c();
    const int first = test.nlp.limit_start(node);
    double violation = 0.0, others = 0.0;
    std::vector<bool> is_limit(test.m, false);
    for (const int r : test.limits) {
      is_limit[r] = true;
      if (test.row_linear[r] < infinity) continue;
      const double beyond = std::max({0.0, test.row_lower[r] - values[r], values[r] - test.row_upper[r]});
      (r == first || r == first + 1 ? violation : others) += beyond;
    }
    for (int r = 0; r < test.m; ++r)
      if (!is_limit[r]) others += std::abs(values[r]);
    EXPECT_GE(violation, 0.75 - 1e-6) << trial << ": what both demand together";
    EXPECT_LE(violation + others, 0.75 + 1e-4) << trial;
  }
}

TEST(SparseQpInterior, KeepsADeadlineThatIsPast) {
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

}  // namespace sparse_qp_interior_test
}  // namespace rhec::sparse_sqp
