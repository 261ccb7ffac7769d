// What the solver nlopt promises beyond the conformance of every solver.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <thread>

#include "problems.hpp"
#include "solvers/nlopt/condensed.hpp"
#include "support/limited_ocp.hpp"
#include "support/unstable.hpp"

namespace rhec::nlopt {
namespace nlopt_solver_test {

using namespace testing;
using rhec::testing::Limit;
using rhec::testing::LimitedOcp;
using rhec::testing::unstable_control;
using rhec::testing::unstable_guess;
using rhec::testing::with_limits;

/// x' = x^3 + u, which leaves the numbers within seconds where u is large.
template <class Scalar>
struct Runaway : Integrator<Scalar> {
  void dynamics(const Scalar* x, const Scalar* u, const Scalar*, Scalar* dxdt) const {
    dxdt[0] = x[0] * x[0] * x[0] + u[0];
  }
};

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

/// Over 40 intervals a deviation grows by ten orders of magnitude, and what the guess leads to by simulation is far
/// from all limits.
TEST(Nlopt, FollowsARegulatorsPolicyWhereDynamicsAreUnstable) {
  const int intervals = 40;
  const auto problem = unstable_control(intervals);
  const int u = problem->capacity().states;
  LimitedOcp limited(*problem, 1);
  for (int i = 1; i < intervals; ++i) limited.add(i, {Limit::Kind::linear, {0, u}, {1.0, 0.5}, -0.5, 0.5});
  const auto solver = nlopt_with("{}");
  solver->setup(limited);
  Iterate point = with_limits(limited, unstable_guess(*problem));
  const Report report = solver->solve(point);
  EXPECT_EQ(report.status, Status::solved) << name_of(report.status);
  const auto other = host().make_solver("gn_rti", parse_yaml("{mode: converge}", "options"));
  other->setup(limited);
  Iterate expected = with_limits(limited, unstable_guess(*problem));
  const Report reference = other->solve(expected);
  ASSERT_EQ(reference.status, Status::solved);
  EXPECT_NEAR(report.objective, reference.objective, 1e-6 * reference.objective);
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

}  // namespace nlopt_solver_test
}  // namespace rhec::nlopt
