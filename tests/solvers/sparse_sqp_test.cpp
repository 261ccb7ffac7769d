// The solver for long horizons and wide models, from its factor upwards, against dense algebra and the core's
// recursion.
#include "solvers/sparse_sqp/sparse_sqp.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Dense>

#include "rhec/core/ocp/iterate_checks.hpp"
#include "rhec/core/qp/riccati.hpp"
#include "rhec/plugins/host/host.hpp"
#include "rhec/plugins/yaml/yaml.hpp"
#include "solvers/sparse_sqp/stage_convexity.hpp"
#include "solvers/sparse_sqp/stage_covariances.hpp"
#include "support/random_problem.hpp"
#include "support/random_qp.hpp"
#include "support/test_models.hpp"

namespace rhec::sparse_sqp {
namespace {

using rhec::testing::RandomProblem;
using rhec::testing::RandomQp;
using rhec::testing::WithoutSecondDerivatives;
using Drive = RandomProblem::Drive;
using RheSpec = RandomProblem::RheSpec;
using RhcSpec = RandomProblem::RhcSpec;

constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr auto no_deadline = Clock::time_point::max();

const Host& host() {
  static const Host instance;
  return instance;
}
std::shared_ptr<const Model> bicycle() { return host().make_model("bicycle_slip"); }
std::shared_ptr<Solver> plugin(const std::string& options = "{}") {
  return host().make_solver("sparse_sqp", parse_yaml(options, "test"));
}

/// The sizes of a stage program as an Ocp, for the patterns that the sparse view makes of them. It has no numbers.
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

/// A stage program as a sparse one, and as dense matrices.
struct Data {
  explicit Data(const StageQp& stages) : qp(stages), shape(qp) {
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
    H = dense(nlp.hessian(), hessian).selfadjointView<Eigen::Lower>();
    J = dense(nlp.jacobian(), jacobian);
  }
  static Eigen::MatrixXd dense(const SparseNlp::Pattern& pattern, const std::vector<double>& values) {
    Eigen::MatrixXd matrix = Eigen::MatrixXd::Zero(pattern.rows, pattern.columns);
    for (int c = 0; c < pattern.columns; ++c)
      for (int k = pattern.starts[c]; k < pattern.starts[c + 1]; ++k) matrix(pattern.row_indices[k], c) = values[k];
    return matrix;
  }
  void scale_hessian(double factor) {
    for (double& value : hessian) value *= factor;
    H *= factor;
  }
  /// Adds to the Hessian's diagonal.
  void shift_hessian(double value) {
    for (int c = 0; c < n; ++c) hessian[nlp.hessian().starts[c]] += value;
    H.diagonal().array() += value;
  }
  double least_reduced_eigenvalue() const {
    if (n == m) return infinity;  // the equations leave nothing to decide
    const Eigen::MatrixXd Z = J.fullPivLu().kernel(), Q = Eigen::HouseholderQR<Eigen::MatrixXd>(Z).householderQ() *
                                                          Eigen::MatrixXd::Identity(Z.rows(), Z.cols());
    return Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(Q.transpose() * H * Q).eigenvalues()[0];
  }
  SparseQp::Data view(bool is_convex) const {
    return {hessian.data(), jacobian.data(), gradient.data(), constraints.data(),
            lower.data(),   upper.data(),    is_convex};
  }
  Eigen::Map<const Eigen::VectorXd> g() const { return {gradient.data(), n}; }
  Eigen::Map<const Eigen::VectorXd> c() const { return {constraints.data(), m}; }

