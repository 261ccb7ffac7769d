#include "solvers/sparse_sqp/kkt_factor.hpp"

#include <gtest/gtest.h>
#include <Eigen/LU>

#include <cmath>
#include <memory>
#include <vector>

#include "rhec/core/qp/stage_qp_views.hpp"
#include "test_qps.hpp"

namespace rhec::sparse_sqp {
namespace kkt_factor_test {

using namespace testing;

TEST(KktFactor, SolvesWhatDenseAlgebraSolves) {
  RandomQp random(1);
  int had_fixed = 0;
  for (int trial = 0; trial < 60; ++trial) {
    const TestQp test(random_stages(random));
    const int n = test.n, m = test.m;
    // Barrier terms of very different sizes; equations are relaxed only where variables are fixed, since those might
    // contradict them.
    Eigen::VectorXd primal = Eigen::VectorXd::Zero(n), dual = Eigen::VectorXd::Zero(m);
    std::vector<std::uint8_t> fixed(n, 0);
    if (trial % 3 != 0)
      for (double& value : primal) value = std::pow(10.0, random.uniform(-6.0, 6.0));
    if (trial % 2 == 1) {
      for (double& value : dual) value = std::pow(10.0, random.uniform(-2.0, 2.0));
      for (auto& flag : fixed) flag = random.uniform(0.0, 1.0) < 0.3;
      ++had_fixed;
    }
    KktFactor factor;
    factor.take_structure(test.nlp);
    KktFactor::Numbers numbers;
    numbers.hessian = test.hessian.data();
    numbers.jacobian = test.jacobian.data();
    numbers.primal = primal.data();
    numbers.dual = dual.data();
    numbers.fixed = fixed.data();
    ASSERT_TRUE(factor.factor(numbers)) << trial;
    Eigen::VectorXd rhs = Eigen::VectorXd::NullaryExpr(n + m, [&] { return random.uniform(-1.0, 1.0); });
    Eigen::VectorXd x(n + m);
    const double remaining = factor.solve(rhs.data(), x.data());
    EXPECT_LT(remaining, 1e-12) << trial;
    const Eigen::VectorXd expected = dense_kkt(test, primal, dual, fixed).fullPivLu().solve(rhs);
    EXPECT_LT((x - expected).lpNorm<Eigen::Infinity>(), 1e-8 * (1.0 + expected.lpNorm<Eigen::Infinity>())) << trial;
    for (int k = 0; k < n; ++k) EXPECT_TRUE(!fixed[k] || x[k] == rhs[k]) << trial;
  }
  EXPECT_GT(had_fixed, 20);
}

TEST(KktFactor, KnowsTheInertia) {
  RandomQp random(2);
  int right = 0, wrong = 0;
  for (int trial = 0; trial < 80; ++trial) {
    TestQp test(random_stages(random));
    test.shift_hessian(-random.uniform(0.0, 3.0));
    const double least = test.least_reduced_eigenvalue();
    if (std::abs(least) < 1e-3) continue;  // too near to singular to have an answer
    KktFactor factor;
    factor.take_structure(test.nlp);
    KktFactor::Numbers numbers;
    numbers.hessian = test.hessian.data();
    numbers.jacobian = test.jacobian.data();
    EXPECT_EQ(factor.factor(numbers), least > 0.0) << trial << ": " << least;
    ++(least > 0.0 ? right : wrong);
  }
  EXPECT_GT(right, 10);
  EXPECT_GT(wrong, 10);
}

TEST(KktFactor, ANumberThatIsNoneIsNoFactor) {
  RandomQp random(3);
  TestQp test(random_stages(random));
  test.hessian.back() = std::nan("");
  KktFactor factor;
  factor.take_structure(test.nlp);
  KktFactor::Numbers numbers;
  numbers.hessian = test.hessian.data();
  numbers.jacobian = test.jacobian.data();
  EXPECT_FALSE(factor.factor(numbers));
}

/// The residual of a solve with the matrix of a QP, whatever the factor was used for before.
double solve_residual(KktFactor& factor, const TestQp& test) {
  factor.take_structure(test.nlp);
  KktFactor::Numbers numbers;
  numbers.hessian = test.hessian.data();
  numbers.jacobian = test.jacobian.data();
  if (!factor.factor(numbers)) return infinity;
  const Eigen::VectorXd rhs = Eigen::VectorXd::LinSpaced(test.n + test.m, -1.0, 1.0);
  Eigen::VectorXd x(rhs.size());
  factor.solve(rhs.data(), x.data());
  const Eigen::MatrixXd K = dense_kkt(test, Eigen::VectorXd::Zero(test.n), Eigen::VectorXd::Zero(test.m),
                                      std::vector<std::uint8_t>(test.n, 0));
  return (K * x - rhs).lpNorm<Eigen::Infinity>() / (1.0 + x.lpNorm<Eigen::Infinity>());
}

/// QPs of structures that are all different.
std::vector<std::unique_ptr<TestQp>> structures(int count) {
  std::vector<std::unique_ptr<TestQp>> all;
  RandomQp random(4);
  for (int k = 0; k < count; ++k) {
    StageQp qp = random.make(8, 2, 1, false);
    for (int i = 0; i < 8; ++i) {  // the number in binary: which intervals have a control
      qp.set_sizes(i, 2, (k >> i) & 1);
      R_of(qp, i).setOnes();
      S_of(qp, i).setConstant(0.1);
      S_transposed_of(qp, i).setConstant(0.1);
      Q_of(qp, i).diagonal().array() += 1.0;
    }
    all.push_back(std::make_unique<TestQp>(qp));
  }
  return all;
}

TEST(KktFactor, KeepsTheAnalysisOfStructuresThatComeBack) {
  const auto qps = structures(7);
  KktFactor factor;
  for (int round = 0; round < 5; ++round)
    for (const auto& test : qps) EXPECT_LT(solve_residual(factor, *test), 1e-11);
  EXPECT_EQ(factor.analyses(), 7);
  EXPECT_EQ(factor.symbolic_factors(), 7);
  factor.forget();
  EXPECT_EQ(factor.symbolic_factors(), 0);
  EXPECT_LT(solve_residual(factor, *qps[3]), 1e-11);
}

TEST(KktFactor, DropsTheStructureThatWasUsedLongestAgo) {
  const int limit = KktFactor::most_structures;
  const auto qps = structures(limit + 10);
  KktFactor factor;
  for (int k = 0; k < limit; ++k) EXPECT_LT(solve_residual(factor, *qps[k]), 1e-11);
  EXPECT_LT(solve_residual(factor, *qps[0]), 1e-11);  // the oldest is used again
  for (int k = limit; k < limit + 10; ++k) EXPECT_LT(solve_residual(factor, *qps[k]), 1e-11);
  EXPECT_EQ(factor.symbolic_factors(), limit);
  EXPECT_EQ(factor.analyses(), limit + 10);
  EXPECT_LT(solve_residual(factor, *qps[0]), 1e-11);
  EXPECT_EQ(factor.analyses(), limit + 10) << "it was dropped though it had been used";
  EXPECT_LT(solve_residual(factor, *qps[1]), 1e-11);
  EXPECT_EQ(factor.analyses(), limit + 11) << "it was kept beyond the limit";
}

}  // namespace kkt_factor_test
}  // namespace rhec::sparse_sqp
