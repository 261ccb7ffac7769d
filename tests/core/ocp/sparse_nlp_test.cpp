// The sparse view holds the same numbers as the stages it is made of, and its patterns are valid at every point.

#include "rhec/core/ocp/sparse_nlp.hpp"

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>
#include <vector>

#include "rhec/core/ocp/solver.hpp"
#include "rhec/core/qp/stage_qp_views.hpp"
#include "rhec/plugins/host/host.hpp"
#include "support/limited_ocp.hpp"
#include "support/random_problem.hpp"

namespace rhec {
namespace sparse_nlp_test {

using testing::Limit;
using testing::LimitedOcp;
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
  explicit View(const Ocp& of) : problem(of), qp(of.capacity()), scratch(of.scratch_size()) {
    nlp.take_structure(problem);
    n = nlp.variables();
    m = nlp.constraints();
  }
  Eigen::VectorXd constraints(const Eigen::VectorXd& z, Iterate point) {
    nlp.write(problem, z.data(), nullptr, nullptr, point);
    std::vector<double> defects(static_cast<std::size_t>(problem.capacity().intervals) * problem.capacity().states);
    objective = problem.evaluate(point, defects.data(), scratch);
    std::vector<double> limits((static_cast<std::size_t>(problem.intervals()) + 1) * problem.capacity().limit_row());
    if (!limits.empty()) problem.evaluate_limits(point, limits.data(), scratch);
    Eigen::VectorXd c(m);
    nlp.constraints(problem, defects.data(), limits.empty() ? nullptr : limits.data(), c.data());
    return c;
  }
  const Ocp& problem;
  SparseNlp nlp;
  StageQp qp;
  std::vector<double> scratch;
  int n = 0, m = 0;
  double objective = 0.0;
};

/// Compares the view's derivatives with central differences of its functions.
void check_view(const Ocp& problem, const Iterate& start, RandomProblem& random) {
  View view(problem);
  Iterate point = start;
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
  c = view.constraints(z, point);
  Eigen::VectorXd of_linearisation = c;  // which has the defects alone
  view.nlp.constraints(view.qp, of_linearisation.data());
  EXPECT_LT((of_linearisation - c).cwiseAbs().maxCoeff(), 1e-12);

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

void check_view(const HorizonProblem& problem, RandomProblem& random) {
  check_view(problem, RandomProblem::cold_start(problem), random);
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

/// Limits of every kind, more and other ones from stage to stage: at node 0, on states alone, on controls alone, on
/// both, at the last node, and stages that have none.
void add_limits(const Ocp& on, LimitedOcp& limited) {
  const int N = on.intervals(), u = on.capacity().states;
  for (int i = 0; i <= N; ++i) {
    if (i % 4 == 3) continue;
    limited.add(i, {Limit::Kind::distance, {0, 1}, {0.3 * i, -0.4}, 0.5});
    limited.add(i, {Limit::Kind::linear, {1, 0}, {1.0, -0.3}, -2.0, 1.0, 10.0});
    if (i == N) break;
    limited.add(i, {Limit::Kind::product, {u, 2}, {0.7}, -1.0, 1.0, 0.0, 4.0});
    if (i % 2 == 1) limited.add(i, {Limit::Kind::squares, {u, u + 1}, {1.0, 0.5}, -infinity, 3.0});
  }
}

TEST(SparseNlp, HasTheDerivativesOfItsLimits) {
  RandomProblem random(bicycle(), 12);
  RandomProblem::RhcSpec of_control;
  of_control.intervals = 7;
  RandomProblem::RheSpec of_estimation;
  of_estimation.intervals = 6;
  of_estimation.block = 2;
  const std::unique_ptr<HorizonProblem> problems[] = {random.rhc(of_control), random.rhe(of_estimation)};
  for (const auto& problem : problems) {
    LimitedOcp limited(*problem, 4);
    add_limits(*problem, limited);
    check_view(limited, with_limits(limited, RandomProblem::cold_start(*problem)), random);
  }
}

TEST(SparseNlp, EqualStagesWithLimitsHaveThePatternsOfEachByItself) {
  // Stages that repeat the one before are written faster than others: the same flags, one stage after the other.
  RandomProblem random(bicycle(), 13);
  const auto problem = random.rhc({});
  for (const int first : {0, 1, 4}) {
    LimitedOcp limited(*problem, 3);
    int rows = 0;
    for (int i = first; i <= problem->intervals(); ++i, ++rows) limited.add(i, {Limit::Kind::linear, {0}, {1.0}, 0.0});
    limited.add(9, {Limit::Kind::linear, {1}, {1.0}, 0.0});
    SparseNlp nlp;
    nlp.take_structure(limited);
    ASSERT_EQ(nlp.constraints(), problem->intervals() * problem->capacity().states + rows + 1);
    for (int i = 1; i <= problem->intervals(); ++i) {
      const auto& J = nlp.jacobian();
      for (int c = 0; c < 2; ++c) {
        const int column = nlp.state_start(i) + c;
        const auto begin = J.row_indices.begin() + J.starts[column], end = J.row_indices.begin() + J.starts[column + 1];
        int of_limits = 0;
        for (int r = 0; r < nlp.limit_count(i); ++r)
          of_limits += static_cast<int>(std::count(begin, end, nlp.limit_start(i) + r));
        EXPECT_EQ(of_limits, c == 0 ? i >= first : i == 9) << "stage " << i << ", state " << c << " from " << first;
        if (of_limits > 0) {
          EXPECT_LT(*(end - 1), nlp.limit_start(i) + nlp.limit_count(i));
        }
      }
    }
  }
}

TEST(SparseNlp, LimitsGoThereAndBackWithTheirBounds) {
  RandomProblem random(bicycle(), 14);
  const auto problem = random.rhc({});
  LimitedOcp limited(*problem, 4);
  add_limits(*problem, limited);
  SparseNlp nlp;
  nlp.take_structure(limited);
  const auto signature = nlp.signature();
  Iterate point(limited.capacity()), back(limited.capacity());
  for (int i = 0; i <= problem->intervals(); ++i)
    for (int r = 0; r < limited.limit_count(i); ++r) point.limit_bound(i)[r] = random.normal();
  std::vector<double> multipliers(nlp.constraints()), z(nlp.variables());
  nlp.read(limited, point, z.data(), multipliers.data(), nullptr);
  nlp.write(limited, z.data(), multipliers.data(), nullptr, back);
  std::vector<double> lower(nlp.constraints(), 7.0), upper = lower, linear = lower, quadratic = lower;
  nlp.row_bounds(limited, lower.data(), upper.data(), linear.data(), quadratic.data());
  int rows = 0;
  for (int i = 0; i <= problem->intervals(); ++i) {
    ASSERT_EQ(nlp.limit_count(i), limited.limit_count(i));
    for (int r = 0; r < limited.limit_count(i); ++r, ++rows) {
      EXPECT_EQ(back.limit_bound(i)[r], point.limit_bound(i)[r]);
      const int row = nlp.limit_start(i) + r;
      EXPECT_EQ(lower[row], limited.limit_lower(i)[r]);
      EXPECT_EQ(upper[row], limited.limit_upper(i)[r]);
      EXPECT_EQ(linear[row], limited.limit_linear(i)[r]);
      EXPECT_EQ(quadratic[row], limited.limit_quadratic(i)[r]);
    }
  }
  EXPECT_EQ(rows, nlp.constraints() - problem->intervals() * problem->capacity().states);
  EXPECT_FALSE(nlp.take_structure(limited));
  limited.add(3, {Limit::Kind::linear, {0}, {1.0}, 0.0});
  EXPECT_TRUE(nlp.take_structure(limited));
  EXPECT_NE(nlp.signature(), signature);
}

TEST(SparseNlp, ASmallerPatternThanAllOnesIsStillEnough) {
  // Entries outside the pattern must be zero in the linearisation itself.
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
          EXPECT_EQ(A_of(qp, i)(r, c), 0.0) << i << " A " << r << "," << c;
          ++zeros;
        }
    for (int c = 0; c < problem->control_count(i); ++c)
      for (int r = 0; r < ns; ++r)
        if (!B[c * ns + r]) {
          EXPECT_EQ(B_of(qp, i)(r, c), 0.0) << i << " B " << r << "," << c;
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
    for (int r = 0; r < problem->state_count(1); ++r) expected += A_of(view.qp, 0)(r, j) * back.costate(1)[r];
    EXPECT_NEAR(back.costate(0)[j], expected, 1e-12 * (1.0 + std::abs(expected)));
  }
}

/// Estimation with blocks, and a controller, each at various points: within and beyond bounds, with multipliers.
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

/// Linearises a problem piece by piece in a window, and collects the whole; 9 marks entries that are not written.
struct InPieces {
  InPieces(const View& view, const Iterate& point, StageQp& window) {
    std::vector<double> scratch(view.problem.scratch_size());
    for (auto [vector, size] : {std::pair{&gradient, view.n}, {&constraints, view.m}}) vector->assign(size, 9.0);
    jacobian.assign(view.nlp.jacobian().entries(), 9.0);
    hessian.assign(view.nlp.hessian().entries(), 9.0);
    const int N = view.problem.intervals();
    for (int first = 0; first <= N; first += window.window()) {
      const StageRange piece{first, std::min(first + window.window() - 1, N)};
      window.look_at(first);
      objective += view.problem.linearise(piece, point, Hessian::exact, window, scratch);
      view.nlp.gradient(window, piece, gradient.data());
      view.nlp.constraints(window, piece, constraints.data());
      view.nlp.jacobian(window, piece, jacobian.data());
      view.nlp.hessian(window, piece, hessian.data());
    }
  }
  double objective = 0.0;
  std::vector<double> gradient, constraints, jacobian, hessian;
};

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
      StageQp window(problem->capacity(), size);
      EXPECT_EQ(window.window(), std::min(size, problem->capacity().intervals + 1));
      const InPieces pieces(view, point, window);
      EXPECT_NEAR(pieces.objective, objective, 1e-12 * std::abs(objective)) << size;
      EXPECT_EQ(pieces.gradient, gradient) << size;
      EXPECT_EQ(pieces.constraints, constraints) << size;
      EXPECT_EQ(pieces.jacobian, jacobian) << size;
      EXPECT_EQ(pieces.hessian, hessian) << size;
      Report report;
      assess(*problem, point, window, view.scratch, report);
      EXPECT_NEAR(report.objective, objective, 1e-12 * std::abs(objective)) << size;
      expect_same(report.kkt, kkt);
    }
  }
}

