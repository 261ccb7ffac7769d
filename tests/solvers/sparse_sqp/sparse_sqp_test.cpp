// The solver for long horizons and wide models, against the core's recursion.
#include "solvers/sparse_sqp/sparse_sqp.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Dense>

#include "rhec/core/ocp/iterate_checks.hpp"
#include "rhec/core/qp/riccati.hpp"
#include "rhec/plugins/host/host.hpp"
#include "rhec/plugins/yaml/yaml.hpp"
#include "support/limited_ocp.hpp"
#include "support/random_problem.hpp"
#include "support/test_models.hpp"
#include "support/unstable.hpp"

namespace rhec::sparse_sqp {
namespace sparse_sqp_test {

using rhec::testing::Limit;
using rhec::testing::LimitedOcp;
using rhec::testing::RandomProblem;
using rhec::testing::unstable_control;
using rhec::testing::unstable_guess;
using rhec::testing::with_limits;
using rhec::testing::WithoutSecondDerivatives;
using Drive = RandomProblem::Drive;
using RheSpec = RandomProblem::RheSpec;
using RhcSpec = RandomProblem::RhcSpec;

constexpr double infinity = std::numeric_limits<double>::infinity();

const Host& host() {
  static const Host instance;
  return instance;
}
std::shared_ptr<const Model> bicycle() { return host().make_model("bicycle_slip"); }
std::shared_ptr<Solver> plugin(const std::string& options = "{}") {
  return host().make_solver("sparse_sqp", parse_yaml(options, "test"));
}

/// Solves with a solver that is set up for the problem, and holds the report against the core's own assessment.
Report solve_and_assess(Solver& solver, const HorizonProblem& problem, Iterate& point, double tolerance = 1e-8) {
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
    ASSERT_EQ(solve_and_assess(*solver, *problem, point).status, Status::solved) << seed;
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
  ASSERT_EQ(solve_and_assess(*solver, *problem, point).status, Status::solved);
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
      EXPECT_EQ(solve_and_assess(*solver, *problem, point).status, Status::solved);
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
  const Report report = solve_and_assess(*solver, *now.problem, now.guess);
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
      const Report report = solve_and_assess(*solver, *problem, point);
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
  EXPECT_EQ(solve_and_assess(*solver, *rhe, point).status, Status::solved);
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
  ASSERT_EQ(solve_and_assess(*solver, *good, first).status, Status::solved);
  const std::vector<double> expected = numbers_of(*good, first);

  const auto bad = random.rhe(spec);
  const Iterate bad_start = RandomProblem::cold_start(*bad);
  Iterate point = bad_start;
  solver->setup(*bad);
  EXPECT_EQ(solver->solve(point).status, Status::infeasible);
  EXPECT_EQ(numbers_of(*bad, point), numbers_of(*bad, bad_start)) << "the point was not left as it was";
  point = start;
  solver->setup(*good);
  EXPECT_EQ(solve_and_assess(*solver, *good, point).status, Status::solved);
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
      EXPECT_EQ(solve_and_assess(*solver, *problem, point).status, Status::solved) << intervals << ' ' << seed;
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
    EXPECT_EQ(solve_and_assess(*solver, *problem, point).status, Status::solved) << k;
    // Blocks that end, and then all as before.
    const RheProblem before = *problem;
    std::vector<std::uint8_t> begins(problem->intervals(), 0);
    for (int j = 0; j < 2; ++j) problem->set_blocks(j, begins.data(), Transition::step);
    problem->finish();
    point = RandomProblem::cold_start(*problem);
    EXPECT_EQ(solve_and_assess(*solver, *problem, point).status, Status::solved) << k;
    problem->take_data(before);
    point = RandomProblem::cold_start(*problem);
    EXPECT_EQ(solve_and_assess(*solver, *problem, point).status, Status::solved) << k;
  }
}

// Many rows that depend on each other at each node: which of them pull is not unique, so that the multipliers on an
// active set may have the wrong sign where those of the interior point have not.
TEST(SparseSqp, FindsMultipliersOfManyDependentLimits) {
  int solved = 0;
  for (unsigned seed = 300; seed < 400; ++seed) {
    RandomProblem random(bicycle(), seed);
    RhcSpec spec;
    spec.intervals = 20;
    spec.off = 0.2;
    const auto problem = random.rhc(spec);
    const Iterate start = RandomProblem::cold_start(*problem);
    const int inputs_at = problem->capacity().states;
    LimitedOcp limited(*problem, 4);
    std::mt19937 generator(seed);
    std::normal_distribution<double> normal;
    std::vector<double> rows[3];
    for (auto& row : rows)
      for (int j = 0; j < 6; ++j) row.push_back(normal(generator));
    for (int i = 0; i < spec.intervals; ++i) {
      // All hold at the start with equality, to either side.
      double z[6];
      std::copy_n(start.state(i), 4, z);
      std::copy_n(start.control(i), 2, z + 4);
      double first_side = 0.0;
      for (int k = 0; k < 4; ++k) {
        Limit limit;
        limit.of = {0, 1, 2, 3, inputs_at, inputs_at + 1};
        limit.with = rows[k % 3];
        double value = 0.0;
        for (int j = 0; j < 6; ++j) value += limit.with[j] * z[j];
        const double side = k == 3 ? first_side : normal(generator);
        if (k == 0) first_side = side;
        (side > 0.0 ? limit.upper : limit.lower) = value;
        limited.add(i, limit);
      }
    }
    const auto solver = plugin();
    solver->setup(limited);
    Iterate point = with_limits(limited, start);
    const Report report = solver->solve(point);
    solved += report.status == Status::solved && report.iterations < 60;
  }
  EXPECT_GE(solved, 98);  // of 100
}

/// What the guess leads to by simulation is so far from all limits that linearisations there lead nowhere.
TEST(SparseSqp, BeginsAgainAtARegulatorsTrajectory) {
  const int intervals = 60;
  const auto problem = unstable_control(intervals);
  const int u = problem->capacity().states;
  for (const double side : {0.5, 1.0}) {
    LimitedOcp limited(*problem, 2);
    for (int i = 1; i < intervals; ++i) {
      limited.add(i, {Limit::Kind::linear, {0, u}, {1.0, 0.5}, -side, side});
      limited.add(i, {Limit::Kind::product, {0, u}, {1.0}, -2.0, 2.0});
    }
    const auto solver = plugin();
    solver->setup(limited);
    Iterate point = with_limits(limited, unstable_guess(*problem));
    const Report report = solver->solve(point);
    EXPECT_EQ(report.status, Status::solved) << side << ": " << name_of(report.status);
    EXPECT_TRUE(report.fallback_used) << side;
    // What follows the reference costs some 20, and the guess many orders of magnitude more.
    EXPECT_LT(report.objective, 50.0) << side;
  }
}

}  // namespace sparse_sqp_test
}  // namespace rhec::sparse_sqp
