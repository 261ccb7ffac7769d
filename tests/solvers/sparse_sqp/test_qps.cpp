#include "test_qps.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <span>
#include <utility>

#include <Eigen/Dense>

namespace rhec::sparse_sqp::testing {
namespace {

/// The sizes of a stage QP as an Ocp, for the patterns that the sparse view makes of them. It has no numbers.
class Shape final : public Ocp {
 public:
  explicit Shape(const StageQp& qp) : qp_(qp), origin_(qp.capacity().states, 0.0) {}
  Capacity capacity() const noexcept override { return qp_.capacity(); }
  int intervals() const noexcept override { return qp_.intervals(); }
  int state_count(int node) const noexcept override { return qp_.states(node); }
  int control_count(int interval) const noexcept override { return qp_.controls(interval); }
  const double* initial_state() const noexcept override {
    return qp_.initial_state_is_given ? origin_.data() : nullptr;
  }
  const double* state_lower(int node) const noexcept override { return qp_.state_lower(node); }
  const double* state_upper(int node) const noexcept override { return qp_.state_upper(node); }
  const double* control_lower(int interval) const noexcept override { return qp_.control_lower(interval); }
  const double* control_upper(int interval) const noexcept override { return qp_.control_upper(interval); }
  int limit_count(int stage) const noexcept override { return qp_.limits(stage); }
  const double* limit_lower(int stage) const noexcept override { return qp_.limit_lower(stage); }
  const double* limit_upper(int stage) const noexcept override { return qp_.limit_upper(stage); }
  const double* limit_linear(int stage) const noexcept override { return qp_.limit_linear(stage); }
  const double* limit_quadratic(int stage) const noexcept override { return qp_.limit_quadratic(stage); }
  bool has_second_derivatives() const noexcept override { return true; }
  bool has_small_residuals() const noexcept override { return true; }
  std::size_t scratch_size() const noexcept override { return 0; }
  double evaluate_stages(const Iterate&, double*, double*, std::span<double>) const noexcept override { return 0.0; }
  void simulate_interval(int, Iterate&, std::span<double>) const noexcept override {}
  double linearise(StageRange, const Iterate&, Hessian, StageQp&, std::span<double>) const noexcept override {
    return 0.0;
  }
  void refresh(const Iterate&, StageQp&, std::span<double>) const noexcept override {}

