// What the solver ipopt promises beyond the conformance of every solver.
#include <gtest/gtest.h>

#include <unistd.h>

#include <atomic>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <limits>
#include <thread>

#include "problems.hpp"
#include "rhec/core/ocp/iterate_checks.hpp"
#include "solvers/conformance/families.hpp"
#include "support/limited_ocp.hpp"
#include "support/temporary_folder.hpp"

namespace rhec::ipopt {
namespace ipopt_solver_test {

using namespace testing;
using rhec::testing::Limit;
using rhec::testing::LimitedOcp;
using rhec::testing::with_limits;

TEST(Ipopt, AWarmStartTakesFewerIterationsThanAColdOne) {
  int warm_iterations = 0, cold_iterations = 0;
  for (unsigned seed = 20; seed < 30; ++seed) {
    RandomProblem random(bicycle(), seed);
    RandomProblem::RhcSpec spec;
    spec.off = 0.2;
    const auto problem = random.rhc(spec);
    const auto warm = ipopt_with("{}"), cold = ipopt_with("{warm_start: false}");
    warm->setup(*problem);
    cold->setup(*problem);
    Iterate solution = RandomProblem::cold_start(*problem);
    ASSERT_EQ(warm->solve(solution).status, Status::solved);
    problem->given_state()[0] += 0.02;
    problem->given_state()[2] -= 0.01;
    std::vector<double> scratch(problem->scratch_size());
    problem->finish(scratch);
    Iterate from_warm = solution, from_cold = solution;
    const Report a = warm->solve(from_warm), b = cold->solve(from_cold);
    EXPECT_EQ(a.status, Status::solved);
    EXPECT_EQ(b.status, Status::solved);
    warm_iterations += a.iterations;
    cold_iterations += b.iterations;
  }
  EXPECT_LT(warm_iterations, 0.8 * cold_iterations);
}

TEST(Ipopt, TheUnitsOfTheObjectiveMatterToNothing) {
  RandomProblem random(bicycle(), 5);
  const auto rhe = random.rhe(blocks_of(4));
  RandomProblem::RhcSpec spec;
  spec.off = 0.3;
  const auto rhc = random.rhc(spec);
  for (const HorizonProblem* problem :
       {static_cast<HorizonProblem*>(rhe.get()), static_cast<HorizonProblem*>(rhc.get())}) {
    std::vector<double> scratch(problem->scratch_size());
    const Iterate start = RandomProblem::cold_start(*problem);
    const auto solver = ipopt_with("{}");
    solver->setup(*problem);
    Iterate expected = start;
    ASSERT_EQ(solver->solve(expected).status, Status::solved);
    const double optimum = problem->evaluate(expected, nullptr, scratch);
    for (const double factor : {1e-4, 1e-2, 1e2, 1e4}) {
      const Scaled scaled(*problem, factor);
      Iterate point = start;
      solver->setup(scaled);
      const Report report = solver->solve(point);
      EXPECT_EQ(report.status, Status::solved) << factor;
      EXPECT_LE(report.kkt.defect, 1e-8) << factor;
      EXPECT_NEAR(problem->evaluate(point, nullptr, scratch), optimum, 1e-7 * optimum) << factor;
    }
  }
}

TEST(Ipopt, TwoThreadsGetTheBitsThatEachGetsAlone) {
  RandomProblem random(bicycle(), 6);
  const auto rhe = random.rhe(blocks_of(2));
  const auto rhc = random.rhc({});
  const HorizonProblem* problems[] = {rhe.get(), rhc.get()};
  const auto solve = [](const HorizonProblem& problem) {
    const auto solver = ipopt_with("{}");
    solver->setup(problem);
    Iterate point = RandomProblem::cold_start(problem);
    EXPECT_EQ(solver->solve(point).status, Status::solved);
    return point;
  };
  const Iterate alone[] = {solve(*rhe), solve(*rhc)};
  std::atomic<int> wrong{0};
  const auto work = [&](int which) {
    const HorizonProblem& problem = *problems[which];
    for (int repeat = 0; repeat < 10; ++repeat) {
      const Iterate point = solve(problem);
      for (int i = 0; i <= problem.intervals(); ++i) {
        const std::size_t bytes = sizeof(double) * problem.state_count(i);
        wrong += std::memcmp(point.state(i), alone[which].state(i), bytes) != 0;
        wrong += std::memcmp(point.costate(i), alone[which].costate(i), bytes) != 0;
      }
    }
  };
  std::thread one(work, 0), other(work, 1);
  one.join();
  other.join();
  EXPECT_EQ(wrong, 0);
}

TEST(Ipopt, ADeadlineGivesTheBestIterateSoFar) {
  RandomProblem random(bicycle(), 7);
  const auto problem = random.rhe(blocks_of(10, 300));
  const auto solver = ipopt_with("{}");
  solver->setup(*problem);
  const Iterate start = RandomProblem::cold_start(*problem);
  std::vector<double> scratch(problem->scratch_size());
  StageQp qp(problem->capacity());
  const double before = kkt_residual(*problem, start, qp, scratch).largest();
  bool improved = false;
  for (const int milliseconds : {-1000, 1, 5, 10, 20, 40, 200, 1000}) {
    Iterate point = start;
    const Report report = solver->solve(point, Clock::now() + std::chrono::milliseconds(milliseconds));
    EXPECT_TRUE(report.status == Status::deadline || (report.status == Status::solved && milliseconds > 0));
    EXPECT_TRUE(point.is_finite());
    EXPECT_EQ(report.kkt.largest(), kkt_residual(*problem, point, qp, scratch).largest());
    EXPECT_LE(report.kkt.largest(), before);
    improved |= report.kkt.largest() < before;
  }
  EXPECT_TRUE(improved) << "no deadline left time for an iteration";
}

TEST(Ipopt, WaitingForAnotherSolveCountsForTheDeadline) {
  RandomProblem random(bicycle(), 8);
  const auto longer = random.rhe(blocks_of(10, 300));
  std::atomic<bool> stop{false}, started{false};
  std::thread other([&] {
    const auto solver = ipopt_with("{}");
    solver->setup(*longer);
    while (!stop) {
      started = true;
      Iterate point = RandomProblem::cold_start(*longer);
      solver->solve(point);
    }
  });
  const auto solver = ipopt_with("{}");
  solver->setup(*longer);
  while (!started) std::this_thread::yield();
  for (int repeat = 0; repeat < 5; ++repeat) {
    Iterate point = RandomProblem::cold_start(*longer);
    EXPECT_EQ(solver->solve(point, Clock::now() + std::chrono::milliseconds(1)).status, Status::deadline);
    EXPECT_TRUE(point.is_finite());
  }
  stop = true;
  other.join();
}

TEST(Ipopt, PrintsNothingAndReadsNoFile) {
  const auto here = std::filesystem::current_path();
  const TemporaryFolder folder;
  std::filesystem::current_path(folder.path());
  std::ofstream("ipopt.opt") << "print_level 8\nmax_iter 1\noutput_file told.txt\n";
  ::testing::internal::CaptureStdout();
  ::testing::internal::CaptureStderr();
  RandomProblem random(bicycle(), 9);
  const auto possible = random.rhc({});
  RandomProblem::RhcSpec far;
  far.off = 3.0;
  const auto difficult = random.rhc(far);
  for (const char* options : {"{}", "{hessian: limited_memory}", "{max_iterations: 2}", "{native: {mu_init: 1.0}}"}) {
    for (const auto* problem : {possible.get(), difficult.get()}) {
      const auto solver = ipopt_with(options);
      solver->setup(*problem);
      Iterate point = RandomProblem::cold_start(*problem);
      const Report report = solver->solve(point);
      if (problem == possible.get() && std::string(options) == "{}") {
        EXPECT_EQ(report.status, Status::solved);
      }
    }
  }
  EXPECT_NE(error_of_options("{native: {mu_strategy: never}}"), "");
  std::fflush(nullptr);
  EXPECT_EQ(::testing::internal::GetCapturedStdout(), "");
  EXPECT_EQ(::testing::internal::GetCapturedStderr(), "");
  int files = 0;
  for ([[maybe_unused]] const auto& file : std::filesystem::directory_iterator(folder.path())) ++files;
  EXPECT_EQ(files, 1) << "besides ipopt.opt";
  std::filesystem::current_path(here);
}

TEST(Ipopt, AnotherCapacityThanAtSetupIsBadInput) {
  RandomProblem random(bicycle(), 10);
  const auto small = random.rhe(blocks_of(3, 5)), large = random.rhe(blocks_of(3, 6));
  const auto solver = ipopt_with("{}");
  solver->setup(*small);
  Iterate point = RandomProblem::cold_start(*large);
  EXPECT_EQ(solver->solve(point).status, Status::bad_input);
}

/// On a problem of the conformance suite, with the default options.
Report verdict_on(const char* family, const char* model, unsigned seed) {
  const conformance::Problem problem = conformance::family(family).make(conformance::make_model(model), seed);
  const auto solver = ipopt_with("{}");
  solver->setup(problem.posed());
  Iterate point = problem.guess;
  return solver->solve(point);
}

TEST(Ipopt, RefutesItsOwnClaimThatLimitsCannotBeMet) {
  EXPECT_EQ(verdict_on("rhe_limits_blocks", "bicycle_slip", 19).status, Status::solved);
}

TEST(Ipopt, CallsInfeasibleWhatIterationsAreNotEnoughToRefute) {
  for (const Report& report : {verdict_on("rhc_limits_infeasible", "bicycle_slip", 11),
                               verdict_on("rhc_limits_infeasible", "tractor_trailer", 4)}) {
    EXPECT_EQ(report.status, Status::infeasible);
    // All runs together take 500, most of them in restoration.
    EXPECT_LT(report.iterations, 100);
    EXPECT_TRUE(report.fallback_used);
  }
}

TEST(Ipopt, TellsInfeasibleFromTooFewIterations) {
  RandomProblem random(bicycle(), 11);
  const auto problem = random.rhc({});
  const double now = problem->initial_state()[0];
  const Iterate start = RandomProblem::cold_start(*problem);
  // Position 0 at node 5 is to be below one value and above another.
  const auto status = [&](double below, double above, int iterations) {
    LimitedOcp limited(*problem, 2);
    limited.add(5, {Limit::Kind::linear, {0}, {1.0}, -infinity, now + below});
    limited.add(5, {Limit::Kind::linear, {0}, {1.0}, now + above, infinity});
    const auto solver = ipopt_with("{max_iterations: " + std::to_string(iterations) + "}");
    solver->setup(limited);
    const Iterate guess = with_limits(limited, start);
    Iterate point = guess;
    const Report report = solver->solve(point);
    EXPECT_LE(report.iterations, iterations);
    if (report.status == Status::infeasible) {
      for (int i = 0; i <= limited.intervals(); ++i)
        EXPECT_EQ(std::memcmp(point.state(i), guess.state(i), sizeof(double) * limited.state_count(i)), 0);
    }
    return report.status;
  };
  // With 40 no run of Ipopt itself ends.
  for (const int iterations : {40, 500}) EXPECT_EQ(status(-1.0, 1.0, iterations), Status::infeasible) << iterations;
  EXPECT_EQ(status(-1.0, 1.0, 1), Status::iteration_limit);
  EXPECT_EQ(status(0.1, -0.1, 1), Status::iteration_limit);
  EXPECT_EQ(status(0.1, -0.1, 500), Status::solved);
}

// Limits that meet in one point leave an interior-point method no interior: multipliers grow without bound there, and
// the residual that is relative to them becomes small far from the optimum. That holds for the solver that ours is
// compared with, too: it is believed where its residual is small in the objective's own unit.
TEST(Ipopt, LimitsWithoutInteriorAreNotLeftTooEarly) {
  int compared = 0, certain = 0;
  for (unsigned seed = 700; seed < 740; ++seed) {
    RandomProblem random(bicycle(), seed);
    RandomProblem::RhcSpec spec;
    spec.intervals = 4;
    spec.off = 0.3;
    const auto problem = random.rhc(spec);
    const Iterate start = RandomProblem::cold_start(*problem);
    LimitedOcp limited(*problem, 3);
    // Where the start is at node 2, one position is met from below and from above, by rows that are no equation.
    const double x = start.state(2)[0], y = start.state(2)[1];
    limited.add(2, {Limit::Kind::linear, {0}, {1.0}, -infinity, x});
    limited.add(2, {Limit::Kind::linear, {0, 1}, {1.0, 1.0}, x + y, infinity});
    limited.add(2, {Limit::Kind::linear, {1}, {1.0}, -infinity, y});
    limited.add(4, {Limit::Kind::linear, {0}, {1.0}, -infinity, start.state(4)[0]});
    Iterate ours = with_limits(limited, start), theirs = ours;
    const auto solver = ipopt_with("{}");
    const auto other = host().make_solver("gn_rti", parse_yaml("{mode: converge}", "options.yaml"));
    const auto patient = ipopt_with("{tolerance: 1e-13}");
    Iterate patiently = theirs;
    for (Solver* each : {solver.get(), other.get(), patient.get()}) each->setup(limited);
    const Report report = solver->solve(ours), expected = other->solve(theirs);
    EXPECT_EQ(report.status, Status::solved) << seed;
    const auto expect_objective = [&](double objective) {
      EXPECT_NEAR(report.objective, objective, 1e-6 * (1.0 + objective)) << seed;
    };
    // A tolerance far below ours leaves no doubt.
    if (const Report reference = patient->solve(patiently); reference.status == Status::solved) {
      ++certain;
      expect_objective(reference.objective);
    }
    const double multiplier = largest_bound_multiplier(limited, theirs);
    if (expected.status != Status::solved || expected.kkt.largest() * multiplier > 1e-4) continue;
    ++compared;
    expect_objective(expected.objective);
  }
  EXPECT_GE(compared, 35);
  EXPECT_GE(certain, 35);
}

}  // namespace ipopt_solver_test
}  // namespace rhec::ipopt
