#include "solvers/ipopt/ocp_nlp.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "problems.hpp"
#include "support/limited_ocp.hpp"

namespace rhec::ipopt {
namespace ocp_nlp_test {

using namespace testing;
using rhec::testing::Limit;
using rhec::testing::LimitedOcp;
using Vector = std::vector<double>;

/// The NLP at a point near a problem's cold start, with multipliers of the size of its gradient.
struct TestNlp {
  TestNlp(const Ocp& ocp, const Iterate& start, RandomProblem& random, Curvature curvature)
      : nlp(new OcpNlp(ocp, curvature)) {
    nlp->take(ocp);
    nlp->get_nlp_info(n, m, jacobian_entries, hessian_entries, style);
    nlp->set_start(start, 0.0);
    z.resize(n);
    nlp->get_starting_point(n, true, z.data(), false, nullptr, nullptr, m, false, nullptr);
    for (double& value : z) value += 0.01 * random.normal();
    for (int row = 0; row < m; ++row) multipliers.push_back(20.0 * random.normal());
    for (auto* indices : {&rows, &columns}) indices->resize(hessian_entries);
    nlp->eval_h(n, nullptr, false, 0.0, m, nullptr, false, hessian_entries, rows.data(), columns.data(), nullptr);
    jacobian_rows.resize(jacobian_entries);
    jacobian_columns.resize(jacobian_entries);
    nlp->eval_jac_g(n, nullptr, false, m, jacobian_entries, jacobian_rows.data(), jacobian_columns.data(), nullptr);
  }
  double lagrangian(const Vector& at, double factor) {
    double objective = 0.0;
    Vector constraints(m);
    EXPECT_TRUE(nlp->eval_f(n, at.data(), true, objective));
    EXPECT_TRUE(nlp->eval_g(n, at.data(), false, m, constraints.data()));
    double sum = factor * objective;
    for (int row = 0; row < m; ++row) sum += multipliers[row] * constraints[row];
    return sum;
  }
  Vector gradient(const Vector& at, double factor) {
    Vector sum(n), jacobian(jacobian_entries);
    EXPECT_TRUE(nlp->eval_grad_f(n, at.data(), true, sum.data()));
    EXPECT_TRUE(nlp->eval_jac_g(n, at.data(), false, m, jacobian_entries, nullptr, nullptr, jacobian.data()));
    for (double& value : sum) value *= factor;
    for (int k = 0; k < jacobian_entries; ++k) sum[jacobian_columns[k]] += jacobian[k] * multipliers[jacobian_rows[k]];
    return sum;
  }
  /// Dense, column by column.
  std::vector<Vector> hessian(double factor) {
    Vector values(hessian_entries);
    EXPECT_TRUE(nlp->eval_h(n, z.data(), true, factor, m, multipliers.data(), true, hessian_entries, nullptr, nullptr,
                            values.data()));
    std::vector<Vector> dense(n, Vector(n, 0.0));
    for (int k = 0; k < hessian_entries; ++k) dense[columns[k]][rows[k]] = dense[rows[k]][columns[k]] = values[k];
    return dense;
  }
  Ipopt::SmartPtr<OcpNlp> nlp;
  int n = 0, m = 0, jacobian_entries = 0, hessian_entries = 0;
  OcpNlp::IndexStyleEnum style = OcpNlp::C_STYLE;
  Vector z, multipliers;
  std::vector<int> rows, columns, jacobian_rows, jacobian_columns;
};

void check_derivatives(const Ocp& problem, const Iterate& start, RandomProblem& random) {
  TestNlp test(problem, start, random, Curvature::exact);
  constexpr double step = 1e-6;
  // 1e-4: where the weight is too small to be divided by.
  for (const double factor : {0.0, 1e-4, 1.0, 2.0}) {
    const Vector gradient = test.gradient(test.z, factor);
    const auto hessian = test.hessian(factor);
    double scale = 1.0, curvature = 1.0;
    for (int c = 0; c < test.n; ++c) {
      scale = std::max(scale, std::abs(gradient[c]));
      for (const double value : hessian[c]) curvature = std::max(curvature, std::abs(value));
    }
    for (int c = 0; c < test.n; ++c) {
      Vector before = test.z, after = test.z;
      before[c] -= step;
      after[c] += step;
      EXPECT_NEAR(gradient[c], (test.lagrangian(after, factor) - test.lagrangian(before, factor)) / (2.0 * step),
                  1e-5 * scale)
          << "weight " << factor << ", variable " << c;
      const Vector low = test.gradient(before, factor), high = test.gradient(after, factor);
      for (int r = 0; r < test.n; ++r)
        EXPECT_NEAR(hessian[c][r], (high[r] - low[r]) / (2.0 * step), 1e-6 * curvature)
            << "weight " << factor << ", " << r << ", " << c;
    }
  }
}

void check_derivatives(const HorizonProblem& problem, RandomProblem& random) {
  check_derivatives(problem, RandomProblem::cold_start(problem), random);
}

TEST(IpoptProgram, DerivativesAreThoseOfItsFunctionsWithAnyWeightOfTheObjective) {
  RandomProblem random(bicycle(), 1);
  check_derivatives(*random.rhe(blocks_of(3, 5)), random);
  check_derivatives(*random.rhe(blocks_of(0, 1)), random);
  RandomProblem::RhcSpec spec;
  spec.intervals = 5;
  spec.blocked_inputs = {0};
  check_derivatives(*random.rhc(spec), random);
}

TEST(IpoptProgram, LimitsAndTheirSlacksHaveTheDerivativesOfTheirFunctions) {
  RandomProblem random(bicycle(), 11);
  RandomProblem::RhcSpec spec;
  spec.intervals = 4;
  const auto problem = random.rhc(spec);
  const int u = problem->capacity().states;
  LimitedOcp limited(*problem, 4);
  for (int i = 0; i <= 4; ++i) {
    limited.add(i, {Limit::Kind::distance, {0, 1}, {0.3 * i, -0.4}, 0.5});
    limited.add(i, {Limit::Kind::linear, {1, 0}, {1.0, -0.3}, -2.0, 1.0, 10.0, 3.0});
    if (i < 4) limited.add(i, {Limit::Kind::product, {u, 2}, {0.7}, -1.0, 1.0, 0.0, 4.0});
  }
  check_derivatives(limited, with_limits(limited, RandomProblem::cold_start(*problem)), random);
}

TEST(IpoptProgram, GaussNewtonCurvatureIsOfTheObjectiveAlone) {
  RandomProblem random(bicycle(), 2);
  const auto problem = random.rhe(blocks_of(3, 5));
  TestNlp test(*problem, RandomProblem::cold_start(*problem), random, Curvature::gauss_newton);
  const auto none = test.hessian(0.0), once = test.hessian(1.0), twice = test.hessian(2.0);
  double largest = 0.0;
  for (int c = 0; c < test.n; ++c) {
    for (int r = 0; r < test.n; ++r) {
      EXPECT_EQ(none[c][r], 0.0);
      EXPECT_EQ(twice[c][r], 2.0 * once[c][r]);
      largest = std::max(largest, once[c][r]);
    }
    EXPECT_GE(once[c][c], 0.0);
  }
  EXPECT_GT(largest, 1.0);
}

TEST(IpoptProgram, EvaluatesEveryPointOnce) {
  RandomProblem random(bicycle(), 3);
  const auto problem = random.rhe(blocks_of(3));
  const Scaled counted(*problem, 1.0);
  TestNlp test(counted, RandomProblem::cold_start(*problem), random, Curvature::exact);
  counted.evaluations = counted.linearisations = 0;
  for (int repeat = 0; repeat < 2; ++repeat) {
    test.lagrangian(test.z, 1.0);
    test.gradient(test.z, 1.0);
  }
  EXPECT_EQ(counted.evaluations, 1);
  EXPECT_EQ(counted.linearisations, 1);
  test.z[0] += 0.1;
  test.gradient(test.z, 1.0);
  test.lagrangian(test.z, 1.0);
  EXPECT_EQ(counted.evaluations, 2);
  EXPECT_EQ(counted.linearisations, 2);
}

}  // namespace ocp_nlp_test
}  // namespace rhec::ipopt