  StageQp qp;
  Shape shape;
  SparseNlp nlp;
  int n = 0, m = 0;
  std::vector<double> hessian, jacobian, gradient, constraints, lower, upper;
  Eigen::MatrixXd H, J;
};

StageQp random_stages(RandomQp& random) {
  return random.make(random.integer(1, 12), random.integer(1, 5), random.integer(1, 4), random.integer(0, 1) == 1);
}

/// The whole matrix K, dense.
Eigen::MatrixXd dense_kkt(const Data& qp, const Eigen::VectorXd& primal, const Eigen::VectorXd& dual,
                          const std::vector<std::uint8_t>& fixed) {
  const int n = qp.n, m = qp.m;
  Eigen::MatrixXd K = Eigen::MatrixXd::Zero(n + m, n + m);
  K.topLeftCorner(n, n) = qp.H;
  K.topLeftCorner(n, n).diagonal() += primal;
  K.bottomLeftCorner(m, n) = qp.J;
  K.topRightCorner(n, m) = qp.J.transpose();
  K.bottomRightCorner(m, m).diagonal() = -dual;
  for (int k = 0; k < n; ++k) {
    if (!fixed[k]) continue;
    K.row(k).setZero();
    K.col(k).setZero();
    K(k, k) = 1.0;
  }
  return K;
}

TEST(KktFactor, SolvesWhatDenseAlgebraSolves) {
  RandomQp random(1);
  int had_fixed = 0;
  for (int trial = 0; trial < 60; ++trial) {
    const Data qp_data(random_stages(random));
    const int n = qp.n, m = qp.m;
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
    factor.take_structure(qp.nlp);
    KktFactor::Numbers numbers;
    numbers.hessian = qp.hessian.data();
    numbers.jacobian = qp.jacobian.data();
    numbers.primal = primal.data();
    numbers.dual = dual.data();
    numbers.fixed = fixed.data();
    ASSERT_TRUE(factor.factor(numbers)) << trial;
    Eigen::VectorXd rhs = Eigen::VectorXd::NullaryExpr(n + m, [&] { return random.uniform(-1.0, 1.0); });
    Eigen::VectorXd x(n + m);
    const double remaining = factor.solve(rhs.data(), x.data());
    EXPECT_LT(remaining, 1e-12) << trial;
    const Eigen::VectorXd expected = dense_kkt(qp, primal, dual, fixed).fullPivLu().solve(rhs);
    EXPECT_LT((x - expected).lpNorm<Eigen::Infinity>(), 1e-8 * (1.0 + expected.lpNorm<Eigen::Infinity>())) << trial;
    for (int k = 0; k < n; ++k) EXPECT_TRUE(!fixed[k] || x[k] == rhs[k]) << trial;
  }
  EXPECT_GT(had_fixed, 20);
}

TEST(KktFactor, KnowsTheInertia) {
  RandomQp random(2);
  int right = 0, wrong = 0;
  for (int trial = 0; trial < 80; ++trial) {
    Data qp_data(random_stages(random));
    qp.shift_hessian(-random.uniform(0.0, 3.0));
    const double least = qp.least_reduced_eigenvalue();
    if (std::abs(least) < 1e-3) continue;  // too near to singular to have an answer
    KktFactor factor;
    factor.take_structure(qp.nlp);
    KktFactor::Numbers numbers;
    numbers.hessian = qp.hessian.data();
    numbers.jacobian = qp.jacobian.data();
    EXPECT_EQ(factor.factor(numbers), least > 0.0) << trial << ": " << least;
    ++(least > 0.0 ? right : wrong);
  }
  EXPECT_GT(right, 10);
  EXPECT_GT(wrong, 10);
}

TEST(KktFactor, ANumberThatIsNoneIsNoFactor) {
  RandomQp random(3);
  Data qp_data(random_stages(random));
  qp.hessian.back() = std::nan("");
  KktFactor factor;
  factor.take_structure(qp.nlp);
  KktFactor::Numbers numbers;
  numbers.hessian = qp.hessian.data();
  numbers.jacobian = qp.jacobian.data();
  EXPECT_FALSE(factor.factor(numbers));
}

/// The residual of a solve with the matrix of a program, whatever the factor was used for before.
double solve_residual(KktFactor& factor, const Data& qp) {
  factor.take_structure(qp.nlp);
  KktFactor::Numbers numbers;
  numbers.hessian = qp.hessian.data();
  numbers.jacobian = qp.jacobian.data();
  if (!factor.factor(numbers)) return infinity;
  const Eigen::VectorXd rhs = Eigen::VectorXd::LinSpaced(qp.n + qp.m, -1.0, 1.0);
  Eigen::VectorXd x(rhs.size());
  factor.solve(rhs.data(), x.data());
  const Eigen::MatrixXd K =
      dense_kkt(qp, Eigen::VectorXd::Zero(qp.n), Eigen::VectorXd::Zero(qp.m), std::vector<std::uint8_t>(qp.n, 0));
  return (K * x - rhs).lpNorm<Eigen::Infinity>() / (1.0 + x.lpNorm<Eigen::Infinity>());
}

/// Programs of structures that are all different.
std::vector<std::unique_ptr<Data>> structures(int count) {
  std::vector<std::unique_ptr<Data>> all;
  RandomQp random(4);
  for (int k = 0; k < count; ++k) {
    StageQp qp = random.make(8, 2, 1, false);
    for (int i = 0; i < 8; ++i) {  // the number in binary: which intervals have a control
      qp.set_sizes(i, 2, (k >> i) & 1);
      qp.R_of(i).setOnes();
      qp.S_of(i).setConstant(0.1);
      qp.S_transposed_of(i).setConstant(0.1);
      qp.Q_of(i).diagonal().array() += 1.0;
    }
    all.push_back(std::make_unique<Data>(qp));
  }
  return all;
}

TEST(KktFactor, KeepsTheAnalysisOfStructuresThatComeBack) {
  const auto programs = structures(7);
  KktFactor factor;
  for (int round = 0; round < 5; ++round)
    for (const auto& qp : programs) EXPECT_LT(solve_residual(factor, *qp), 1e-11);
  EXPECT_EQ(factor.analyses(), 7);
  EXPECT_EQ(factor.symbolic_factors(), 7);
  factor.forget();
  EXPECT_EQ(factor.symbolic_factors(), 0);
  EXPECT_LT(solve_residual(factor, *programs[3]), 1e-11);
}

TEST(KktFactor, DropsTheStructureThatWasUsedLongestAgo) {
  const int limit = KktFactor::most_structures;
  const auto programs = structures(limit + 10);
  KktFactor factor;
  for (int k = 0; k < limit; ++k) EXPECT_LT(solve_residual(factor, *programs[k]), 1e-11);
  EXPECT_LT(solve_residual(factor, *programs[0]), 1e-11);  // the oldest is used again
  for (int k = limit; k < limit + 10; ++k) EXPECT_LT(solve_residual(factor, *programs[k]), 1e-11);
  EXPECT_EQ(factor.symbolic_factors(), limit);
  EXPECT_EQ(factor.analyses(), limit + 10);
  EXPECT_LT(solve_residual(factor, *programs[0]), 1e-11);
  EXPECT_EQ(factor.analyses(), limit + 10) << "it was dropped though it had been used";
  EXPECT_LT(solve_residual(factor, *programs[1]), 1e-11);
  EXPECT_EQ(factor.analyses(), limit + 11) << "it was kept beyond the limit";
}

TEST(StageCovariances, AreThoseOfTheDenseInverse) {
  RandomQp random(5);
  for (int trial = 0; trial < 40; ++trial) {
    const Data qp_data(random_stages(random));
    const int stride = qp.qp.capacity().states, N = qp.qp.intervals();
    std::vector<double> blocks(static_cast<std::size_t>(N + 1) * stride * stride, -7.0);
    ASSERT_TRUE(stage_covariances(qp.qp, blocks)) << trial;
    const Eigen::MatrixXd K = dense_kkt(qp, Eigen::VectorXd::Zero(qp.n), Eigen::VectorXd::Zero(qp.m),
                                        std::vector<std::uint8_t>(qp.n, 0)),
                          inverse = K.fullPivLu().inverse();
    for (int i = 0; i <= N; ++i) {
      const int start = qp.nlp.state_start(i);
      for (int c = 0; c < stride; ++c)
        for (int r = 0; r < stride; ++r) {
          const double expected = start < 0 ? 0.0 : 2.0 * inverse(start + r, start + c);
          ASSERT_NEAR(blocks[(i * stride + c) * stride + r], expected, 1e-9 * (1.0 + std::abs(expected)))
              << trial << ", node " << i;
        }
    }
  }
}

TEST(StageCovariances, ThereAreNoneWithoutAnInverse) {
  RandomQp random(5);
  StageQp qp = random.make(4, 2, 1, false);
  for (int i = 0; i <= 4; ++i) qp.Q_of(i)(0, 0) -= 10.0;
  std::vector<double> blocks(20, -7.0);
  EXPECT_FALSE(stage_covariances(qp, blocks));
  EXPECT_THAT(blocks, ::testing::Each(-7.0));
}

struct QpSolution {
  Eigen::VectorXd step, multipliers, bounds;
  SparseQp::Outcome outcome = SparseQp::Outcome::failed;

