#pragma once

// Stage QPs as sparse ones and as dense matrices.

#include <cstdint>
#include <limits>
#include <vector>

#include <Eigen/Core>

#include "solvers/sparse_sqp/sparse_qp.hpp"
#include "support/random_qp.hpp"

namespace rhec::sparse_sqp::testing {

using rhec::testing::RandomQp;

constexpr double infinity = std::numeric_limits<double>::infinity();

/// A stage QP as a sparse one, and as dense matrices.
struct TestQp {
  explicit TestQp(const StageQp& stages);
  static Eigen::MatrixXd dense(const SparseNlp::Pattern& pattern, const std::vector<double>& values);
  void scale_hessian(double factor);
  /// Adds to the Hessian's diagonal.
  void shift_hessian(double value);
  double least_reduced_eigenvalue() const;
  SparseQp::Data view(bool is_convex) const {
    return {hessian.data(), jacobian.data(), gradient.data(), constraints.data(),
            lower.data(),   upper.data(),    is_convex};
  }
  Eigen::Map<const Eigen::VectorXd> g() const { return {gradient.data(), n}; }
  Eigen::Map<const Eigen::VectorXd> c() const { return {constraints.data(), m}; }

  StageQp qp;
  SparseNlp nlp;
  int n = 0, m = 0;
  std::vector<double> hessian, jacobian, gradient, constraints, lower, upper;
  Eigen::MatrixXd H, J;
};

StageQp random_stages(RandomQp& random);

/// The whole matrix K, dense.
Eigen::MatrixXd dense_kkt(const TestQp& test, const Eigen::VectorXd& primal, const Eigen::VectorXd& dual,
                          const std::vector<std::uint8_t>& fixed);

/// The least eigenvalue of the reduced Hessian where some variables do not move.
double least_reduced_eigenvalue(const TestQp& test, const std::vector<std::uint8_t>& fixed);

}  // namespace rhec::sparse_sqp::testing
