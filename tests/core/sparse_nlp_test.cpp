// The sparse view holds the same numbers as the stages that it is made of, and its patterns hold at every point.

#include "rhec/core/sparse_nlp.hpp"

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include "random_problem.hpp"
#include "rhec/core/solver.hpp"
#include "rhec/plugins/host.hpp"

namespace rhec {
namespace {

using testing::RandomProblem;

std::shared_ptr<const Model> bicycle() {
  static const Host host;
  return host.make_model("bicycle_slip");
}

Eigen::MatrixXd dense(const SparseNlp::Pattern& pattern, const std::vector<double>& values) {
  Eigen::MatrixXd matrix = Eigen::MatrixXd::Zero(pattern.rows, pattern.columns);
  for (int c = 0; c < pattern.columns; ++c) {
    for (int k = pattern.starts[c]; k < pattern.starts[c + 1]; ++k) {
      if (k > pattern.starts[c]) {
        EXPECT_LT(pattern.row_indices[k - 1], pattern.row_indices[k]);
      }
      matrix(pattern.row_indices[k], c) = values[k];
    }
  }
  return matrix;
}

struct View {
  explicit View(const HorizonProblem& of) : problem(of), qp(of.capacity()), scratch(of.scratch_size()) {
    nlp.take_structure(problem);
    n = nlp.variables();
    m = nlp.constraints();
  }
  Eigen::VectorXd constraints(const Eigen::VectorXd& z, Iterate point) {
    nlp.write(problem, z.data(), nullptr, nullptr, point);
    std::vector<double> defects(static_cast<std::size_t>(problem.capacity().intervals) * problem.capacity().states);
    objective = problem.evaluate(point, defects.data(), scratch);
    Eigen::VectorXd c(m);
    nlp.constraints(problem, defects.data(), c.data());
    return c;
  }
  const HorizonProblem& problem;
  SparseNlp nlp;
  StageQp qp;
  std::vector<double> scratch;
  int n = 0, m = 0;
  double objective = 0.0;
};

/// Derivatives of the view against central differences of its own functions.
void check_view(const HorizonProblem& problem, RandomProblem& random) {
  View view(problem);
  Iterate point = RandomProblem::cold_start(problem);
  Eigen::VectorXd z(view.n), multipliers(view.m);
  view.nlp.read(problem, point, z.data(), nullptr, nullptr);
  for (double& value : z) value += 0.01 * random.normal();
  for (double& value : multipliers) value = random.normal();
  view.nlp.write(problem, z.data(), multipliers.data(), nullptr, point);
  problem.linearise(all_stages(problem), point, Hessian::exact, view.qp, view.scratch);
  std::vector<double> jacobian_values(view.nlp.jacobian().entries()), hessian_values(view.nlp.hessian().entries());
  view.nlp.jacobian(view.qp, jacobian_values.data());
  view.nlp.hessian(view.qp, hessian_values.data());
  const Eigen::MatrixXd J = dense(view.nlp.jacobian(), jacobian_values);
  Eigen::MatrixXd H = dense(view.nlp.hessian(), hessian_values);
  H.triangularView<Eigen::StrictlyUpper>() = H.transpose();
  Eigen::VectorXd g(view.n), c(view.m);
  view.nlp.gradient(view.qp, g.data());
  view.nlp.constraints(view.qp, c.data());
  EXPECT_LT((view.constraints(z, point) - c).cwiseAbs().maxCoeff(), 1e-12);

  const auto lagrangian_gradient = [&](const Eigen::VectorXd& at) {
    view.nlp.write(problem, at.data(), multipliers.data(), nullptr, point);
    problem.linearise(all_stages(problem), point, Hessian::gauss_newton, view.qp, view.scratch);
    std::vector<double> values(view.nlp.jacobian().entries());
    view.nlp.jacobian(view.qp, values.data());
    Eigen::VectorXd gradient(view.n);
    view.nlp.gradient(view.qp, gradient.data());
    return Eigen::VectorXd(gradient + dense(view.nlp.jacobian(), values).transpose() * multipliers);
  };
  const double h = 1e-5;
  for (int k = 0; k < view.n; ++k) {
    Eigen::VectorXd plus = z, minus = z;
    plus[k] += h;
    minus[k] -= h;
    const Eigen::VectorXd c_plus = view.constraints(plus, point);
    const double f_plus = view.objective;
    const Eigen::VectorXd c_minus = view.constraints(minus, point);
    EXPECT_LT(((c_plus - c_minus) / (2 * h) - J.col(k)).cwiseAbs().maxCoeff(), 1e-7) << "column " << k;
    EXPECT_NEAR((f_plus - view.objective) / (2 * h), g[k], 1e-5 * (1.0 + std::abs(g[k]))) << "column " << k;
    const Eigen::VectorXd column = (lagrangian_gradient(plus) - lagrangian_gradient(minus)) / (2 * h);
    EXPECT_LT((column - H.col(k)).cwiseAbs().maxCoeff(), 1e-5 * (1.0 + H.col(k).cwiseAbs().maxCoeff()))
        << "column " << k;
  }
}

TEST(SparseNlp, HasTheDerivativesOfItsFunctionsInEstimation) {
  for (const Transition transition : {Transition::step, Transition::ramp}) {
    RandomProblem random(bicycle(), 3);
    RandomProblem::RheSpec spec;
    spec.intervals = 5;
    spec.block = 2;
    spec.robust = true;
    spec.transition = transition;
    check_view(*random.rhe(spec), random);
  }
}

TEST(SparseNlp, HasTheDerivativesOfItsFunctionsInControl) {
  RandomProblem random(bicycle(), 4);
  RandomProblem::RhcSpec spec;
  spec.intervals = 5;
  spec.blocked_inputs = {1};
  check_view(*random.rhc(spec), random);
}

TEST(SparseNlp, ASmallerPatternThanAllOnesIsStillEnough) {
  // What is not marked must be zero in the linearisation itself.
  RandomProblem random(bicycle(), 5);
  RandomProblem::RheSpec spec;
  spec.intervals = 6;
  spec.block = 2;
  spec.transition = Transition::ramp;
  const auto problem = random.rhe(spec);
  Iterate point = RandomProblem::cold_start(*problem);
  StageQp qp(problem->capacity());
  std::vector<double> scratch(problem->scratch_size());
  problem->linearise(all_stages(*problem), point, Hessian::gauss_newton, qp, scratch);
  const int ns = problem->capacity().states;
  int zeros = 0;
  for (int i = 0; i < problem->intervals(); ++i) {
    std::vector<std::uint8_t> A(static_cast<std::size_t>(ns) * ns), B(ns * problem->capacity().controls);
    problem->mark_dynamics(i, A.data(), B.data());
    for (int c = 0; c < ns; ++c)
      for (int r = 0; r < ns; ++r)
        if (!A[c * ns + r]) {
          EXPECT_EQ(qp.A_of(i)(r, c), 0.0) << i << " A " << r << "," << c;
          ++zeros;
        }
    for (int c = 0; c < problem->control_count(i); ++c)
      for (int r = 0; r < ns; ++r)
        if (!B[c * ns + r]) {
          EXPECT_EQ(qp.B_of(i)(r, c), 0.0) << i << " B " << r << "," << c;
          ++zeros;
        }
  }
  EXPECT_GT(zeros, 50);
}

TEST(SparseNlp, PointsGoThereAndBack) {
  RandomProblem random(bicycle(), 6);
  const auto problem = random.rhc({});
  View view(*problem);
  Iterate point = RandomProblem::cold_start(*problem), back(problem->capacity());
  for (int i = 0; i <= problem->intervals(); ++i) {
    for (int j = 0; j < problem->state_count(i); ++j) {
      if (i > 0) point.costate(i)[j] = random.normal();
      if (i > 0) point.state_bound(i)[j] = random.normal();
    }
    for (int j = 0; i < problem->intervals() && j < problem->control_count(i); ++j)
      point.control_bound(i)[j] = random.normal();
  }
  Eigen::VectorXd z(view.n), multipliers(view.m), bounds(view.n);
  view.nlp.read(*problem, point, z.data(), multipliers.data(), bounds.data());
  view.nlp.write(*problem, z.data(), multipliers.data(), bounds.data(), back);
  for (int i = 0; i <= problem->intervals(); ++i) {
    for (int j = 0; j < problem->state_count(i); ++j) {
      EXPECT_EQ(point.state(i)[j], back.state(i)[j]);
      EXPECT_EQ(point.costate(i)[j], back.costate(i)[j]);
      EXPECT_EQ(point.state_bound(i)[j], back.state_bound(i)[j]);
    }
    for (int j = 0; i < problem->intervals() && j < problem->control_count(i); ++j) {
      EXPECT_EQ(point.control(i)[j], back.control(i)[j]);
      EXPECT_EQ(point.control_bound(i)[j], back.control_bound(i)[j]);
    }
  }
  // The costate of a given initial state is what makes the point stationary there.
  problem->linearise(all_stages(*problem), back, Hessian::gauss_newton, view.qp, view.scratch);
  SparseNlp::set_costate_0(view.qp, back);
  Iterate swept = back;
  set_costates(view.qp, swept);
  for (int j = 0; j < problem->state_count(0); ++j) {
    double expected = view.qp.q(0)[j];
    for (int r = 0; r < problem->state_count(1); ++r) expected += view.qp.A_of(0)(r, j) * back.costate(1)[r];
    EXPECT_NEAR(back.costate(0)[j], expected, 1e-12 * (1.0 + std::abs(expected)));
  }
}

/// Estimation with blocks and a controller, each at points of all kinds: within bounds and beyond, with multipliers.
std::vector<std::unique_ptr<HorizonProblem>> problems_to_judge(RandomProblem& random) {
  std::vector<std::unique_ptr<HorizonProblem>> problems;
  for (const int block : {0, 3}) {
    RandomProblem::RheSpec estimation;
    estimation.intervals = 11;
    estimation.block = block;
    estimation.robust = block > 0;
    problems.push_back(random.rhe(estimation));
  }
  problems.push_back(random.rhc({}));
  return problems;
}

Iterate random_point(const HorizonProblem& problem, RandomProblem& random) {
  Iterate point = RandomProblem::cold_start(problem);
  for (int i = 0; i <= problem.intervals(); ++i) {
    const bool is_given = i == 0 && problem.initial_state();
    for (int j = 0; j < problem.state_count(i) && !is_given; ++j) {
      point.state(i)[j] += 0.3 * random.normal();
      if (i > 0) point.costate(i)[j] = random.normal();
      point.state_bound(i)[j] = random.normal();
    }
    for (int j = 0; i < problem.intervals() && j < problem.control_count(i); ++j) {
      point.control(i)[j] += 0.3 * random.normal();
      point.control_bound(i)[j] = random.normal();
    }
  }
  return point;
}

void expect_same(const KktResidual& one, const KktResidual& other) {
  const auto near = [](double a, double b, const char* what) { EXPECT_NEAR(a, b, 1e-12 * (1.0 + a)) << what; };
  near(one.stationarity, other.stationarity, "stationarity");
  near(one.defect, other.defect, "defect");
  near(one.bound_violation, other.bound_violation, "bound violation");
  near(one.complementarity, other.complementarity, "complementarity");
}

TEST(SparseNlp, JudgesAsTheCoreDoes) {
  RandomProblem random(bicycle(), 8);
  for (const auto& problem : problems_to_judge(random)) {
    View view(*problem);
    for (int trial = 0; trial < 10; ++trial) {
      Iterate point = random_point(*problem, random);
      problem->linearise(all_stages(*problem), point, Hessian::none, view.qp, view.scratch);
      SparseNlp::set_costate_0(view.qp, point);
      Eigen::VectorXd z(view.n), multipliers(view.m), bounds(view.n), lower(view.n), upper(view.n), gradient(view.n),
          pull(view.n), constraints(view.m);
      view.nlp.read(*problem, point, z.data(), multipliers.data(), bounds.data());
      view.nlp.bounds(*problem, lower.data(), upper.data());
      view.nlp.gradient(view.qp, gradient.data());
      view.nlp.constraints(view.qp, constraints.data());
      std::vector<double> jacobian(view.nlp.jacobian().entries());
      view.nlp.jacobian(view.qp, jacobian.data());
      view.nlp.lagrangian_gradient(gradient.data(), jacobian.data(), multipliers.data(), pull.data());
      KktTerms terms;
      view.nlp.add_kkt({z.data(), lower.data(), upper.data(), constraints.data(), gradient.data(), pull.data(),
                        multipliers.data(), bounds.data()},
                       terms);
      terms.add(view.qp, point, {0, 0});  // for an initial state that is given
      const KktResidual whole = kkt_residual(view.qp, point);
      EXPECT_GT(whole.largest(), 1e-3);
      expect_same(terms.residual(), whole);
    }
    // What is no number is seen.
    KktTerms broken;
    Eigen::VectorXd zeros = Eigen::VectorXd::Zero(view.n), bad = zeros, rows = Eigen::VectorXd::Zero(view.m);
    bad[view.n / 2] = std::nan("");
    view.nlp.add_kkt(
        {zeros.data(), zeros.data(), zeros.data(), rows.data(), zeros.data(), bad.data(), rows.data(), zeros.data()},
        broken);
    EXPECT_TRUE(std::isnan(broken.residual().stationarity));
  }
}

TEST(SparseNlp, PiecesOfALinearisationAreThoseOfTheWhole) {
  RandomProblem random(bicycle(), 9);
  for (const auto& problem : problems_to_judge(random)) {
    View view(*problem);
    const Iterate point = random_point(*problem, random);
    const double objective = problem->linearise(all_stages(*problem), point, Hessian::exact, view.qp, view.scratch);
    const int N = problem->intervals(), entries = view.nlp.jacobian().entries(), bent = view.nlp.hessian().entries();
    std::vector<double> gradient(view.n), constraints(view.m), jacobian(entries), hessian(bent);
    view.nlp.gradient(view.qp, gradient.data());
    view.nlp.constraints(view.qp, constraints.data());
    view.nlp.jacobian(view.qp, jacobian.data());
    view.nlp.hessian(view.qp, hessian.data());
    const KktResidual kkt = kkt_residual(view.qp, point);
    for (const int size : {2, 3, 5, N, N + 1, N + 9}) {
      StageQp pieces(problem->capacity(), size);
      EXPECT_EQ(pieces.window(), std::min(size, problem->capacity().intervals + 1));
      std::vector<double> g(view.n, 9.0), c(view.m, 9.0), J(entries, 9.0), H(bent, 9.0);
      double sum = 0.0;
      for (int first = 0; first <= N; first += pieces.window()) {
        const StageRange piece{first, std::min(first + pieces.window() - 1, N)};
        pieces.look_at(first);
        sum += problem->linearise(piece, point, Hessian::exact, pieces, view.scratch);
        view.nlp.gradient(pieces, piece, g.data());
        view.nlp.constraints(pieces, piece, c.data());
        view.nlp.jacobian(pieces, piece, J.data());
        view.nlp.hessian(pieces, piece, H.data());
      }
      EXPECT_NEAR(sum, objective, 1e-12 * std::abs(objective)) << size;
      EXPECT_EQ(g, gradient) << size;
      EXPECT_EQ(c, constraints) << size;
      EXPECT_EQ(J, jacobian) << size;
      EXPECT_EQ(H, hessian) << size;
      Report report;
      judge(*problem, point, pieces, view.scratch, report);
      EXPECT_NEAR(report.objective, objective, 1e-12 * std::abs(objective)) << size;
      expect_same(report.kkt, kkt);
    }
  }
}

TEST(SparseNlp, TellsStructuresApart) {
  RandomProblem random(bicycle(), 7);
  RandomProblem::RheSpec spec;
  spec.intervals = 6;
  spec.block = 2;
  const auto problem = random.rhe(spec);
  SparseNlp nlp;
  EXPECT_TRUE(nlp.take_structure(*problem));
  EXPECT_FALSE(nlp.take_structure(*problem));
  const auto before = nlp.signature();
  std::vector<std::uint8_t> begins = {1, 0, 1, 0, 1, 0};
  problem->set_blocks(0, begins.data(), Transition::step);
  problem->finish();
  EXPECT_TRUE(nlp.take_structure(*problem));
  EXPECT_NE(nlp.signature(), before);
}

}  // namespace
}  // namespace rhec
