#pragma once

// Stage QPs as sparse ones and as dense matrices.

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "rhec/core/base/infinity.hpp"
#include "solvers/sparse_sqp/sparse_qp.hpp"
#include "support/random_qp.hpp"

namespace rhec::sparse_sqp::testing {

using rhec::testing::RandomQp;

/// A stage QP as a sparse one, and as dense matrices.
struct TestQp {
  explicit TestQp(const StageQp& stages);
  static Eigen::MatrixXd dense(const SparseNlp::Pattern& pattern, const std::vector<double>& values);
  void scale_hessian(double factor);
  /// Adds to the Hessian's diagonal.
  void shift_hessian(double value);
  double least_reduced_eigenvalue() const;
  SparseQp::Data view(bool is_convex) const {
    return {hessian.data(),  jacobian.data(),
            gradient.data(), constraints.data(),
            lower.data(),    upper.data(),
            is_convex,       {limits, row_lower.data(), row_upper.data(), row_linear.data(), row_quadratic.data()}};
  }
  Eigen::Map<const Eigen::VectorXd> g() const { return {gradient.data(), n}; }
  Eigen::Map<const Eigen::VectorXd> c() const { return {constraints.data(), m}; }

  StageQp qp;
  SparseNlp nlp;
  int n = 0, m = 0;
  std::vector<double> hessian, jacobian, gradient, constraints, lower, upper;
  std::vector<int> limits;  ///< rows that are no equations
  std::vector<double> row_lower, row_upper, row_linear, row_quadratic;
  Eigen::MatrixXd H, J;
};

StageQp random_stages(RandomQp& random);

/// A copy with limits: at each stage some rows, whose sides are up to `room` from zero, some of them soft. Hard ones
/// may not contradict each other.
StageQp with_limits(const StageQp& from, RandomQp& random, double room);

/// The whole matrix K, dense.
Eigen::MatrixXd dense_kkt(const TestQp& test, const Eigen::VectorXd& primal, const Eigen::VectorXd& dual,
                          const std::vector<std::uint8_t>& fixed);

/// The least eigenvalue of the reduced Hessian where some variables do not move.
double least_reduced_eigenvalue(const TestQp& test, const std::vector<std::uint8_t>& fixed);

inline constexpr auto no_deadline = Clock::time_point::max();

struct QpSolution {
  Eigen::VectorXd step, multipliers, bounds;
  SparseQp::Outcome outcome = SparseQp::Outcome::failed;

  /// What is left of the optimality conditions; with a penalty, of the QP with relaxed equations.
  double residual(const TestQp& test) const {
    double worst = (test.H * step + test.g() + test.J.transpose() * multipliers + bounds).lpNorm<Eigen::Infinity>();
    const Eigen::VectorXd values = test.J * step + test.c();
    std::vector<bool> is_limit(test.m, false);
    for (const int r : test.limits) {
      is_limit[r] = true;
      worst = std::max(worst, residual_of_limit(test, r, values[r]));
    }
    for (int r = 0; r < test.m; ++r)
      if (!is_limit[r]) worst = std::max(worst, std::abs(values[r]));
    for (int k = 0; k < test.n; ++k) {
      worst = std::max({worst, test.lower[k] - step[k], step[k] - test.upper[k]});
      if (bounds[k] > 0.0) worst = std::max(worst, bounds[k] * (test.upper[k] - step[k]));
      if (bounds[k] < 0.0) worst = std::max(worst, -bounds[k] * (step[k] - test.lower[k]));
    }
    return worst;
  }
  /// Of a limit: its slack, price and multiplier.
  double residual_of_limit(const TestQp& test, int r, double value) const {
    const double above = value - test.row_upper[r], below = test.row_lower[r] - value, multiplier = multipliers[r];
    const double slack = std::max({0.0, above, below}), linear = test.row_linear[r];
    double worst = multiplier > 0.0 ? multiplier * std::max(0.0, -above) : -multiplier * std::max(0.0, -below);
    if (linear == infinity) return std::max(worst, slack);
    const double price = linear + test.row_quadratic[r] * slack;
    worst = std::max(worst, std::abs(multiplier) - price);
    return slack > 0.0 ? std::max(worst, slack * (price - std::abs(multiplier))) : worst;
  }
};
inline QpSolution start_of(const TestQp& test) {
  return {Eigen::VectorXd::Zero(test.n), Eigen::VectorXd::Zero(test.m), Eigen::VectorXd::Zero(test.n)};
}
inline QpSolution solve(SparseQp& qp, const TestQp& test, bool is_convex = true) {
  QpSolution solution = start_of(test);
  qp.take_structure(test.nlp);
  solution.outcome = qp.solve(test.view(is_convex), solution.step.data(), solution.multipliers.data(),
                              solution.bounds.data(), no_deadline);
  return solution;
}

/// Bounds about zero, on controls and on states.
inline void bound(StageQp& qp, RandomQp& random, double controls, double states) {
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

}  // namespace rhec::sparse_sqp::testing