  /// What is left of the optimality conditions; with a penalty, of the program with relaxed equations.
  double residual(const Data& qp) const {
    double worst = (qp.H * step + qp.g() + qp.J.transpose() * multipliers + bounds).lpNorm<Eigen::Infinity>();
    worst = std::max(worst, (qp.J * step + qp.c()).lpNorm<Eigen::Infinity>());
    for (int k = 0; k < qp.n; ++k) {
      worst = std::max({worst, qp.lower[k] - step[k], step[k] - qp.upper[k]});
      if (bounds[k] > 0.0) worst = std::max(worst, bounds[k] * (qp.upper[k] - step[k]));
      if (bounds[k] < 0.0) worst = std::max(worst, -bounds[k] * (step[k] - qp.lower[k]));
    }
    return worst;
  }
};
QpSolution start_of(const Data& qp) {
  return {Eigen::VectorXd::Zero(qp.n), Eigen::VectorXd::Zero(qp.m), Eigen::VectorXd::Zero(qp.n)};
}
QpSolution solve(SparseQp& qp, const Data& qp, bool is_convex = true) {
  QpSolution solution = start_of(qp);
  qp.take_structure(qp.nlp);
  solution.outcome = qp.solve(qp.view(is_convex), solution.step.data(), solution.multipliers.data(),
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

/// The least eigenvalue of the reduced Hessian where some variables do not move.
double least_reduced_eigenvalue(const Data& qp, const std::vector<std::uint8_t>& fixed) {
  Eigen::MatrixXd rows = Eigen::MatrixXd::Zero(qp.m + std::count(fixed.begin(), fixed.end(), 1), qp.n);
  rows.topRows(qp.m) = qp.J;
  Eigen::Index row = qp.m;
  for (int k = 0; k < qp.n; ++k)
    if (fixed[k] != 0) rows(row++, k) = 1.0;
  const Eigen::FullPivLU<Eigen::MatrixXd> lu(rows);
  EXPECT_EQ(lu.rank(), rows.rows()) << "what is fixed contradicts the equations";
  if (lu.dimensionOfKernel() == 0) return infinity;
  const Eigen::MatrixXd Z = lu.kernel();
  const Eigen::MatrixXd Q =
      Eigen::HouseholderQR<Eigen::MatrixXd>(Z).householderQ() * Eigen::MatrixXd::Identity(Z.rows(), Z.cols());
  return Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(Q.transpose() * qp.H * Q).eigenvalues()[0];
}

TEST(StageConvexity, TakesOverTheStagesThatBringTheNegativeCurvature) {
  RandomQp random(21);
  int bent = 0, untouched = 0, stages_seen = 0, stages_taken = 0;
  for (int trial = 0; trial < 200; ++trial) {
    const StageQp gauss_newton = random_stages(random);
    const int N = gauss_newton.intervals();
    StageQp exact = gauss_newton;
    const int from = random.integer(0, N), to = std::min(N, from + random.integer(0, 1));
    const double shift = random.uniform(0.0, 3.0);
    for (int i = from; i <= to; ++i) {
      exact.Q_of(i).diagonal().array() -= shift;
      exact.R_of(i).diagonal().array() -= shift;
    }
    const Data before(exact);
    std::vector<std::uint8_t> fixed(before.n, 0);
    // Controls, or states in place of them: of a node as many as there are controls that lead to it.
    std::ptrdiff_t variable = exact.initial_state_is_given ? 0 : exact.states(0);
    for (int i = 0; trial % 2 == 1 && i < N; ++i) {
      const bool is_state = random.uniform(0.0, 1.0) < 0.5;
      for (int j = 0; j < exact.controls(i); ++j)
        if (random.uniform(0.0, 1.0) < 0.4 && (!is_state || j < exact.states(i + 1)))
          fixed[variable + j + (is_state ? exact.controls(i) : 0)] = 1;
      variable += exact.controls(i) + exact.states(i + 1);
    }
    const double least = least_reduced_eigenvalue(before, fixed);
    if (std::abs(least) < 1e-4) continue;
    StageQp convex = exact;
    const int taken = convexify_by_stages(convex, gauss_newton, fixed);
    if (least > 0.0) {
      EXPECT_EQ(taken, 0) << trial;
      ++untouched;
    } else {
      EXPECT_GT(taken, 0) << trial;
      EXPECT_GT(least_reduced_eigenvalue(Data(convex), fixed), 0.0) << trial;
      ++bent;
      stages_seen += N + 1;
      stages_taken += taken;
    }
    int differ = 0;
    for (int i = 0; i <= N; ++i) {
      const bool is_exact = exact.Q_of(i) == convex.Q_of(i) &&
                            (i == N || (exact.S_of(i) == convex.S_of(i) && exact.R_of(i) == convex.R_of(i)));
      const bool is_gauss_newton =
          gauss_newton.Q_of(i) == convex.Q_of(i) &&
          (i == N || (gauss_newton.S_of(i) == convex.S_of(i) && gauss_newton.R_of(i) == convex.R_of(i)));
      EXPECT_TRUE(is_exact || is_gauss_newton) << trial << ", stage " << i;
      differ += is_exact ? 0 : 1;
    }
    EXPECT_LE(differ, taken);
  }
  EXPECT_GT(bent, 30);
  EXPECT_GT(untouched, 30);
  EXPECT_LT(2 * stages_taken, stages_seen) << "curvature was given up where there was no need";
}

TEST(SparseQp, SolvesRandomProgramsToTheirOptimalityConditions) {
  RandomQp random(6);
  SparseQp qp;
  int active = 0, by_interior_point = 0;
  for (int trial = 0; trial < 150; ++trial) {
    StageQp stages = random_stages(random);
    bound(stages, random, std::pow(10.0, random.uniform(-1.0, 0.5)), 4.0);
    const Data qp_data(stages);
    const QpSolution solution = solve(qp, qp);
    ASSERT_EQ(solution.outcome, SparseQp::Outcome::solved) << trial;
    EXPECT_LT(solution.residual(qp), 1e-8) << trial;
    active += (solution.bounds.array() != 0.0).any();
    by_interior_point += qp.used_interior_point();
    // Its own active set as the guess: one factorisation says that it is right.
    QpSolution again = solution;
    const int factorisations = qp.factorisations();
    again.outcome =
        qp.solve(qp.view(true), again.step.data(), again.multipliers.data(), again.bounds.data(), no_deadline);
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
    const Data qp_data(stages);
    if (solve(qp, qp).outcome == SparseQp::Outcome::solved) continue;
    ++infeasible;
    QpSolution solution = start_of(qp);
    const double penalty = 1e5;
    solution.outcome = qp.solve_relaxed(qp.view(true), penalty, solution.step.data(), solution.multipliers.data(),
                                        solution.bounds.data(), no_deadline);
    ASSERT_EQ(solution.outcome, SparseQp::Outcome::relaxed) << trial;
    const double reached = (qp.J * solution.step + qp.c()).lpNorm<1>();
    for (int k = 0; k < qp.n; ++k) {
      EXPECT_GE(solution.step[k], qp.lower[k] - 1e-9);
      EXPECT_LE(solution.step[k], qp.upper[k] + 1e-9);
    }
    // For every y with |y| <= 1 and every step within the bounds, |J d + c|_1 >= y'(J d + c): the least value over the
    // bounds' box is a limit that no step goes below. The multipliers give the best such y.
    const Eigen::VectorXd y = (solution.multipliers / penalty).cwiseMax(-1.0).cwiseMin(1.0),
                          slope = qp.J.transpose() * y;
    double limit = y.dot(qp.c());
    for (int k = 0; k < qp.n; ++k) limit += slope[k] * (slope[k] > 0.0 ? qp.lower[k] : qp.upper[k]);
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
    Data qp_data(random_stages(random));  // without bounds, which could help
    qp.shift_hessian(-random.uniform(0.0, 3.0));
    const double least = qp.least_reduced_eigenvalue();
    if (std::abs(least) < 1e-3) continue;
    const QpSolution solution = solve(qp, qp, false);
    if (least < 0.0) {
      ++indefinite;
      EXPECT_EQ(solution.outcome, SparseQp::Outcome::indefinite) << trial;
    } else {
      ASSERT_EQ(solution.outcome, SparseQp::Outcome::solved) << trial;
      EXPECT_LT(solution.residual(qp), 1e-7) << trial;
    }
  }
  EXPECT_GT(indefinite, 5);
}

TEST(SparseQp, KeepsADeadlineThatIsPast) {
  RandomQp random(9);
  StageQp stages = random.make(10, 4, 2, true);
  bound(stages, random, 0.05, 0.1);
  const Data qp_data(stages);
  SparseQp qp;
  qp.take_structure(qp.nlp);
  QpSolution solution = start_of(qp);
  EXPECT_EQ(qp.solve_relaxed(qp.view(true), 1e5, solution.step.data(), solution.multipliers.data(),
                             solution.bounds.data(), Clock::now() - std::chrono::seconds(1)),
            SparseQp::Outcome::deadline);
}

/// Solves with a solver that is set up for the problem, and holds the report against the core's own judgement.
Report solve_and_judge(Solver& solver, const HorizonProblem& problem, Iterate& point, double tolerance = 1e-8) {
  const Report report = solver.solve(point);
  StageQp qp(problem.capacity());
  std::vector<double> scratch(problem.scratch_size());
  EXPECT_EQ(kkt_residual(problem, point, qp, scratch).largest() <= tolerance, report.status == Status::solved)
      << name_of(report.status);
  const double objective = problem.evaluate(point, nullptr, scratch);  // summed in another order
  EXPECT_NEAR(report.objective, objective, 1e-12 * (1.0 + std::abs(objective)));
  return report;
}

/// The largest deviation of covariances from the core's recursion at a point, relative to the standard deviations.
double covariance_deviation(Solver& solver, const HorizonProblem& problem, const Iterate& point) {
  const int ns = problem.capacity().states, N = problem.intervals();
  const auto size = (static_cast<std::size_t>(N) + 1) * ns * ns;
  std::vector<double> blocks(size), reference(size), last(static_cast<std::size_t>(ns) * ns);
  if (!solver.covariances(point, all_stages(problem), blocks)) return infinity;
  StageQp qp(problem.capacity());
  std::vector<double> scratch(problem.scratch_size());
  problem.linearise(all_stages(problem), point, Hessian::gauss_newton, qp, scratch);
  Riccati riccati(problem.capacity());
  riccati.factor(qp, ActiveSet(problem.capacity()));
  riccati.covariances(qp, reference.data(), last.data());
  double worst = 0.0;
  for (std::ptrdiff_t i = 0; i <= N; ++i)
    for (int c = 0; c < ns; ++c)
      for (int r = 0; r < ns; ++r) {
        const double* block = reference.data() + i * ns * ns;
        const double size_of_entry = std::sqrt(block[r * ns + r] * block[c * ns + c]),
                     error = std::abs(blocks[i * ns * ns + c * ns + r] - block[c * ns + r]);
        // A given node is known: there is nothing to compare with but zero.
        worst = std::max(worst, size_of_entry > 0.0 ? error / size_of_entry : error);
      }
  return worst;
}

TEST(SparseSqp, CovariancesAreThoseOfTheRecursion) {
  double worst = 0.0;
  for (unsigned seed = 0; seed < 24; ++seed) {
    RheSpec spec;
    spec.intervals = 5 + 9 * static_cast<int>(seed % 5);
    spec.block = static_cast<int>(seed % 4);
    // A value for each interval that nothing links to its neighbours need not be determined.
    spec.linked = seed % 3 != 0 || spec.block == 1;
    spec.transition = seed % 2 == 0 ? Transition::step : Transition::ramp;
    spec.missing = seed % 5 == 0 ? 0.4 : 0.1;
    spec.robust = seed % 7 == 3;
    if (!spec.linked) spec.missing = 0.0;
    RandomProblem random(bicycle(), 100 + seed);
    const auto problem = random.rhe(spec);
    const auto solver = plugin();
    solver->setup(*problem);
    Iterate point = RandomProblem::cold_start(*problem);
    ASSERT_EQ(solve_and_judge(*solver, *problem, point).status, Status::solved) << seed;
    const double now = covariance_deviation(*solver, *problem, point);
    EXPECT_LT(now, 1e-6) << "seed " << seed;
    worst = std::max(worst, now);
  }
  std::printf("worst deviation %.1e standard deviations squared\n", worst);
}

TEST(SparseSqp, CovariancesOfAGivenStateAreZero) {
  RandomProblem random(bicycle(), 3);
  const auto problem = random.rhc({});
  const auto solver = plugin();
  solver->setup(*problem);
  Iterate point = RandomProblem::cold_start(*problem);
  ASSERT_EQ(solve_and_judge(*solver, *problem, point).status, Status::solved);
  const int ns = problem->capacity().states;
  std::vector<double> blocks(static_cast<std::size_t>(problem->intervals() + 1) * ns * ns, -1.0);
  ASSERT_TRUE(solver->covariances(point, all_stages(*problem), blocks));
  for (int k = 0; k < ns * ns; ++k) EXPECT_EQ(blocks[k], 0.0);
  EXPECT_GT(blocks[ns * ns], 0.0);
  // Room that is too small, and a point that is none, are refused, and nothing is written.
  std::vector<double> small(blocks.size() - 1, -1.0);
  EXPECT_FALSE(solver->covariances(point, all_stages(*problem), small));
  point.state(2)[0] = std::nan("");
  std::vector<double> untouched(blocks.size(), -1.0);
  EXPECT_FALSE(solver->covariances(point, all_stages(*problem), untouched));
  EXPECT_THAT(untouched, ::testing::Each(-1.0));
}

/// Masses in a row with springs and dampers between them; a force pulls the last one, and a wind (a parameter) all.
/// Positions of every second mass are measured. Linear: a step of Runge-Kutta is a polynomial of the matrix of the
/// rates.
class Chain final : public Model {
 public:
  static constexpr int masses = 35, states = 2 * masses;
  Chain() {
    about_.name = "chain";
    const auto add = [](std::vector<Variable>& variables, const std::string& name, double scale) {
      Variable variable;
      variable.name = name;
      variable.scale = scale;
      variables.push_back(variable);
    };
    for (int i = 0; i < masses; ++i) add(about_.states, "position" + std::to_string(i), 1.0);
    for (int i = 0; i < masses; ++i) add(about_.states, "speed" + std::to_string(i), 1.0);
    add(about_.inputs, "force", 1.0);
    add(about_.parameters, "wind", 0.1);
    for (int i = 0; i < masses; i += 2) add(about_.outputs, "measured" + std::to_string(i), 1.0);
    about_.inputs[0].lower = -2.0;
    about_.inputs[0].upper = 2.0;
    rates_ = Eigen::MatrixXd::Zero(states, states + 2);
    for (int i = 0; i < masses; ++i) {
      rates_(i, masses + i) = 1.0;
      for (const int j : {i - 1, i + 1}) {
        if (j >= masses) continue;
        rates_(masses + i, i) -= 4.0;
        rates_(masses + i, masses + i) -= 0.3;
        if (j < 0) continue;  // the wall
        rates_(masses + i, j) += 4.0;
        rates_(masses + i, masses + j) += 0.3;
      }
      rates_(masses + i, states + 1) = 1.0;
    }
    rates_(states - 1, states) = 1.0;
  }
  const ModelDescription& description() const noexcept override { return about_; }
  bool has_second_derivatives() const noexcept override { return true; }
  void rates(const double* x, const double* u, const double* p, double* dxdt) const noexcept override {
    Eigen::Map<Eigen::VectorXd>(dxdt, states) = rates_ * joined(x, u, p);
  }
  void integrate(const Intervals& request) const noexcept override {
    const int z = states + 2 + (request.parameters_end ? 1 : 0);
    for (std::ptrdiff_t i = 0; i < request.count; ++i) {
      const double h = request.durations[i] / request.substeps;
      const Eigen::MatrixXd A = rates_.leftCols(states), I = Eigen::MatrixXd::Identity(states, states),
                            series = I + h / 2.0 * A * (I + h / 3.0 * A * (I + h / 4.0 * A)), one = I + h * A * series;
      Eigen::MatrixXd total = Eigen::MatrixXd::Zero(states, z);
      total.leftCols(states) = I;
      for (int k = 0; k < request.substeps; ++k) {
        total = (one * total).eval();
        total.middleCols(states, 2) += h * series * rates_.rightCols(2);
      }
      if (request.next_states)
        Eigen::Map<Eigen::VectorXd>(request.next_states + i * states, states) =
            total.leftCols(states + 2) *
            joined(request.states + i * states, request.inputs + i, request.parameters + i);
      if (request.jacobians) Eigen::Map<Eigen::MatrixXd>(request.jacobians + i * states * z, states, z) = total;
      if (request.hessians) std::fill_n(request.hessians + i * z * z, z * z, 0.0);
    }
  }
  void observe(const Nodes& request) const noexcept override {
    const int ny = output_count();
    for (std::ptrdiff_t i = 0; i < request.count; ++i)
      for (int j = 0; j < ny; ++j) {
        if (request.outputs) request.outputs[i * ny + j] = request.states[i * states + 2 * j];
        if (request.jacobians)
          for (int c = 0; c < states; ++c) request.jacobians[(i * states + c) * ny + j] = c == 2 * j ? 1.0 : 0.0;
        if (request.hessians && j == 0) std::fill_n(request.hessians + i * states * states, states * states, 0.0);
      }
  }

 private:
  static Eigen::VectorXd joined(const double* x, const double* u, const double* p) {
    Eigen::VectorXd all(states + 2);
    all << Eigen::Map<const Eigen::VectorXd>(x, states), *u, *p;
    return all;
  }
  ModelDescription about_;
  Eigen::MatrixXd rates_;
};

TEST(SparseSqp, TakesAModelWiderThanTheDenseSolver) {
  const auto model = std::make_shared<Chain>();
  for (unsigned seed = 0; seed < 2; ++seed) {
    RandomProblem random(model, 20 + seed);
    RheSpec spec;
    spec.intervals = 30;
    spec.block = 5;
    spec.missing = 0.1;
    const auto rhe = random.rhe(spec);
    RhcSpec control;
    control.intervals = 25;
    const auto rhc = random.rhc(control);
    for (const HorizonProblem* problem :
         {static_cast<const HorizonProblem*>(rhe.get()), static_cast<const HorizonProblem*>(rhc.get())}) {
      EXPECT_THAT(host().make_solver("gn_rti", parse_yaml("{}", "test"))->why_not(*problem),
                  ::testing::HasSubstr(std::to_string(Riccati::max_width)));
      const auto solver = plugin();
      ASSERT_EQ(solver->why_not(*problem), "");
      solver->setup(*problem);
      Iterate point = RandomProblem::cold_start(*problem);
      EXPECT_EQ(solve_and_judge(*solver, *problem, point).status, Status::solved);
    }
  }
}

struct LongCase {
  std::unique_ptr<RheProblem> problem;
  Iterate guess;
};
/// A bicycle over many intervals with slip in blocks, and the true drive as the guess: no simulation from the prior
/// comes near so far from the start.
LongCase long_case(int intervals) {
  RandomProblem random(bicycle(), 7);
  RheSpec spec;
  spec.intervals = intervals;
  spec.block = 20;
  spec.missing = 0.1;
  Drive drive;
  spec.adjust = [&](RheProblem::Setup&, const Drive& true_drive) { drive = true_drive; };
  LongCase result;
  result.problem = random.rhe(spec);
  result.guess = Iterate(result.problem->capacity());
  result.problem->structure().set_decisions(result.guess, drive.inputs.data(), drive.parameters.data());
  const int nx = result.problem->model().state_count();
  for (std::ptrdiff_t i = 0; i <= intervals; ++i)
    std::copy_n(drive.states.data() + i * nx, nx, result.guess.state(static_cast<int>(i)));
  return result;
}

TEST(SparseSqp, TheFactorGrowsInProportionToTheHorizon) {
  std::vector<double> per_interval;
  for (const int intervals : {1000, 10000}) {
    const LongCase now = long_case(intervals);
    SparseNlp nlp;
    nlp.take_structure(*now.problem);
    KktFactor factor;
    factor.take_structure(nlp);
    per_interval.push_back(static_cast<double>(factor.entries()) / intervals);
  }
  std::printf("%.1f and %.1f entries an interval\n", per_interval[0], per_interval[1]);
  EXPECT_LT(per_interval[1], 1.05 * per_interval[0]);
}

TEST(SparseSqp, SolvesTenThousandIntervals) {
  LongCase now = long_case(10000);
  const auto solver = plugin();
  solver->setup(*now.problem);
  const Report report = solve_and_judge(*solver, *now.problem, now.guess);
  EXPECT_EQ(report.status, Status::solved) << name_of(report.status) << ' ' << report.kkt.largest();
  EXPECT_LT(covariance_deviation(*solver, *now.problem, now.guess), 1e-6);
}

TEST(SparseSqp, EveryHessianLeadsToTheSameOptimum) {
  for (const bool control : {false, true}) {
    RandomProblem random(bicycle(), 11);
    std::unique_ptr<HorizonProblem> problem;
    if (control) {
      RhcSpec spec;
      spec.off = 0.05;
      problem = random.rhc(spec);
    } else {
      RheSpec spec;
      spec.block = 4;
      problem = random.rhe(spec);
    }
    std::vector<double> objectives;
    for (const std::string name : {"gauss_newton", "exact", "auto"}) {
      const auto solver = plugin("{hessian: " + name + "}");
      solver->setup(*problem);
      Iterate point = RandomProblem::cold_start(*problem);
      const Report report = solve_and_judge(*solver, *problem, point);
      EXPECT_EQ(report.status, Status::solved) << name;
      objectives.push_back(report.objective);
    }
    for (const double objective : objectives) EXPECT_NEAR(objective, objectives[0], 1e-8 * (1.0 + objectives[0]));
  }
}

TEST(SparseSqp, RefusesAHessianThatTheModelHasNot) {
  RandomProblem random(std::make_shared<WithoutSecondDerivatives>(bicycle()), 12);
  const auto rhe = random.rhe({});
  const auto rhc = random.rhc({});
  EXPECT_EQ(plugin()->why_not(*rhe), "");
  EXPECT_THAT(plugin("{hessian: exact}")->why_not(*rhe), ::testing::HasSubstr("no second derivatives"));
  EXPECT_EQ(plugin()->why_not(*rhc), "");
  const auto solver = plugin();
  solver->setup(*rhe);
  Iterate point = RandomProblem::cold_start(*rhe);
  EXPECT_EQ(solve_and_judge(*solver, *rhe, point).status, Status::solved);
}

std::vector<double> numbers_of(const HorizonProblem& problem, const Iterate& point) {
  std::vector<double> all;
  const int ns = problem.capacity().states;
  for (int i = 0; i <= problem.intervals(); ++i) {
    all.insert(all.end(), point.state(i), point.state(i) + ns);
    all.insert(all.end(), point.costate(i), point.costate(i) + ns);
    if (i < problem.intervals()) all.insert(all.end(), point.control(i), point.control(i) + problem.control_count(i));
  }
  return all;
}

TEST(SparseSqp, IsRightAgainAfterFailures) {
  RandomProblem random(bicycle(), 13);
  RheSpec spec;
  spec.block = 4;
  const auto good = random.rhe(spec);
  // The vehicle has to move, and has no room.
  spec.adjust = [](RheProblem::Setup& setup, const Drive& drive) {
    const double x = drive.states[0], y = drive.states[1];
    setup.state_lower = {x - 0.1, y - 0.1, -infinity, -0.6};
    setup.state_upper = {x + 0.1, y + 0.1, infinity, 0.6};
    setup.input_lower = {1.0, -1.0};
    setup.input_upper = {2.0, 1.0};
    setup.parameter_lower = {0.5, 0.5};
    setup.parameter_upper = {1.0, 1.0};
  };
  const auto solver = plugin();
  solver->setup(*good);
  const Iterate start = RandomProblem::cold_start(*good);
  Iterate first = start;
  ASSERT_EQ(solve_and_judge(*solver, *good, first).status, Status::solved);
  const std::vector<double> expected = numbers_of(*good, first);

  const auto bad = random.rhe(spec);
  const Iterate bad_start = RandomProblem::cold_start(*bad);
  Iterate point = bad_start;
  solver->setup(*bad);
  EXPECT_EQ(solver->solve(point).status, Status::infeasible);
  EXPECT_EQ(numbers_of(*bad, point), numbers_of(*bad, bad_start)) << "the point was not left as it was";
  point = start;
  solver->setup(*good);
  EXPECT_EQ(solve_and_judge(*solver, *good, point).status, Status::solved);
  EXPECT_EQ(numbers_of(*good, point), expected);

  point = start;
  point.control(2)[0] = std::nan("");
  EXPECT_EQ(solver->solve(point).status, Status::bad_input);
  point = start;
  EXPECT_EQ(solver->solve(point, Clock::now() - std::chrono::seconds(1)).status, Status::deadline);
  EXPECT_TRUE(is_finite(*good, point));
  point = start;
  solver->reset();
  EXPECT_EQ(solver->solve(point).status, Status::solved);
  EXPECT_EQ(numbers_of(*good, point), expected);
}

TEST(SparseSqp, BoundsThatCrossAreInfeasible) {
  RandomProblem random(bicycle(), 14);
  const auto problem = random.rhc({});
  problem->input_lower(3, 0) = 1.2;
  problem->input_upper(3, 0) = 0.8;
  std::vector<double> scratch(problem->scratch_size());
  problem->finish(scratch);
  const auto solver = plugin();
  solver->setup(*problem);
  const Iterate start = RandomProblem::cold_start(*problem);
  Iterate point = start;
  EXPECT_EQ(solver->solve(point).status, Status::infeasible);
  EXPECT_EQ(numbers_of(*problem, point), numbers_of(*problem, start));
}

TEST(SparseSqp, TakesHorizonsOfNoneAndOfOneInterval) {
  for (const int intervals : {0, 1}) {
    for (unsigned seed = 0; seed < 5; ++seed) {
      RandomProblem random(bicycle(), 30 + seed);
      RheSpec spec;
      spec.intervals = intervals;
      spec.room = 3;
      const auto problem = random.rhe(spec);
      const auto solver = plugin();
      solver->setup(*problem);
      Iterate point = RandomProblem::cold_start(*problem);
      EXPECT_EQ(solve_and_judge(*solver, *problem, point).status, Status::solved) << intervals << ' ' << seed;
      EXPECT_LT(covariance_deviation(*solver, *problem, point), 1e-8) << intervals << ' ' << seed;
    }
  }
}

TEST(SparseSqp, StructuresThatChangeFromSolveToSolve) {
  const auto solver = plugin();
  for (int k = 0; k < 40; ++k) {
    RandomProblem random(bicycle(), 50 + k);
    RheSpec spec;
    spec.intervals = 3 + k % 9;
    spec.room = 12;
    spec.block = k % 4;
    spec.transition = k % 3 == 0 ? Transition::ramp : Transition::step;
    const auto problem = random.rhe(spec);
    solver->setup(*problem);
    Iterate point = RandomProblem::cold_start(*problem);
    EXPECT_EQ(solve_and_judge(*solver, *problem, point).status, Status::solved) << k;
    // Blocks that end, and then all as before.
    const RheProblem before = *problem;
    std::vector<std::uint8_t> begins(problem->intervals(), 0);
    for (int j = 0; j < 2; ++j) problem->set_blocks(j, begins.data(), Transition::step);
    problem->finish();
    point = RandomProblem::cold_start(*problem);
    EXPECT_EQ(solve_and_judge(*solver, *problem, point).status, Status::solved) << k;
    problem->take_data(before);
    point = RandomProblem::cold_start(*problem);
    EXPECT_EQ(solve_and_judge(*solver, *problem, point).status, Status::solved) << k;
  }
}

}  // namespace
}  // namespace rhec::sparse_sqp
