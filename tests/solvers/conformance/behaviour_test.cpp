// How every solver that is found behaves: after failures, when reset, on threads, at deadlines, from good guesses, and
// what its tolerance means.
#include "behaviour.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>
#include <ostream>
#include <thread>
#include <utility>

#include "rhec/core/horizon/shift.hpp"
#include "support/random_problem.hpp"

namespace rhec::conformance {
namespace behaviour_test {

using testing::RandomProblem;

constexpr double nan = std::numeric_limits<double>::quiet_NaN();
constexpr double infinity = std::numeric_limits<double>::infinity();

/// What a call that has to return promptly may last, on a machine that is busy with other things. Sanitizers make it
/// several times as long.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr std::chrono::seconds promptly{60};
#else
constexpr std::chrono::seconds promptly{10};
#endif

// --- after a failure ------------------------------------------------------------------------------------------------

TEST_P(Behaviour, SaysBadInputAndChangesNothingWhereTheGuessIsNotFinite) {
  const Problem good = problem("rhe_blocks");
  const auto solver = make();
  solver->setup(*good.ocp);
  using Row = double* (Iterate::*)(int) noexcept;
  const std::vector<std::pair<const char*, Row>> rows = {{"state", &Iterate::state},
                                                         {"control", &Iterate::control},
                                                         {"costate", &Iterate::costate},
                                                         {"state_bound", &Iterate::state_bound},
                                                         {"control_bound", &Iterate::control_bound}};
  for (const auto& [name, row] : rows) {
    for (const double value : {nan, infinity, -infinity}) {
      const std::string when = fmt::format("{} in a {}", value, name);
      Iterate poisoned = good.guess;
      (poisoned.*row)(2)[0] = value;
      const Iterate before = poisoned;
      solver->prepare(poisoned);
      const Report report = solver->solve(poisoned);
      EXPECT_EQ(report.status, Status::bad_input) << when << ": " << name_of(report.status);
      EXPECT_TRUE(same_bits(*good.ocp, poisoned, before)) << when;
    }
  }
  expect_right(*solver, good, "after a poisoned guess");
}

TEST_P(Behaviour, SaysBadInputWhereTheProblemIsNotFinite) {
  const auto solver = make();
  Problem good = problem("rhe_blocks");
  solver->setup(*good.ocp);
  auto& rhe = dynamic_cast<RheProblem&>(*good.ocp);
  const auto expect_bad_input = [&](const char* when) {
    Iterate point = good.guess;
    solver->prepare(point);
    const Report report = solver->solve(point);
    EXPECT_EQ(report.status, Status::bad_input) << when << ": " << name_of(report.status);
    EXPECT_TRUE(same_bits(*good.ocp, point, good.guess)) << when;
  };
  for (const double value : {nan, infinity}) {
    const double mean = std::exchange(rhe.arrival_mean[0], value);
    expect_bad_input("arrival mean");
    rhe.arrival_mean[0] = mean;
    expect_right(*solver, good, "after a poisoned arrival mean");
    const double information = std::exchange(rhe.arrival_information(0, 0), value);
    expect_bad_input("arrival information");
    rhe.arrival_information(0, 0) = information;
    expect_right(*solver, good, "after poisoned arrival information");
  }
  const double measured = std::exchange(rhe.output(3)[0], infinity);
  expect_bad_input("infinite measurement");
  // A measurement that is not a number is one that is missing.
  rhe.output(3)[0] = nan;
  expect_solved(solve(*solver, good), "missing measurement");
  rhe.output(3)[0] = measured;
  expect_right(*solver, good, "after measurements that were infinite or missing");

  // An interval whose length is not a number makes defects that are none.
  const double seconds = rhe.duration(4);
  rhe.set_duration(4, nan);
  Iterate point = good.guess;
  solver->prepare(point);
  const Report report = solver->solve(point);
  EXPECT_NE(report.status, Status::solved) << "duration";
  EXPECT_NE(report.status, Status::step_taken) << "duration";
  EXPECT_TRUE(same_bits(*good.ocp, point, good.guess)) << "duration";
  rhe.set_duration(4, seconds);
  expect_right(*solver, good, "after a poisoned duration");
}

TEST_P(Behaviour, SaysBadInputWhereABoundIsNotANumber) {
  Problem good = problem("rhc_near");
  const auto solver = make();
  solver->setup(*good.ocp);
  auto& rhc = dynamic_cast<RhcProblem&>(*good.ocp);
  std::vector<double> scratch(rhc.scratch_size());
  const double lower = std::exchange(rhc.input_lower(2, 0), nan);
  rhc.finish(scratch);
  Iterate point = good.guess;
  solver->prepare(point);
  const Report report = solver->solve(point);
  EXPECT_EQ(report.status, Status::bad_input) << name_of(report.status);
  EXPECT_TRUE(same_bits(*good.ocp, point, good.guess));
  rhc.input_lower(2, 0) = lower;
  rhc.finish(scratch);
  expect_right(*solver, good, "after a bound that was no number");
}

TEST_P(Behaviour, SaysBadInputOfAnotherCapacity) {
  const Problem good = problem("rhe_blocks"), other = problem("rhe_part_of_the_room");
  const auto solver = make();
  solver->setup(*good.ocp);
  Iterate point = other.guess;
  solver->prepare(point);
  EXPECT_EQ(solver->solve(point).status, Status::bad_input);
  EXPECT_TRUE(same_bits(*other.ocp, point, other.guess));
  expect_right(*solver, good, "after another capacity");
}

TEST_P(Behaviour, IsRightAfterAnInfeasibleProblem) {
  const Problem impossible = problem("rhc_infeasible"), possible = problem("rhc_inputs_at_bounds");
  const auto solver = make();
  for (int repeat = 0; repeat < 2; ++repeat) {
    const Assessment assessed = set_up_and_solve(*solver, impossible);
    EXPECT_EQ(assessed.report.status, Status::infeasible) << name_of(assessed.report.status);
    EXPECT_TRUE(same_bits(*impossible.ocp, assessed.point, impossible.guess));
    expect_right(*solver, possible, "after an infeasible problem");
  }
}

class SolverAlone : public ::testing::TestWithParam<std::string> {};

TEST_P(SolverAlone, SaysInfeasibleOfAVehicleThatCannotStayWhereItMust) {
  const auto cold = [](std::unique_ptr<HorizonProblem> ocp) {
    Iterate guess = RandomProblem::cold_start(*ocp);
    return Problem{std::move(ocp), std::move(guess), nullptr};
  };
  const Problem impossible = cold(integrator_in_a_box(2.0, 3.0)), possible = cold(integrator_in_a_box(-1.0, 3.0));
  const double tolerance = tolerance_of(GetParam());
  const auto solver = make_solver(GetParam());
  solver->setup(*impossible.ocp);
  const Assessment refused = solve_and_assess(*solver, *impossible.ocp, impossible.guess, tolerance);
  EXPECT_EQ(refused.report.status, Status::infeasible) << name_of(refused.report.status);
  EXPECT_TRUE(same_bits(*impossible.ocp, refused.point, impossible.guess));
  solver->setup(*possible.ocp);
  const Assessment assessed = solve_and_assess(*solver, *possible.ocp, possible.guess, tolerance);
  EXPECT_EQ(assessed.report.status, Status::solved) << name_of(assessed.report.status);
  for (const std::string& complaint : assessed.complaints) ADD_FAILURE() << complaint;
}

// --- instances ------------------------------------------------------------------------------------------------------

TEST_P(Behaviour, ResetGivesTheBitsOfANewInstance) {
  const Problem wanted = problem("rhe_blocks", 2);
  const auto& original = dynamic_cast<const RheProblem&>(*wanted.ocp);
  Iterate expected = wanted.guess;
  const auto fresh = make();
  fresh->setup(original);
  const Report report = fresh->solve(expected);

  RheProblem live = original;
  const auto solver = make();
  solver->setup(live);
  const auto expect_same = [&](const char* after) {
    solver->reset();
    live.take_data(original);
    Iterate point = wanted.guess;
    const Report again = solver->solve(point);
    EXPECT_TRUE(same_bits(original, point, expected)) << after;
    EXPECT_EQ(again.status, report.status) << after;
    EXPECT_EQ(again.iterations, report.iterations) << after;
  };
  expect_same("setup alone");
  expect_same("the same problem");
  const auto change_data = [&] {
    for (int i = 0; i <= live.intervals(); ++i)
      for (int j = 0; j < model_->output_count(); ++j)
        live.output(i)[j] += 0.05 * model_->description().outputs[j].scale * (i % 3);
  };
  change_data();
  Iterate point = wanted.guess;
  solver->solve(point);
  expect_same("other data");
  change_data();
  point = wanted.guess;
  solver->prepare(point);
  expect_same("a preparation without a solve");
  std::vector<std::uint8_t> begins(live.intervals(), 1);
  for (int j = 0; j < model_->parameter_count(); ++j) live.set_blocks(j, begins.data(), Transition::step);
  live.finish();
  point = RandomProblem::cold_start(live);
  solver->solve(point);
  expect_same("another structure");
  point = wanted.guess;
  point.state(1)[0] = nan;
  solver->solve(point);
  expect_same("a poisoned guess");
  point = wanted.guess;
  solver->solve(point, Clock::now() - std::chrono::seconds(1));
  expect_same("a deadline");
}

TEST_P(Behaviour, TwoInstancesOnTwoThreadsDoNotDisturbEachOther) {
  constexpr int repeats = 12;
  const std::array<std::string, 2> names = {"rhc_near", "rhe_blocks"};
  std::array<std::vector<Problem>, 2> problems;
  std::array<std::vector<Iterate>, 2> expected;
  for (std::size_t k = 0; k < 2; ++k) {
    for (unsigned seed = 1; seed <= 2; ++seed) {
      problems[k].push_back(problem(names[k], seed));
      expected[k].push_back(by_new_instance(problems[k].back()).point);
    }
  }
  std::array<int, 2> wrong = {0, 0};
  const auto work = [&](std::size_t k) {
    const auto solver = make();
    for (int repeat = 0; repeat < repeats; ++repeat) {
      const std::size_t which = repeat % 2;
      Iterate point = problems[k][which].guess;
      solver->setup(*problems[k][which].ocp);
      solver->prepare(point);
      solver->solve(point);
      wrong[k] += !same_bits(*problems[k][which].ocp, point, expected[k][which]);
    }
  };
  std::thread one(work, 0), other(work, 1);
  one.join();
  other.join();
  EXPECT_EQ(wrong[0], 0) << "of " << repeats << " " << names[0];
  EXPECT_EQ(wrong[1], 0) << "of " << repeats << " " << names[1];
}

TEST_P(Behaviour, ServesTwoCapacitiesOneAfterTheOther) {
  const Problem small = problem("rhe_two_intervals"), large = problem("rhe_part_of_the_room"),
                control = problem("rhc_blocked_input");
  const auto solver = make();
  for (int repeat = 0; repeat < 2; ++repeat) {
    for (const Problem* each : {&small, &large, &control}) {
      solver->setup(*each->ocp);
      EXPECT_TRUE(same_bits(*each->ocp, solve(*solver, *each).point, by_new_instance(*each).point))
          << "setup is a new beginning";
    }
  }
}

// A setup serves problems up to its own size; estimation needs more scratch than control.
TEST_P(Behaviour, ServesBothKindsOfOneCapacity) {
  const Problem control = problem("rhc_near"), estimation = problem("rhe_full_horizon");
  ASSERT_EQ(control.ocp->capacity(), estimation.ocp->capacity());
  ASSERT_LE(control.ocp->scratch_size(), estimation.ocp->scratch_size());
  const auto solver = make();
  solver->setup(*estimation.ocp);
  for (int repeat = 0; repeat < 2; ++repeat) {
    expect_right(*solver, control, "control");
    expect_right(*solver, estimation, "estimation");
  }
}

// --- deadlines ------------------------------------------------------------------------------------------------------

TEST_P(Behaviour, StopsAtADeadlineThatHasPassed) {
  for (const char* name : {"rhe_blocks", "rhc_near"}) {
    const Problem of = problem(name);
    const auto solver = make();
    solver->setup(*of.ocp);
    const auto start = Clock::now();
    const Assessment assessed =
        solve_and_assess(*solver, *of.ocp, of.guess, tolerance_, Clock::now() - std::chrono::seconds(1));
    EXPECT_LT(Clock::now() - start, promptly) << name;
    // One iteration may be made all the same, and may be enough.
    const Status status = assessed.report.status;
    EXPECT_TRUE(status == Status::deadline || status == Status::solved) << name << ": " << name_of(status);
    for (const std::string& complaint : assessed.complaints) ADD_FAILURE() << name << ": " << complaint;
    expect_right(*solver, of, "after a deadline");
  }
}

TEST_P(Behaviour, ReturnsTheBestPointAtADeadlineAhead) {
  for (const char* name : {"rhe_200_intervals", "rhc_200_intervals"}) {
    if (!applies(name)) continue;
    const Problem of = problem(name);
    const auto solver = make();
    solver->setup(*of.ocp);
    const double before = residual_at(*of.ocp, of.guess).largest();
    for (const int microseconds : {100, 1000, 5000, 20000}) {
      const std::string when = fmt::format("{}, {} us", name, microseconds);
      const auto start = Clock::now();
      solver->reset();
      Assessment assessed = solve_and_assess(*solver, *of.ocp, of.guess, tolerance_,
                                             Clock::now() + std::chrono::microseconds(microseconds));
      EXPECT_LT(Clock::now() - start, promptly) << when;
      const Status status = assessed.report.status;
      EXPECT_TRUE(status == Status::deadline || status == Status::solved) << when << ": " << name_of(status);
      // Methods differ in what they trade on the way; none may return a point that has run away.
      EXPECT_LE(assessed.kkt.largest(), 10.0 * (1.0 + before)) << when;
      for (const std::string& complaint : assessed.complaints) ADD_FAILURE() << when << ": " << complaint;
    }
  }
}

// --- good guesses ---------------------------------------------------------------------------------------------------

TEST_P(Behaviour, RecognisesItsOwnSolution) {
  for (const char* name : {"rhe_full_horizon", "rhe_blocks", "rhe_all_at_bounds", "rhe_ramps", "rhc_near",
                           "rhc_inputs_at_bounds", "rhc_states_at_bounds", "rhc_blocked_input"}) {
    if (!applies(name)) continue;
    Problem of = problem(name);
    const Assessment cold = by_new_instance(of);
    expect_solved(cold, name);
    of.guess = cold.point;
    const Assessment warm = by_new_instance(of);
    expect_solved(warm, std::string(name) + " from its solution");
    EXPECT_LE(warm.report.iterations, 2) << name;
    EXPECT_NEAR(warm.objective, cold.objective, 1e-9 * (1e-3 + std::abs(cold.objective))) << name;
  }
}

// --- what options mean ----------------------------------------------------------------------------------------------

TEST_P(Behaviour, MeansTheCoresResidualByItsTolerance) {
  if (!has_option(GetParam().solver, "tolerance")) GTEST_SKIP() << "it has no option `tolerance`";
  for (const char* name :
       {"rhe_full_horizon", "rhe_blocks", "rhe_robust", "rhe_all_at_bounds", "rhc_near", "rhc_inputs_at_bounds"}) {
    if (!applies(name)) continue;
    const Problem of = problem(name);
    for (const double tolerance : {1e-4, 1e-6, 1e-8}) {
      const std::string when = fmt::format("{} at {}", name, tolerance);
      Settings options = Settings::map();
      options.set("tolerance", Settings::scalar(fmt::format("{}", tolerance)));
      const auto solver = make(options);
      solver->setup(*of.ocp);
      const Assessment assessed = solve_and_assess(*solver, *of.ocp, of.guess, tolerance);
      EXPECT_EQ(assessed.report.status, Status::solved) << when << ": " << name_of(assessed.report.status);
      EXPECT_LE(assessed.kkt.largest(), tolerance) << when;
      for (const std::string& complaint : assessed.complaints) ADD_FAILURE() << when << ": " << complaint;
    }
  }
}

TEST_P(Behaviour, SaysWhenItStoppedAtItsLimitOfIterations) {
  if (!has_option(GetParam().solver, "max_iterations")) GTEST_SKIP() << "it has no option `max_iterations`";
  for (const char* name : {"rhe_far_guess", "rhc_far_guess"}) {
    const Problem of = problem(name);
    Settings options = Settings::map();
    options.set("max_iterations", Settings::scalar("1"));
    const auto solver = make(options);
    solver->setup(*of.ocp);
    const Assessment assessed = solve_and_assess(*solver, *of.ocp, of.guess, tolerance_);
    // A problem that is linear may be solved by one step.
    const bool linear = GetParam().model == "integrator";
    EXPECT_TRUE(assessed.report.status == Status::iteration_limit ||
                (linear && assessed.report.status == Status::solved))
        << name << ": " << name_of(assessed.report.status);
    EXPECT_LE(assessed.report.iterations, 1) << name;
    for (const std::string& complaint : assessed.complaints) ADD_FAILURE() << name << ": " << complaint;
  }
}

INSTANTIATE_TEST_SUITE_P(Every, Behaviour, ::testing::ValuesIn(all_pairs()),
                         [](const auto& of) { return of.param.solver + "_on_" + of.param.model; });
INSTANTIATE_TEST_SUITE_P(Every, SolverAlone, ::testing::ValuesIn(host().names(PluginKind::solver)),
                         [](const auto& of) { return of.param; });

}  // namespace behaviour_test
}  // namespace rhec::conformance
