// Every solver that is found, on problems of every model that is found. Answers are judged by the core's own KKT
// residual, never by the solver's word. A new plugin gets all of this by being found.

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <thread>

#include "../core/random_problem.hpp"
#include "rhec/core/formula_model.hpp"
#include "rhec/core/solver.hpp"
#include "rhec/plugins/host.hpp"

namespace rhec {
namespace {

using testing::RandomProblem;

const Host& host() {
  static const Host one;
  return one;
}

/// The solver by its name, set to full accuracy where that is a mode of its own.
std::shared_ptr<Solver> make_accurate(const std::string& name) {
  Settings settings = Settings::map();
  for (const OptionRow& row : host().options(PluginKind::solver, name))
    if (row.name == "mode") settings.set("mode", Settings::scalar("converge"));
  return host().make_solver(name, settings);
}

struct Judged {
  Report report;
  KktResidual kkt;
  Iterate point;
};

Judged solve_and_judge(Solver& solver, const HorizonProblem& problem, Iterate guess) {
  Judged judged{{}, {}, std::move(guess)};
  solver.prepare(problem, judged.point);
  judged.report = solver.solve(problem, judged.point);
  std::vector<double> scratch(problem.scratch_size());
  StageQp qp(problem.capacity());
  judged.kkt = kkt_residual(problem, judged.point, qp, scratch);
  return judged;
}

void expect_solved(Solver& solver, const HorizonProblem& problem, const std::string& what) {
  ASSERT_EQ(solver.why_not(problem), "") << what;
  solver.setup(problem);
  const Judged judged = solve_and_judge(solver, problem, RandomProblem::cold_start(problem));
  EXPECT_EQ(judged.report.status, Status::solved) << what << ": " << name_of(judged.report.status);
  EXPECT_LT(judged.kkt.stationarity, 1e-6) << what;
  EXPECT_LT(judged.kkt.defect, 1e-8) << what;
  EXPECT_LT(judged.kkt.bound_violation, 1e-8) << what;
  EXPECT_LT(judged.kkt.complementarity, 1e-6) << what;
  EXPECT_TRUE(judged.point.is_finite()) << what;
}

struct Pair {
  std::string solver, model;
};
class Conformance : public ::testing::TestWithParam<Pair> {
 protected:
  std::shared_ptr<const Model> model_ = host().make_model(GetParam().model);
  std::shared_ptr<Solver> solver_ = make_accurate(GetParam().solver);
};

TEST_P(Conformance, SolvesEstimationProblems) {
  unsigned seed = 100;
  for (const int intervals : {1, 2, 15}) {
    for (const int block : {0, 1, 4}) {
      for (const bool robust : {false, true}) {
        for (const double missing : {0.0, 0.3}) {
          RandomProblem random(model_, seed++);
          RandomProblem::RheSpec spec;
          spec.intervals = intervals;
          spec.block = block;
          spec.robust = robust;
          spec.missing = missing;
          const auto problem = random.rhe(spec);
          expect_solved(*solver_, *problem,
                        "N " + std::to_string(intervals) + ", block " + std::to_string(block) + ", robust " +
                            std::to_string(robust) + ", missing " + std::to_string(missing));
        }
      }
    }
  }
}

TEST_P(Conformance, SolvesEstimationWithRamps) {
  RandomProblem random(model_, 7);
  RandomProblem::RheSpec spec;
  spec.block = 4;
  spec.transition = Transition::ramp;
  expect_solved(*solver_, *random.rhe(spec), "ramp");
}

TEST_P(Conformance, SolvesControlProblems) {
  for (unsigned seed = 200; seed < 220; ++seed) {
    RandomProblem random(model_, seed);
    RandomProblem::RhcSpec spec;
    spec.intervals = seed % 4 == 0 ? 1 : 15;
    spec.off = seed % 3 == 0 ? 0.3 : 0.05;
    if (seed % 2 == 0) spec.blocked_inputs = {0};
    expect_solved(*solver_, *random.rhc(spec), "seed " + std::to_string(seed));
  }
}

TEST_P(Conformance, SolvesALongHorizon) {
  RandomProblem random(model_, 5);
  RandomProblem::RheSpec spec;
  spec.intervals = 200;
  spec.block = 10;
  expect_solved(*solver_, *random.rhe(spec), "200 intervals");
}

TEST_P(Conformance, AParameterThatNothingDeterminesKeepsASensibleValue) {
  // Standing still, no input says anything about how it is scaled.
  RandomProblem random(model_, 6);
  RandomProblem::RheSpec spec;
  spec.block = 3;
  const auto problem = random.rhe(spec);
  std::vector<double> here(model_->output_count());
  Model::Nodes request;
  request.count = 1;
  request.states = problem->arrival_mean.data();
  request.outputs = here.data();
  model_->observe(request);
  for (int i = 0; i <= problem->intervals(); ++i) {
    std::copy(here.begin(), here.end(), problem->output(i));
    if (i < problem->intervals()) std::fill_n(problem->measured_input(i), model_->input_count(), 0.0);
  }
  expect_solved(*solver_, *problem, "standing still");
}

TEST_P(Conformance, IsRightAgainAfterAPoisonedProblem) {
  RandomProblem random(model_, 8);
  const auto problem = random.rhe({});
  solver_->setup(*problem);
  const Iterate start = RandomProblem::cold_start(*problem);
  Iterate poisoned = start;
  poisoned.state(2)[0] = std::nan("");
  const Iterate before = poisoned;
  const Report report = solver_->solve(*problem, poisoned);
  EXPECT_EQ(report.status, Status::bad_input);
  EXPECT_EQ(std::memcmp(poisoned.state(0), before.state(0), sizeof(double) * model_->state_count()), 0);
  const double good = problem->arrival_mean[0];
  problem->arrival_mean[0] = std::numeric_limits<double>::infinity();
  Iterate point = start;
  EXPECT_FALSE(is_usable(solver_->solve(*problem, point).status));
  EXPECT_TRUE(point.is_finite());
  problem->arrival_mean[0] = good;
  const Judged judged = solve_and_judge(*solver_, *problem, start);
  EXPECT_EQ(judged.report.status, Status::solved);
  EXPECT_LT(judged.kkt.largest(), 1e-6);
}

TEST_P(Conformance, ResetGivesTheBitsOfANewInstance) {
  RandomProblem random(model_, 9);
  RandomProblem::RheSpec spec;
  spec.block = 4;
  const auto first = random.rhe(spec), second = random.rhe(spec);
  solver_->setup(*first);
  Iterate point = RandomProblem::cold_start(*first);
  solver_->solve(*first, point);
  solver_->reset();
  Iterate again = RandomProblem::cold_start(*second);
  solver_->solve(*second, again);
  const auto fresh = make_accurate(GetParam().solver);
  fresh->setup(*second);
  Iterate anew = RandomProblem::cold_start(*second);
  fresh->solve(*second, anew);
  for (int i = 0; i <= second->intervals(); ++i)
    EXPECT_EQ(std::memcmp(again.state(i), anew.state(i), sizeof(double) * second->state_count(i)), 0) << i;
}

TEST_P(Conformance, TwoInstancesOnTwoThreadsDoNotDisturbEachOther) {
  RandomProblem random(model_, 10);
  const auto problem = random.rhc({});
  const Iterate start = RandomProblem::cold_start(*problem);
  const auto alone = make_accurate(GetParam().solver);
  alone->setup(*problem);
  Iterate expected = start;
  alone->solve(*problem, expected);
  std::vector<int> wrong(2, 0);
  const auto work = [&](int which) {
    const auto solver = make_accurate(GetParam().solver);
    solver->setup(*problem);
    for (int repeat = 0; repeat < 20; ++repeat) {
      Iterate point = start;
      solver->reset();
      solver->solve(*problem, point);
      wrong[which] += std::memcmp(point.state(3), expected.state(3), sizeof(double) * problem->state_count(3)) != 0;
    }
  };
  std::thread one(work, 0), other(work, 1);
  one.join();
  other.join();
  EXPECT_EQ(wrong[0] + wrong[1], 0);
}

TEST_P(Conformance, RespectsADeadline) {
  RandomProblem random(model_, 11);
  const auto problem = random.rhc({});
  solver_->setup(*problem);
  Iterate point = RandomProblem::cold_start(*problem);
  const Report report = solver_->solve(*problem, point, Clock::now() - std::chrono::seconds(1));
  EXPECT_EQ(report.status, Status::deadline) << name_of(report.status);
  EXPECT_TRUE(point.is_finite());
}

/// x' = u: a point that cannot stay where it must.
struct Integrator {
  static constexpr int state_count = 1, input_count = 1, parameter_count = 0, output_count = 1;
  template <class Scalar>
  void dynamics(const Scalar*, const Scalar* u, const Scalar*, Scalar* dxdt) const {
    dxdt[0] = u[0];
  }
  template <class Scalar>
  void outputs(const Scalar* x, Scalar* y) const {
    y[0] = x[0];
  }
};

class SolverAlone : public ::testing::TestWithParam<std::string> {};

TEST_P(SolverAlone, SaysInfeasibleOfAnInfeasibleProblemAndIsRightAfterwards) {
  ModelDescription about;
  about.name = "integrator";
  about.states = {{.name = "x", .unit = "m", .meaning = "position"}};
  about.inputs = {{.name = "u", .unit = "m/s", .meaning = "speed"}};
  about.outputs = {{.name = "y", .unit = "m", .meaning = "position"}};
  const auto model = std::make_shared<FormulaModel<Integrator>>(Integrator{}, about);
  const auto problem_with = [&](double lower, double upper) {
    RheProblem::Setup setup;
    setup.max_intervals = 10;
    setup.output_weights = {1.0};
    setup.input_weights = {1.0};
    setup.state_lower = {0.0};
    setup.state_upper = {1.0};
    setup.input_lower = {lower};
    setup.input_upper = {upper};
    auto problem = std::make_unique<RheProblem>(model, setup);
    problem->set_intervals(10);
    problem->finish();
    problem->arrival_information(0, 0) = 1.0;
    for (int i = 0; i <= 10; ++i) {
      problem->output(i)[0] = 0.5;
      if (i == 10) break;
      problem->measured_input(i)[0] = 1.0;
      problem->set_duration(i, 1.0);
    }
    return problem;
  };
  const auto impossible = problem_with(2.0, 3.0), possible = problem_with(-1.0, 3.0);
  const auto solver = make_accurate(GetParam());
  solver->setup(*impossible);
  Iterate point = RandomProblem::cold_start(*impossible);
  const Report report = solver->solve(*impossible, point);
  EXPECT_EQ(report.status, Status::infeasible) << name_of(report.status);
  EXPECT_TRUE(point.is_finite());
  const Judged judged = solve_and_judge(*solver, *possible, RandomProblem::cold_start(*possible));
  EXPECT_EQ(judged.report.status, Status::solved);
  EXPECT_LT(judged.kkt.largest(), 1e-6);
}

std::vector<Pair> all_pairs() {
  std::vector<Pair> pairs;
  for (const std::string& solver : host().names(PluginKind::solver))
    for (const std::string& model : host().names(PluginKind::model)) pairs.push_back({solver, model});
  return pairs;
}
INSTANTIATE_TEST_SUITE_P(Every, Conformance, ::testing::ValuesIn(all_pairs()),
                         [](const auto& of) { return of.param.solver + "_on_" + of.param.model; });
INSTANTIATE_TEST_SUITE_P(Every, SolverAlone, ::testing::ValuesIn(host().names(PluginKind::solver)),
                         [](const auto& of) { return of.param; });

TEST(Discovery, FindsSolversAndModels) { EXPECT_FALSE(all_pairs().empty()); }

}  // namespace
}  // namespace rhec
