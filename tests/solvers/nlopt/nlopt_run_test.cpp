#include "solvers/nlopt/nlopt_run.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <string>

#include "problems.hpp"
#include "rhec/core/base/infinity.hpp"
#include "support/limited_ocp.hpp"

namespace rhec::nlopt {
namespace nlopt_run_test {

using namespace testing;
using rhec::testing::Limit;
using rhec::testing::LimitedOcp;
using Vector = Eigen::VectorXd;
using Matrix = Eigen::MatrixXd;

/// The variables as they are, or scaled.
Transformation transformation_for(const CondensedProblem& problem, bool is_full) {
  const int n = problem.variables();
  Transformation made;
  made.centre = Vector::LinSpaced(n, -0.4, 0.3);
  if (is_full) {
    made.full = Matrix::Identity(n, n);
    for (int k = 1; k < n; ++k) made.full(k - 1, k) = 0.3;
  } else {
    made.diagonal = Vector::LinSpaced(n, 1.0, 2.0);
  }
  return made;
}

/// An estimator's problem whose optimum is inside of all bounds.
struct SmallProblem {
  SmallProblem() : ocp(integrator(4, limited_states)), problem(*ocp) { EXPECT_TRUE(problem.take(*ocp)); }
  std::unique_ptr<RheProblem> ocp;
  CondensedProblem problem;
  NloptOptions options;
};

TEST(NloptTransformation, PullsGradientsBackAlongItself) {
  SmallProblem small;
  const int n = small.problem.variables();
  for (const bool is_full : {false, true}) {
    const Transformation transformation = transformation_for(small.problem, is_full);
    EXPECT_EQ(transformation.is_full(), is_full);
    EXPECT_EQ(transformation.x_of(Vector::Zero(n)), transformation.centre);
    const Vector y = Vector::LinSpaced(n, 1.0, -2.0), g = Vector::LinSpaced(n, 0.3, 0.7);
    EXPECT_NEAR(transformation.pulled_back(g).dot(y), g.dot(transformation.x_of(y) - transformation.centre), 1e-12);
  }
}

TEST(NloptRun, EndsWhereTheGradientVanishesWhateverTheScaling) {
  for (const bool is_full : {false, true}) {
    for (const nlopt_algorithm algorithm : {NLOPT_LD_SLSQP, NLOPT_LD_MMA}) {
      SmallProblem small;
      const Transformation transformation = transformation_for(small.problem, is_full);
      small.options.ftol_rel = 1e-12;
      nlopt::Run run(small.problem, small.options, algorithm, Run::Goal::objective, transformation,
                     {Clock::time_point::max(), 1000, 0, 1.0});
      EXPECT_EQ(run.optimise(), Run::Outcome::ended) << name_of(algorithm);
      EXPECT_GT(run.iterations(), 1);
      ASSERT_TRUE(small.problem.move_to(run.x()));
      EXPECT_LT(small.problem.gradient().cwiseAbs().maxCoeff(), 1e-3) << name_of(algorithm);
    }
  }
}

TEST(NloptRun, StopsWithTheBestPointAtItsLimits) {
  SmallProblem small;
  const Transformation transformation = transformation_for(small.problem, false);
  nlopt::Run late(small.problem, small.options, NLOPT_LD_SLSQP, Run::Goal::objective, transformation,
                  {Clock::time_point::min(), 1000, 0, 1.0});
  EXPECT_EQ(late.optimise(), Run::Outcome::deadline);
  EXPECT_EQ(late.iterations(), 0);
  EXPECT_EQ(late.x(), transformation.centre);
  ASSERT_TRUE(small.problem.move_to(transformation.centre));
  const double before = small.problem.objective();
  nlopt::Run brief(small.problem, small.options, NLOPT_LD_SLSQP, Run::Goal::objective, transformation,
                   {Clock::time_point::max(), 2, 0, 1.0});
  EXPECT_EQ(brief.optimise(), Run::Outcome::iteration_limit);
  EXPECT_EQ(brief.iterations(), 2);
  ASSERT_TRUE(small.problem.move_to(brief.x()));
  EXPECT_LT(small.problem.objective(), before);
}

TEST(NloptRun, ForViolationAloneLooksForAFeasiblePoint) {
  Limits limits = limited_states;
  limits.state_lower = {0.2};
  const auto ocp = integrator(4, limits);
  CondensedProblem problem(*ocp);
  ASSERT_TRUE(problem.take(*ocp));
  const NloptOptions options;
  Transformation transformation = transformation_for(problem, false);
  transformation.centre = transformation.centre.cwiseMax(problem.lower()).cwiseMin(problem.upper());
  transformation.centre.tail(problem.variables() - 1).setConstant(-0.9);
  ASSERT_TRUE(problem.move_to(transformation.centre));
  ASSERT_GT(problem.violation(), 0.5);
  nlopt::Run run(problem, options, NLOPT_LD_SLSQP, Run::Goal::violation, transformation,
                 {Clock::time_point::max(), 1000, 0, 1e-4});
  run.optimise();
  ASSERT_TRUE(problem.move_to(run.x()));
  EXPECT_LT(problem.violation(), 1e-3);
}

/// Every algorithm that takes the problem gets close to its optimum, on its own.
TEST(NloptAlgorithms, EveryAlgorithmThatTakesAProblemComesClose) {
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

TEST(NloptAlgorithms, AnotherAlgorithmSolvesAVehiclesProblem) {
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

/// An integrator whose position is to stay below what its measurements say, hard, soft, and soft without a linear
/// weight.
void add_limits(LimitedOcp& limited, double linear, double quadratic) {
  for (int i = 1; i <= limited.intervals(); ++i)
    limited.add(i, {Limit::Kind::squares, {0}, {1.0}, -infinity, 0.01 * i, linear, quadratic});
}

TEST(NloptAlgorithms, ThoseThatTakeInequalitiesTakeLimits) {
  const auto plain = integrator(5, unlimited);
  for (const auto& [linear, quadratic] : {std::pair{infinity, 0.0}, {0.05, 0.5}, {0.0, 2.0}}) {
    LimitedOcp limited(*plain, 1);
    add_limits(limited, linear, quadratic);
    const Iterate start = with_limits(limited, RandomProblem::cold_start(*plain));
    const auto exact = host().make_solver("sparse_sqp", Settings::map());
    exact->setup(limited);
    Iterate expected = start;
    const Report best = exact->solve(expected);
    ASSERT_EQ(best.status, Status::solved);
    int active = 0;
    for (int i = 1; i <= 5; ++i) active += expected.limit_bound(i)[0] > 1e-3;
    EXPECT_GT(active, 0) << linear;
    for (const char* options :
         {"{algorithm: LD_SLSQP}", "{algorithm: LD_MMA}", "{algorithm: LD_CCSAQ}",
          "{algorithm: LD_AUGLAG, local_algorithm: LD_LBFGS}", "{algorithm: LN_COBYLA, max_iterations: 20000}"}) {
      const auto solver = nlopt_with(options);
      ASSERT_EQ(solver->why_not(limited), "") << options;
      solver->setup(limited);
      Iterate point = start;
      const Report report = solver->solve(point);
      EXPECT_EQ(report.status, Status::solved) << options << " " << linear << ": " << rhec::name_of(report.status);
      EXPECT_NEAR(report.objective, best.objective, 1e-5 * (1.0 + best.objective)) << options << " " << linear;
    }
    const std::string reason = nlopt_with("{algorithm: LD_LBFGS}")->why_not(limited);
    if (linear == 0.0) {
      EXPECT_EQ(reason, "") << "its violation is a part of the objective";
    } else {
      EXPECT_NE(reason.find("takes no inequality constraints, and this problem has limits"), std::string::npos)
          << reason;
      EXPECT_NE(reason.find("LD_MMA"), std::string::npos) << reason;
    }
  }
}

TEST(NloptAlgorithms, StopsAtADeadlineInTheMiddleWithTheBestSoFar) {
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

}  // namespace nlopt_run_test
}  // namespace rhec::nlopt