 private:
  const StageQp& qp_;
  std::vector<double> origin_;
};

/// An orthonormal basis of what a matrix maps to zero.
Eigen::MatrixXd null_space(const Eigen::FullPivLU<Eigen::MatrixXd>& lu) {
  const Eigen::MatrixXd kernel = lu.kernel();
  return Eigen::HouseholderQR<Eigen::MatrixXd>(kernel).householderQ() *
         Eigen::MatrixXd::Identity(kernel.rows(), kernel.cols());
}

double least_eigenvalue(const Eigen::MatrixXd& symmetric) {
  return Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(symmetric, Eigen::EigenvaluesOnly).eigenvalues()[0];
}

}  // namespace

TestQp::TestQp(const StageQp& stages) : qp(stages) {
  const Shape shape(qp);
  nlp.take_structure(shape);
  n = nlp.variables();
  m = nlp.constraints();
  hessian.resize(nlp.hessian().entries());
  jacobian.resize(nlp.jacobian().entries());
  gradient.resize(n);
  constraints.resize(m);
  lower.resize(n);
  upper.resize(n);
  nlp.hessian(qp, hessian.data());
  nlp.jacobian(qp, jacobian.data());
  nlp.gradient(qp, gradient.data());
  nlp.constraints(qp, constraints.data());
  nlp.bounds(shape, lower.data(), upper.data());
  for (auto* v : {&row_lower, &row_upper, &row_linear, &row_quadratic}) v->assign(m, 0.0);
  nlp.row_bounds(shape, row_lower.data(), row_upper.data(), row_linear.data(), row_quadratic.data());
  for (int i = 0; i <= qp.intervals(); ++i)
    for (int r = 0; r < qp.limits(i); ++r) limits.push_back(nlp.limit_start(i) + r);
  H = dense(nlp.hessian(), hessian).selfadjointView<Eigen::Lower>();
  J = dense(nlp.jacobian(), jacobian);
}

Eigen::MatrixXd TestQp::dense(const SparseNlp::Pattern& pattern, const std::vector<double>& values) {
  Eigen::MatrixXd matrix = Eigen::MatrixXd::Zero(pattern.rows, pattern.columns);
  for (int c = 0; c < pattern.columns; ++c)
    for (int k = pattern.starts[c]; k < pattern.starts[c + 1]; ++k) matrix(pattern.row_indices[k], c) = values[k];
  return matrix;
}

void TestQp::scale_hessian(double factor) {
  for (double& value : hessian) value *= factor;
  H *= factor;
}

void TestQp::shift_hessian(double value) {
  for (int c = 0; c < n; ++c) hessian[nlp.hessian().starts[c]] += value;
  H.diagonal().array() += value;
}

double TestQp::least_reduced_eigenvalue() const {
  if (n == m) return infinity;  // the equations leave nothing to decide
  const Eigen::MatrixXd Z = null_space(J.fullPivLu());
  return least_eigenvalue(Z.transpose() * H * Z);
}

StageQp random_stages(RandomQp& random) {
  return random.make(random.integer(1, 12), random.integer(1, 5), random.integer(1, 4), random.integer(0, 1) == 1);
}

StageQp with_limits(const StageQp& from, RandomQp& random, double room) {
  Capacity capacity = from.capacity();
  capacity.limits = 3;
  StageQp to(capacity);
  const int N = from.intervals(), stride = from.stride(), wide = capacity.states + capacity.controls;
  to.set_intervals(N);
  to.initial_state_is_given = from.initial_state_is_given;
  for (int i = 0; i <= N; ++i) {
    to.set_sizes(i, from.states(i), from.controls(i));
    std::copy_n(from.AB(i), capacity.states * stride, to.AB(i));
    std::copy_n(from.H(i), wide * stride, to.H(i));
    for (const auto& [source, target] : {std::pair{from.h(i), to.h(i)},
                                         {from.b(i), to.b(i)},
                                         {from.lower(i), to.lower(i)},
                                         {from.upper(i), to.upper(i)}})
      std::copy_n(source, stride, target);
    to.set_limits(i, i == 0 && to.initial_state_is_given && from.controls(0) == 0 ? 0 : random.integer(0, 3));
    for (int r = 0; r < to.limits(i); ++r) {
      for (int j = 0; j < from.states(i); ++j) to.G(i)[r * stride + j] = random.uniform(-1.0, 1.0);
      for (int j = 0; j < from.controls(i); ++j) to.G(i)[r * stride + capacity.states + j] = random.uniform(-1.0, 1.0);
      const int kind = random.integer(0, 5);
      to.limit_lower(i)[r] = kind == 0 ? -infinity : -room * random.uniform(0.01, 1.0);
      to.limit_upper(i)[r] = kind == 1 ? infinity : room * random.uniform(0.01, 1.0);
      // Soft ones may also be far from what is possible, or demand equality.
      const bool is_soft = kind >= 3;
      to.limit_linear(i)[r] = !is_soft ? infinity : kind == 3 ? 0.0 : std::pow(10.0, random.uniform(-2.0, 1.0));
      to.limit_quadratic(i)[r] = kind == 3 || kind == 4 ? std::pow(10.0, random.uniform(-1.0, 1.0)) : 0.0;
      if (is_soft && random.integer(0, 2) == 0)
        to.limit_upper(i)[r] = to.limit_lower(i)[r] += random.uniform(-1.0, 1.0);
    }
  }
  return to;
}

Eigen::MatrixXd dense_kkt(const TestQp& test, const Eigen::VectorXd& primal, const Eigen::VectorXd& dual,
                          const std::vector<std::uint8_t>& fixed) {
  const int n = test.n, m = test.m;
  Eigen::MatrixXd K = Eigen::MatrixXd::Zero(n + m, n + m);
  K.topLeftCorner(n, n) = test.H;
  K.topLeftCorner(n, n).diagonal() += primal;
  K.bottomLeftCorner(m, n) = test.J;
  K.topRightCorner(n, m) = test.J.transpose();
  K.bottomRightCorner(m, m).diagonal() = -dual;
  for (int k = 0; k < n; ++k) {
    if (!fixed[k]) continue;
    K.row(k).setZero();
    K.col(k).setZero();
    K(k, k) = 1.0;
  }
  return K;
}

double least_reduced_eigenvalue(const TestQp& test, const std::vector<std::uint8_t>& fixed) {
  Eigen::MatrixXd rows = Eigen::MatrixXd::Zero(test.m + std::count(fixed.begin(), fixed.end(), 1), test.n);
  rows.topRows(test.m) = test.J;
  Eigen::Index row = test.m;
  for (int k = 0; k < test.n; ++k)
    if (fixed[k] != 0) rows(row++, k) = 1.0;
  const Eigen::FullPivLU<Eigen::MatrixXd> lu(rows);
  EXPECT_EQ(lu.rank(), rows.rows()) << "what is fixed contradicts the equations";
  if (lu.dimensionOfKernel() == 0) return infinity;
  const Eigen::MatrixXd Z = null_space(lu);
  return least_eigenvalue(Z.transpose() * test.H * Z);
}

}  // namespace rhec::sparse_sqp::testing
