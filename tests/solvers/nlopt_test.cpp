// What the solver nlopt promises beyond the conformance of every solver.

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <thread>

#include "rhec/core/model/formula_model.hpp"
#include "rhec/core/ocp/solver.hpp"
#include "rhec/plugins/host/host.hpp"
#include "rhec/plugins/yaml/yaml.hpp"
#include "solvers/nlopt/active_set.hpp"
#include "solvers/nlopt/condensed.hpp"
#include "support/random_problem.hpp"
#include "support/test_models.hpp"

namespace rhec {
namespace {

using testing::Integrator;
using testing::RandomProblem;
using Vector = Eigen::VectorXd;
using Matrix = Eigen::MatrixXd;

const Host& host() {
  static const Host one;
  return one;
}
std::shared_ptr<Solver> nlopt_with(const std::string& options) {
  return host().make_solver("nlopt", parse_yaml(options, "options"));
}
std::shared_ptr<const Model> bicycle() { return host().make_model("bicycle_slip"); }

std::string error_of(const std::string& options) {
  try {
    nlopt_with(options);
  } catch (const Error& error) {
    return error.what();
  }
  return {};
}

/// A controller's problem that starts off its path, with limits of the steering rate that bind.
std::unique_ptr<RhcProblem> tight_control(RandomProblem& random, int intervals) {
  RandomProblem::RhcSpec spec;
  spec.intervals = intervals;
  spec.off = 0.4;
  auto problem = random.rhc(spec);
  for (int i = 0; i < intervals; ++i) {
    problem->input_lower(i, 1) = -0.1;
    problem->input_upper(i, 1) = 0.1;
  }
  std::vector<double> scratch(problem->scratch_size());
  problem->finish(scratch);
  return problem;
}

int bounds_held(const Ocp& ocp, const Iterate& point) {
  int held = 0;
  for (int i = 0; i <= ocp.intervals(); ++i) {
    for (int j = 0; j < ocp.state_count(i); ++j) held += std::abs(point.state_bound(i)[j]) > 1e-6;
    if (i == ocp.intervals()) break;
    for (int j = 0; j < ocp.control_count(i); ++j) held += std::abs(point.control_bound(i)[j]) > 1e-6;
  }
  return held;
}

/// x' = x^3 + u, which leaves the numbers within seconds where u is large.
struct Runaway : Integrator {
  template <class Scalar>
  void dynamics(const Scalar* x, const Scalar* u, const Scalar*, Scalar* dxdt) const {
    dxdt[0] = x[0] * x[0] * x[0] + u[0];
  }
};

struct Limits {
  std::vector<double> state_lower, state_upper, input_lower, input_upper;
};
template <class Formula = Integrator>
std::unique_ptr<RheProblem> integrator(int intervals, const Limits& limits) {
  ModelDescription about;
  about.name = "integrator";
  about.states = {{.name = "x", .unit = "m", .meaning = "position"}};
  about.inputs = {{.name = "u", .unit = "m/s", .meaning = "speed"}};
  about.outputs = {{.name = "y", .unit = "m", .meaning = "position"}};
  RheProblem::Setup setup;
  setup.max_intervals = std::max(intervals, 1);
  setup.output_weights = {1.0};
  setup.input_weights = {1.0};
  setup.state_lower = limits.state_lower;
  setup.state_upper = limits.state_upper;
  setup.input_lower = limits.input_lower;
  setup.input_upper = limits.input_upper;
  auto problem = std::make_unique<RheProblem>(std::make_shared<FormulaModel<Formula>>(Formula{}, about), setup);
  problem->set_intervals(intervals);
  problem->finish();
  problem->arrival_information(0, 0) = 1.0;
  for (int i = 0; i <= intervals; ++i) {
    problem->output(i)[0] = 0.5;
    if (i == intervals) break;
    problem->measured_input(i)[0] = 0.25;
    problem->set_duration(i, 1.0);
  }
  return problem;
}
const Limits unlimited = {{-HUGE_VAL}, {HUGE_VAL}, {-HUGE_VAL}, {HUGE_VAL}};
const Limits limited_inputs = {{-HUGE_VAL}, {HUGE_VAL}, {-1.0}, {1.0}};
const Limits limited_states = {{-2.0}, {2.0}, {-1.0}, {1.0}};

// -- The condensed problem ---------------------------------------------------------------------------------------

void check_derivatives(const Ocp& ocp, const Iterate& start) {
  nlopt::CondensedProblem problem(ocp);
  ASSERT_TRUE(problem.take(ocp));
  const Vector x = problem.read(start);
  ASSERT_TRUE(problem.move_to(x));
  const Vector gradient = problem.gradient();
  const Matrix jacobian = problem.jacobian();
  Vector multipliers = Vector::Zero(problem.variables() + problem.rows());
  for (Eigen::Index k = 0; k < problem.rows(); ++k) multipliers[problem.variables() + k] = 0.1 * std::sin(1.0 + k);
  problem.set_multipliers(multipliers);
  const Matrix hessian = problem.hessian(Hessian::exact);
  const auto lagrangian_gradient = [&] {
    return Vector(problem.gradient() + problem.jacobian().transpose() * multipliers.tail(problem.rows()));
  };
  const double step = 1e-5;
  for (Eigen::Index k = 0; k < problem.variables(); ++k) {
    Vector values[2], gradients[2];
    double objectives[2];
    for (const int side : {0, 1}) {
      Vector moved = x;
      moved[k] += side == 0 ? -step : step;
      ASSERT_TRUE(problem.move_to(moved));
      objectives[side] = problem.objective();
      values[side].resize(problem.rows());
      for (int row = 0; row < problem.rows(); ++row) values[side][row] = problem.row_value(row);
      gradients[side] = lagrangian_gradient();
    }
    const double scale = 1.0 + gradient.cwiseAbs().maxCoeff();
    EXPECT_NEAR((objectives[1] - objectives[0]) / (2.0 * step), gradient[k], 1e-6 * scale) << k;
    const Vector column = (values[1] - values[0]) / (2.0 * step);
    if (problem.rows() > 0) {
      EXPECT_LT((column - jacobian.col(k)).cwiseAbs().maxCoeff(), 1e-8) << k;
    }
    const Vector curvature = (gradients[1] - gradients[0]) / (2.0 * step);
    EXPECT_LT((curvature - hessian.col(k)).cwiseAbs().maxCoeff(), 1e-6 * (1.0 + hessian.cwiseAbs().maxCoeff())) << k;
  }
}

TEST(CondensedProblem, HasTheDerivativesThatDifferencesSay) {
  for (const int block : {0, 1, 3}) {
    RandomProblem random(bicycle(), 30U + static_cast<unsigned>(block));
    RandomProblem::RheSpec spec;
    spec.intervals = 7;
    spec.block = block;
    const auto rhe = random.rhe(spec);
    check_derivatives(*rhe, RandomProblem::cold_start(*rhe));
  }
  RandomProblem random(bicycle(), 34);
  RandomProblem::RhcSpec spec;
  spec.intervals = 8;
  spec.blocked_inputs = {1};
  const auto rhc = random.rhc(spec);
  check_derivatives(*rhc, RandomProblem::cold_start(*rhc));
}

TEST(CondensedProblem, SharesOneSimulationAndOneLinearisationAtAPoint) {
  RandomProblem random(bicycle(), 35);
  const auto ocp = random.rhc({});
  nlopt::CondensedProblem problem(*ocp);
  ASSERT_TRUE(problem.take(*ocp));
  const Vector x = problem.read(RandomProblem::cold_start(*ocp));
  problem.move_to(x);
  problem.gradient();
  problem.move_to(x);
  problem.jacobian();
  problem.gradient();
  EXPECT_EQ(problem.simulations(), 1);
  EXPECT_EQ(problem.linearisations(), 1);
  problem.move_to(x + Vector::Constant(x.size(), 1e-3));
  problem.gradient();
  EXPECT_EQ(problem.simulations(), 2);
  EXPECT_EQ(problem.linearisations(), 2);
}

TEST(CondensedProblem, LeavesOutWhatItsBoundsFix) {
  RandomProblem random(bicycle(), 36);
  const auto ocp = random.rhc({});
  nlopt::CondensedProblem problem(*ocp);
  ASSERT_TRUE(problem.take(*ocp));
  const int before = problem.variables();
  ocp->input_lower(3, 0) = ocp->input_upper(3, 0) = 0.7;
  std::vector<double> scratch(ocp->scratch_size());
  ocp->finish(scratch);
  ASSERT_TRUE(problem.take(*ocp));
  EXPECT_EQ(problem.variables(), before - 1);
  problem.move_to(problem.read(RandomProblem::cold_start(*ocp)));
  EXPECT_EQ(problem.point().control(3)[0], 0.7);
}

TEST(ActiveSet, SolvesAProgramWithKnownMultipliers) {
  // min (x-2)^2 + (y-2)^2 with x <= 1 and x + y <= 2.5: x = 1, y = 1.5, multipliers 1 and 1.
  const Vector gradient = Vector::Constant(2, -4.0);
  const Matrix jacobian = Matrix::Ones(1, 2), hessian = 2.0 * Matrix::Identity(2, 2);
  const nlopt::CondensedQp qp{gradient, jacobian, Vector::Constant(3, -HUGE_VAL), Eigen::Vector3d(1.0, HUGE_VAL, 2.5)};
  Vector step, multipliers = Vector::Zero(3);
  ASSERT_TRUE(nlopt::solve_active_set(qp, hessian, step, multipliers));
  EXPECT_NEAR(step[0], 1.0, 1e-12);
  EXPECT_NEAR(step[1], 1.5, 1e-12);
  EXPECT_NEAR(multipliers[0], 1.0, 1e-12);
  EXPECT_NEAR(multipliers[1], 0.0, 1e-12);
  EXPECT_NEAR(multipliers[2], 1.0, 1e-12);
  // The same multipliers from the gradient at the solution alone.
  const Vector there = gradient + hessian * step;
  const nlopt::CondensedQp solved{there, jacobian, Vector::Constant(3, -HUGE_VAL), Eigen::Vector3d(0.0, HUGE_VAL, 0.0)};
  const Vector found = nlopt::recover_multipliers(solved, Vector::Ones(2), 1e-9);
  EXPECT_LT((found - multipliers).cwiseAbs().maxCoeff(), 1e-12);
}

TEST(ActiveSet, SaysNoToCurvatureThatIsNotPositive) {
  const Vector gradient = Vector::Constant(1, 1.0);
  const Matrix jacobian(0, 1), hessian = -Matrix::Identity(1, 1);
  const nlopt::CondensedQp qp{gradient, jacobian, Vector::Constant(1, -HUGE_VAL), Vector::Constant(1, HUGE_VAL)};
  Vector step, multipliers = Vector::Zero(1);
  EXPECT_FALSE(nlopt::solve_active_set(qp, hessian, step, multipliers));
}

// -- Solutions -----------------------------------------------------------------------------------------------------

TEST(Nlopt, AgreesWithGnRtiOnSolutionsAndMultipliersAtActiveBounds) {
  int compared = 0, held = 0;
  for (unsigned seed = 40; seed < 60; ++seed) {
    RandomProblem random(bicycle(), seed);
    const auto problem = tight_control(random, 15);
    const auto reference = host().make_solver("gn_rti", parse_yaml("{mode: converge}", "options"));
    reference->setup(*problem);
    Iterate expected = RandomProblem::cold_start(*problem);
    const Report before = reference->solve(expected);
    if (before.status != Status::solved) continue;
    const auto solver = nlopt_with("{}");
    solver->setup(*problem);
    Iterate point = RandomProblem::cold_start(*problem);
    const Report report = solver->solve(point);
    EXPECT_EQ(report.status, Status::solved) << seed << ": " << name_of(report.status);
    EXPECT_LT(report.kkt.largest(), 1e-8) << seed;
    // Another optimum is a fair answer, but says nothing about multipliers.
    if (std::abs(report.objective - before.objective) > 1e-7 * (1.0 + std::abs(before.objective))) continue;
    ++compared;
    held += bounds_held(*problem, point);
    double largest = 0.0;
    for (int i = 1; i <= problem->intervals(); ++i)
      for (int j = 0; j < problem->state_count(i); ++j) largest = std::max(largest, std::abs(expected.costate(i)[j]));
    const double allowed = 1e-5 * (1.0 + largest);
    for (int i = 0; i <= problem->intervals(); ++i) {
      for (int j = 0; j < problem->state_count(i); ++j) {
        EXPECT_NEAR(point.state(i)[j], expected.state(i)[j], 1e-5) << seed;
        EXPECT_NEAR(point.costate(i)[j], expected.costate(i)[j], allowed) << seed;
        EXPECT_NEAR(point.state_bound(i)[j], expected.state_bound(i)[j], allowed) << seed;
      }
      if (i == problem->intervals()) break;
      for (int j = 0; j < problem->control_count(i); ++j)
        EXPECT_NEAR(point.control_bound(i)[j], expected.control_bound(i)[j], allowed) << seed;
    }
  }
  EXPECT_GT(compared, 10);
  EXPECT_GT(held, 10) << "no bound was active, so nothing was compared";
}

TEST(Nlopt, IsAccurateWithoutThePolishToo) {
  for (unsigned seed = 60; seed < 66; ++seed) {
    RandomProblem random(bicycle(), seed);
    RandomProblem::RheSpec spec;
    spec.block = 4;
    const auto problem = random.rhe(spec);
    const auto solver = nlopt_with("{polish: false}");
    solver->setup(*problem);
    Iterate point = RandomProblem::cold_start(*problem);
    const Report report = solver->solve(point);
    EXPECT_EQ(report.status, Status::solved) << seed << ": " << name_of(report.status);
  }
}

TEST(Nlopt, SaysSolvedOnlyWithinTheTolerance) {
  RandomProblem random(bicycle(), 67);
  const auto problem = tight_control(random, 15);
  for (const char* options : {"{tolerance: 1.0e-16}", "{polish: false, restarts: 0, ftol_rel: 0.1}"}) {
    const auto solver = nlopt_with(options);
    solver->setup(*problem);
    Iterate point = RandomProblem::cold_start(*problem);
    const Report report = solver->solve(point);
    EXPECT_EQ(report.status, Status::stalled) << options << ": " << name_of(report.status);
    EXPECT_TRUE(point.is_finite());
  }
}

TEST(Nlopt, DoesAsManyIterationsAsItMayAndNoMore) {
  RandomProblem random(bicycle(), 67);
  const auto problem = tight_control(random, 15);
  const auto unlimited_one = nlopt_with("{}");
  unlimited_one->setup(*problem);
  Iterate solution = RandomProblem::cold_start(*problem);
  const Report whole = unlimited_one->solve(solution);
  ASSERT_EQ(whole.status, Status::solved);
  ASSERT_GT(whole.iterations, 3);
  for (const int most : {1, 2, 3, whole.iterations - 1}) {
    const auto solver = nlopt_with("{max_iterations: " + std::to_string(most) + "}");
    solver->setup(*problem);
    Iterate point = RandomProblem::cold_start(*problem);
    const Report report = solver->solve(point);
    EXPECT_EQ(report.status, Status::iteration_limit) << most << ": " << name_of(report.status);
    EXPECT_EQ(report.iterations, most);
  }
  // Simulations count where there are no derivatives.
  const auto solver = nlopt_with("{algorithm: LN_COBYLA, polish: false, max_iterations: 40}");
  solver->setup(*problem);
  Iterate point = RandomProblem::cold_start(*problem);
  const Report report = solver->solve(point);
  EXPECT_EQ(report.status, Status::iteration_limit) << name_of(report.status);
  EXPECT_EQ(report.iterations, 40);
}

TEST(Nlopt, TriesSmallerControlsWhereThoseOfTheGuessLeaveTheNumbers) {
  const auto problem = integrator<Runaway>(5, unlimited);
  const auto solver = nlopt_with("{}");
  solver->setup(*problem);
  Iterate expected(problem->capacity());
  ASSERT_EQ(solver->solve(expected).status, Status::solved);
  nlopt::CondensedProblem condensed(*problem);
  ASSERT_TRUE(condensed.take(*problem));
  // A few halvings will do for the first guess; the second is too large for any number of them that is tried.
  for (const double input : {8.0, 1e4}) {
    Iterate point(problem->capacity());
    for (int i = 0; i < problem->intervals(); ++i) point.control(i)[0] = input;
    ASSERT_FALSE(condensed.move_to(condensed.read(point))) << input << " can be simulated, so nothing is tested";
    const Report report = solver->solve(point);
    EXPECT_EQ(report.status, Status::solved) << input << ": " << name_of(report.status);
    for (int i = 0; i <= problem->intervals(); ++i) EXPECT_NEAR(point.state(i)[0], expected.state(i)[0], 1e-6) << input;
  }
  // A first state that no control saves.
  Iterate lost(problem->capacity());
  lost.state(0)[0] = 1e6;
  const Report report = solver->solve(lost);
  EXPECT_EQ(report.status, Status::stalled) << name_of(report.status);
  EXPECT_TRUE(std::isfinite(report.objective));
  EXPECT_EQ(lost.state(0)[0], 1e6);
  for (int i = 1; i <= problem->intervals(); ++i) EXPECT_EQ(lost.state(i)[0], 0.0);
}

/// Multipliers of some thousands: a bound violated within the tolerance then is worth a residual beyond it.
TEST(Nlopt, MeetsAnyToleranceWhereMultipliersAreLarge) {
  Limits limits = limited_states;
  limits.state_upper = {0.25};
  const auto problem = integrator(10, limits);
  for (int i = 0; i <= 10; ++i) problem->output(i)[0] = 2000.0;
  for (const char* tolerance : {"1.0e-3", "1.0e-5", "1.0e-6", "1.0e-7", "1.0e-8"}) {
    const auto solver = nlopt_with(std::string("{tolerance: ") + tolerance + "}");
    solver->setup(*problem);
    Iterate point(problem->capacity());
    const Report report = solver->solve(point);
    EXPECT_EQ(report.status, Status::solved) << tolerance << ": " << report.kkt.largest();
    EXPECT_GT(bounds_held(*problem, point), 5) << tolerance;
  }
}

TEST(Nlopt, TakesHorizonsOfNoIntervalAndOfOne) {
  for (const int intervals : {0, 1}) {
    const auto problem = integrator(intervals, limited_states);
    const auto solver = nlopt_with("{}");
    solver->setup(*problem);
    Iterate point(problem->capacity());
    point.state(0)[0] = 1.5;
    const Report report = solver->solve(point);
    EXPECT_EQ(report.status, Status::solved) << intervals;
    // Without an interval: (x - 0)^2 + (x - 0.5)^2.
    if (intervals == 0) {
      EXPECT_NEAR(point.state(0)[0], 0.25, 1e-8);
    }
  }
}

TEST(Nlopt, HoldsBoundsThatAreEqual) {
  // All states fixed beyond node 0, and s_0 with them: nothing is left to decide but x = 0.5, u = 0.
  Limits limits = limited_states;
  limits.state_lower = limits.state_upper = {0.5};
  const auto problem = integrator(4, limits);
  const auto solver = nlopt_with("{}");
  solver->setup(*problem);
  Iterate point(problem->capacity());
  const Report report = solver->solve(point);
  EXPECT_EQ(report.status, Status::solved) << name_of(report.status) << ' ' << report.kkt.largest();
  for (int i = 0; i <= 4; ++i) EXPECT_NEAR(point.state(i)[0], 0.5, 1e-9);
  limits = limited_states;
  limits.input_lower = limits.input_upper = {0.125};
  const auto fixed_inputs = integrator(4, limits);
  Iterate other(fixed_inputs->capacity());
  solver->setup(*fixed_inputs);
  EXPECT_EQ(solver->solve(other).status, Status::solved);
  for (int i = 0; i < 4; ++i) EXPECT_EQ(other.control(i)[0], 0.125);
}

TEST(Nlopt, LeavesThePointOfAnInfeasibleProblemAlone) {
  Limits limits = limited_states;
  limits.input_lower = {2.0};
  limits.input_upper = {3.0};
  const auto problem = integrator(10, limits);
  const auto solver = nlopt_with("{}");
  solver->setup(*problem);
  Iterate point = RandomProblem::cold_start(*problem);
  const Iterate before = point;
  EXPECT_EQ(solver->solve(point).status, Status::infeasible);
  for (int i = 0; i <= 10; ++i) EXPECT_EQ(point.state(i)[0], before.state(i)[0]);
}

// -- Algorithms ----------------------------------------------------------------------------------------------------

TEST(Nlopt, RefusesWhatAnAlgorithmCannotTake) {
  const auto states = integrator(5, limited_states), inputs = integrator(5, limited_inputs),
             free = integrator(5, unlimited);
  Limits fixed_limits = limited_states;
  fixed_limits.state_lower = fixed_limits.state_upper = {0.5};
  const auto fixed = integrator(5, fixed_limits);
  struct Case {
    const char* options;
    const Ocp* problem;
    const char* reason;  // a part of it; empty: taken
  };
  const Case cases[] = {
      {"{}", states.get(), ""},
      {"{algorithm: LD_MMA}", states.get(), ""},
      {"{algorithm: LD_CCSAQ}", states.get(), ""},
      {"{algorithm: LN_COBYLA}", states.get(), ""},
      {"{algorithm: LD_AUGLAG}", states.get(), ""},
      {"{algorithm: LD_LBFGS}", states.get(), "LD_LBFGS takes no inequality constraints"},
      {"{algorithm: LD_LBFGS}", inputs.get(), ""},
      {"{algorithm: LD_MMA}", fixed.get(), "LD_MMA takes no equality constraints"},
      {"{algorithm: LD_SLSQP}", fixed.get(), ""},
      {"{algorithm: LN_NEWUOA}", inputs.get(), "LN_NEWUOA takes no bounds"},
      {"{algorithm: LN_NEWUOA}", free.get(), ""},
      {"{algorithm: GN_DIRECT_L}", inputs.get(), "some decisions unbounded"},  // s_0 is
      {"{algorithm: GN_ISRES}", states.get(), ""},
      {"{algorithm: GN_CRS2_LM}", states.get(), "takes no inequality constraints"},
      {"{algorithm: AUGLAG_EQ, local_algorithm: LD_LBFGS}", states.get(), "leaves inequality constraints"},
      {"{max_variables: 5}", states.get(), "6 decision variables, more than max_variables: 5"},
  };
  for (const Case& each : cases) {
    const std::string reason = nlopt_with(each.options)->why_not(*each.problem);
    if (std::string(each.reason).empty()) {
      EXPECT_EQ(reason, "") << each.options;
    } else {
      EXPECT_NE(reason.find(each.reason), std::string::npos) << each.options << ": " << reason;
    }
  }
  const std::string reason = nlopt_with("{algorithm: LD_LBFGS}")->why_not(*states);
  for (const char* name : {"LD_SLSQP", "LD_MMA", "LN_COBYLA"}) EXPECT_NE(reason.find(name), std::string::npos);
}

TEST(Nlopt, SaysWhatIsWrongWithItsOptions) {
  EXPECT_NE(error_of("{algorithm: LD_SLSPQ}").find("LD_SLSQP"), std::string::npos);
  EXPECT_NE(error_of("{algorithm: LD_LBFGS, scaling: full}").find("diagonal"), std::string::npos);
  EXPECT_NE(error_of("{algorithm: AUGLAG, local_algorithm: G_MLSL}").find("local_algorithm"), std::string::npos);
  EXPECT_NE(error_of("{native: {verbosity: 1}}").find("prints nothing"), std::string::npos);
  EXPECT_NE(error_of("{native: {inner_maxeval: many}}").find("options:1"), std::string::npos);
}

/// Every algorithm that takes the problem gets close to its optimum, on its own.
TEST(Nlopt, EveryAlgorithmThatTakesAProblemComesClose) {
  Limits box = limited_states;
  const auto bounded = integrator(3, box), free = integrator(3, unlimited);
  int used = 0;
  std::string names;
  for (const OptionRow& row : host().options(PluginKind::solver, "nlopt"))
    if (row.name == "algorithm") names = row.constraint;
  for (std::size_t at = names.find("one of ") + 7; at < names.size();) {
    const std::size_t end = std::min(names.find(", ", at), names.size());
    const std::string name = names.substr(at, end - at);
    at = end + 2;
    for (const Ocp* problem : {static_cast<const Ocp*>(bounded.get()), static_cast<const Ocp*>(free.get())}) {
      const auto solver =
          nlopt_with("{polish: false, restarts: 0, tolerance: 1.0e-6, max_iterations: 20000, algorithm: " + name +
                     ", local_algorithm: " + (name[0] == 'L' ? "LN_COBYLA" : "LD_SLSQP") + "}");
      if (!solver->why_not(*problem).empty()) continue;
      const auto exact = nlopt_with("{}");
      exact->setup(*problem);
      Iterate expected(problem->capacity());
      const double optimum = exact->solve(expected).objective;
      solver->setup(*problem);
      Iterate point(problem->capacity());
      point.state(0)[0] = -1.0;
      const Report report = solver->solve(point, Clock::now() + std::chrono::seconds(2));
      EXPECT_LT(report.objective, optimum + 1e-2) << name << ": " << name_of(report.status);
      EXPECT_GE(report.objective, optimum - 1e-6) << name;
      EXPECT_LT(report.kkt.bound_violation, 1e-6) << name;
      EXPECT_GT(report.iterations, 1) << name;
      ++used;
    }
  }
  EXPECT_GT(used, 30);
}

TEST(Nlopt, AnotherAlgorithmSolvesAVehiclesProblem) {
  RandomProblem random(bicycle(), 70);
  const auto problem = random.rhc({});
  const auto exact = nlopt_with("{}");
  exact->setup(*problem);
  Iterate expected = RandomProblem::cold_start(*problem);
  const Report best = exact->solve(expected);
  ASSERT_EQ(best.status, Status::solved);
  for (const char* name : {"LD_MMA", "LD_CCSAQ", "LD_AUGLAG"}) {
    const auto solver = nlopt_with(std::string("{polish: false, algorithm: ") + name + "}");
    solver->setup(*problem);
    Iterate point = RandomProblem::cold_start(*problem);
    const Report report = solver->solve(point);
    EXPECT_NEAR(report.objective, best.objective, 1e-4 * (1.0 + std::abs(best.objective))) << name;
    EXPECT_NE(report.iterations, best.iterations) << name << " went the very way of LD_SLSQP";
  }
}

// -- Behaviour -----------------------------------------------------------------------------------------------------

TEST(Nlopt, StopsAtADeadlineInTheMiddleWithTheBestSoFar) {
  RandomProblem random(bicycle(), 80);
  RandomProblem::RheSpec spec;
  spec.intervals = 150;
  spec.block = 3;
  const auto problem = random.rhe(spec);
  const auto solver = nlopt_with("{}");
  solver->setup(*problem);
  Iterate point = RandomProblem::cold_start(*problem);
  std::vector<double> scratch(problem->scratch_size());
  const double before = problem->evaluate(point, nullptr, scratch);
  const auto start = Clock::now();
  const Report report = solver->solve(point, start + std::chrono::milliseconds(200));
  const double seconds = std::chrono::duration<double>(Clock::now() - start).count();
  EXPECT_EQ(report.status, Status::deadline) << name_of(report.status);
  EXPECT_TRUE(point.is_finite());
  EXPECT_LE(report.objective, before);
  EXPECT_LT(seconds, 10.0) << "one iteration of a dense method may pass the deadline, no more";
}

TEST(Nlopt, FollowsAStructureThatChanges) {
  RandomProblem random(bicycle(), 81);
  RandomProblem::RheSpec spec;
  spec.block = 4;
  const auto problem = random.rhe(spec);
  const auto solver = nlopt_with("{}");
  solver->setup(*problem);
  for (const int shift : {0, 1, 2, 3}) {
    std::vector<std::uint8_t> begins(static_cast<std::size_t>(problem->intervals()), 0);
    for (std::size_t i = 0; i < begins.size(); ++i) begins[i] = (static_cast<int>(i) + shift) % 4 == 0;
    begins[0] = 1;
    for (int j = 0; j < 2; ++j) problem->set_blocks(j, begins.data(), Transition::step);
    problem->finish();
    Iterate point = RandomProblem::cold_start(*problem);
    EXPECT_EQ(solver->solve(point).status, Status::solved) << shift;
  }
}

/// One problem on two threads at once, each answer to the bit that of one alone.
void expect_undisturbed(const Ocp& problem, const Iterate& start, const std::string& options) {
  const auto alone = nlopt_with(options);
  alone->setup(problem);
  Iterate expected = start;
  alone->solve(expected);
  int wrong[2] = {0, 0};
  const auto work = [&](int which) {
    const auto solver = nlopt_with(options);
    solver->setup(problem);
    for (int repeat = 0; repeat < 10; ++repeat) {
      Iterate point = start;
      solver->solve(point);
      for (int i = 0; i < problem.intervals(); ++i)
        wrong[which] += std::memcmp(point.control(i), expected.control(i),
                                    sizeof(double) * static_cast<std::size_t>(problem.control_count(i))) != 0;
    }
  };
  std::thread one(work, 0), other(work, 1);
  one.join();
  other.join();
  EXPECT_EQ(wrong[0] + wrong[1], 0) << options;
}

TEST(Nlopt, TwoThreadsDoNotDisturbEachOther) {
  RandomProblem random(bicycle(), 82);
  const auto problem = tight_control(random, 15);
  expect_undisturbed(*problem, RandomProblem::cold_start(*problem), "{}");
  expect_undisturbed(*problem, RandomProblem::cold_start(*problem), "{algorithm: LD_CCSAQ, max_iterations: 50}");
  // Stochastic: the generator belongs to the thread, and the seed to the run.
  const auto box = integrator(3, limited_states);
  for (const char* name : {"GN_ISRES", "GN_ORIG_DIRECT_L"})
    expect_undisturbed(*box, Iterate(box->capacity()),
                       std::string("{polish: false, max_iterations: 2000, algorithm: ") + name + "}");
  Limits limits = limited_inputs;
  const auto free = integrator(3, limits);
  for (const char* name : {"LD_LBFGS", "LD_TNEWTON_PRECOND_RESTART", "LN_SBPLX"})
    expect_undisturbed(*free, Iterate(free->capacity()),
                       std::string("{polish: false, max_iterations: 2000, algorithm: ") + name + "}");
}

}  // namespace
}  // namespace rhec