TEST(SparseNlp, AWindowHasNothingLeftOfWhatItHeldBefore) {
  // The same window over problems of one capacity, whose blocks start elsewhere: stages of other sizes follow in its
  // places, and what they do not use must be zero and free of bounds.
  RandomProblem random(bicycle(), 11);
  std::vector<std::unique_ptr<HorizonProblem>> problems;
  for (const int block : {0, 3, 2, 5, 1}) {
    RandomProblem::RheSpec spec;
    spec.intervals = 11;
    spec.block = block;
    spec.robust = block == 2;
    problems.push_back(random.rhe(spec));
  }
  for (const int size : {2, 3, 5}) {
    StageQp window(problems.front()->capacity(), size);
    for (const auto& problem : problems) {
      const View view(*problem);
      const Iterate point = random_point(*problem, random);
      StageQp unused(problem->capacity(), size);
      const InPieces again(view, point, window), once(view, point, unused);
      EXPECT_EQ(again.objective, once.objective) << size;
      EXPECT_EQ(again.gradient, once.gradient) << size;
      EXPECT_EQ(again.constraints, once.constraints) << size;
      EXPECT_EQ(again.jacobian, once.jacobian) << size;
      EXPECT_EQ(again.hessian, once.hessian) << size;
      std::vector<double> scratch(problem->scratch_size());
      Report of_window, of_unused;
      assess(*problem, point, window, scratch, of_window);
      assess(*problem, point, unused, scratch, of_unused);
      EXPECT_EQ(of_window.objective, of_unused.objective) << size;
      EXPECT_EQ(of_window.kkt.largest(), of_unused.kkt.largest()) << size;
      // All of the first stages' rows, used or not.
      for (StageQp* qp : {&window, &unused}) {
        qp->look_at(0);
        problem->linearise({0, size - 1}, point, Hessian::exact, *qp, scratch);
      }
      const std::ptrdiff_t stride = window.stride(), states = problem->capacity().states,
                           wide = states + problem->capacity().controls;
      const auto same = [&](const double* one, const double* other, std::ptrdiff_t rows) {
        return std::equal(one, one + size * rows * stride, other);
      };
      EXPECT_TRUE(same(window.AB(0), unused.AB(0), states)) << size;
      EXPECT_TRUE(same(window.H(0), unused.H(0), wide)) << size;
      EXPECT_TRUE(same(window.h(0), unused.h(0), 1)) << size;
      EXPECT_TRUE(same(window.b(0), unused.b(0), 1)) << size;
      EXPECT_TRUE(same(window.lower(0), unused.lower(0), 1)) << size;
      EXPECT_TRUE(same(window.upper(0), unused.upper(0), 1)) << size;
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

}  // namespace sparse_nlp_test
}  // namespace rhec
