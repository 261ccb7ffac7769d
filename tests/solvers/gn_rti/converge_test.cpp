// Mode converge, with limits: nonlinear ones and soft ones too; and that real-time steps come to the same.

#include <cmath>
#include <limits>
#include <memory>
#include <string>

#include <gtest/gtest.h>

#include "rhec/core/horizon/rhc_problem.hpp"
#include "rhec/core/ocp/solver.hpp"
#include "rhec/core/qp/kkt.hpp"
#include "rhec/plugins/host/host.hpp"
#include "rhec/plugins/yaml/yaml.hpp"
#include "support/allocations.hpp"
#include "support/limited_ocp.hpp"
#include "support/random_problem.hpp"

namespace rhec {
namespace converge_test {

using testing::Limit;
using testing::LimitedOcp;
using testing::RandomProblem;

const Host& host() {
  static const Host one;
  return one;
}
std::shared_ptr<Solver> gn_rti(const std::string& options) {
  return host().make_solver("gn_rti", parse_yaml(options, "options"));
}

/// A controller's problem, its solution without limits, and limits on what it does there: on single inputs and states,
/// on products and on squares.
struct Case {
  std::unique_ptr<RhcProblem> problem;
  std::unique_ptr<LimitedOcp> limited;
  Iterate start;
  bool is_solved = false;

  Case(unsigned seed, double share, double linear, double quadratic) {
    RandomProblem random(host().make_model("bicycle_slip"), seed);
    RandomProblem::RhcSpec spec;
    spec.off = 0.2;
    problem = random.rhc(spec);
    const auto solver = gn_rti("{mode: converge}");
    solver->setup(*problem);
    Iterate free = RandomProblem::cold_start(*problem);
    is_solved = solver->solve(free).status == Status::solved;
    limited = std::make_unique<LimitedOcp>(*problem, 3);
    const int ns = problem->capacity().states;
    for (int i = 0; i < problem->intervals(); ++i) {
      const double* z = free.row(i);
      const auto add = [&](Limit limit) {
        const double value = limit.value(z);
        const double before = limit.value(free.row(0));
        // Between what the first stage does and what this one does. A circle has no lower bound: that would not be
        // convex.
        if (limit.kind == Limit::Kind::squares && value <= before) return;
        const double edge = value - share * (value - before);
        (value > before ? limit.upper : limit.lower) = edge;
        limit.linear_weight = linear;
        limit.quadratic_weight = quadratic;
        limited->add(i, limit);
      };
      if (i == 0 || problem->control_count(i) < 2) continue;
      add({.kind = Limit::Kind::linear, .of = {ns}, .with = {1.0}});
      add({.kind = Limit::Kind::squares, .of = {ns, ns + 1}, .with = {1.0, 2.0}});
    }
    start = testing::with_limits(*limited, free);
  }
};

double objective_of(const Ocp& ocp, const Iterate& iterate) {
  std::vector<double> scratch(ocp.scratch_size()), values((ocp.capacity().intervals + 1) * ocp.capacity().limit_row());
  double objective = ocp.evaluate(iterate, nullptr, scratch);
  ocp.evaluate_limits(iterate, values.data(), scratch);
  for (int i = 0; i <= ocp.intervals(); ++i)
    objective += limit_costs(ocp, i, values.data() + static_cast<std::ptrdiff_t>(i) * ocp.capacity().limit_row()).slack;
  return objective;
}

int count_active(const Ocp& ocp, const Iterate& iterate) {
  int count = 0;
  for (int i = 0; i <= ocp.intervals(); ++i)
    for (int r = 0; r < ocp.limit_count(i); ++r) count += iterate.limit_bound(i)[r] != 0.0;
  return count;
}

void expect_solved(const std::string& options, double linear, double quadratic) {
  int solved = 0, active = 0;
  for (unsigned seed = 1; seed <= 8; ++seed) {
    Case one(seed, 0.1, linear, quadratic);
    ASSERT_TRUE(one.is_solved) << "seed " << seed;
    const auto solver = gn_rti(options);
    solver->setup(*one.limited);
    Iterate iterate = one.start;
    const Report report = solver->solve(iterate);
    EXPECT_EQ(report.status, Status::solved)
        << "seed " << seed << ", residual " << report.kkt.largest() << " after " << report.iterations;
    if (report.status != Status::solved) continue;
    ++solved;
    active += count_active(*one.limited, iterate);
    EXPECT_NEAR(report.objective, objective_of(*one.limited, iterate), 1e-9 * (1.0 + std::abs(report.objective)));
    EXPECT_LT(report.kkt.largest(), 1e-7);
  }
  EXPECT_EQ(solved, 8);
  EXPECT_GT(active, 8);
}

TEST(GnRtiLimits, ConvergesWithHardLimits) { expect_solved("{mode: converge}", infinity, 0.0); }
TEST(GnRtiLimits, ConvergesWithTheExactHessian) { expect_solved("{mode: converge, hessian: exact}", infinity, 0.0); }
TEST(GnRtiLimits, ConvergesWithLinearSlacks) { expect_solved("{mode: converge}", 0.01, 0.0); }
TEST(GnRtiLimits, ConvergesWithQuadraticSlacks) { expect_solved("{mode: converge}", 0.01, 1.0); }

TEST(GnRtiLimits, RealTimeStepsComeToTheSameSolutionWithoutAllocating) {
  for (const double linear : {infinity, 0.01}) {
    Case one(3, 0.1, linear, linear < infinity ? 0.5 : 0.0);
    const auto converging = gn_rti("{mode: converge}"), real_time = gn_rti("{mode: rti}");
    converging->setup(*one.limited);
    real_time->setup(*one.limited);
    Iterate expected = one.start, iterate = one.start;
    ASSERT_EQ(converging->solve(expected).status, Status::solved);
    Report report;
    const long before = allocation_count();
    for (int sample = 0; sample < 25; ++sample) {
      real_time->prepare(iterate);
      report = real_time->solve(iterate);
    }
    EXPECT_EQ(allocation_count(), before);
    EXPECT_EQ(report.status, Status::step_taken);
    EXPECT_LT(report.kkt.largest(), 1e-7);
    EXPECT_NEAR(report.objective, objective_of(*one.limited, expected), 1e-6 * (1.0 + std::abs(report.objective)));
  }
}

TEST(GnRtiLimits, RealTimeStepsLeaveNoInputBeyondItsBounds) {
  int active = 0;
  for (unsigned seed = 1; seed <= 8; ++seed) {
    Case one(seed, 0.1, infinity, 0.0);
    ASSERT_TRUE(one.is_solved) << "seed " << seed;
    const int nu = one.problem->model().input_count();
    for (int i = 0; i < one.problem->intervals(); ++i)
      for (int j = 0; j < nu; ++j)
        one.problem->input_upper(i, j) =
            std::max(one.problem->input_lower(i, j), one.start.control(i)[j] - 0.01 * (1.0 + (seed + i + j) % 7));
    std::vector<double> scratch(one.problem->scratch_size());
    one.problem->finish(scratch);
    const auto solver = gn_rti("{mode: rti}");
    solver->setup(*one.limited);
    Iterate iterate = one.start;
    for (int sample = 0; sample < 4; ++sample) {
      if (solver->solve(iterate).status != Status::step_taken) break;
      for (int i = 0; i < one.limited->intervals(); ++i) {
        for (int j = 0; j < one.limited->control_count(i); ++j) {
          const double multiplier = iterate.control_bound(i)[j];
          if (multiplier == 0.0) continue;
          ++active;
          // To the last bit: the next guess, which is clipped, is the same point then.
          EXPECT_GE(iterate.control(i)[j], one.limited->control_lower(i)[j])
              << "seed " << seed << ", sample " << sample;
          EXPECT_LE(iterate.control(i)[j], one.limited->control_upper(i)[j])
              << "seed " << seed << ", sample " << sample;
        }
      }
    }
  }
  EXPECT_GT(active, 50);
}

TEST(GnRtiLimits, SaysSoWhereHardLimitsContradictEachOtherAndSoftOnesDoNot) {
  Case one(2, 0.1, infinity, 0.0);
  const int ns = one.problem->capacity().states;
  for (const bool is_soft : {false, true}) {
    one.limited->clear_limits();
    Limit above{.kind = Limit::Kind::linear, .of = {ns}, .with = {1.0}}, below = above;
    const double now = one.start.control(2)[0];
    above.lower = now + 0.1;
    below.upper = now - 0.1;
    if (is_soft) above.linear_weight = below.linear_weight = 0.01, below.quadratic_weight = 1.0;
    one.limited->add(2, above);
    one.limited->add(2, below);
    const auto solver = gn_rti("{mode: converge}");
    solver->setup(*one.limited);
    Iterate iterate = one.start;
    EXPECT_EQ(solver->solve(iterate).status, is_soft ? Status::solved : Status::infeasible);
  }
}

TEST(GnRtiLimits, RealTimeStepsViolateLeastWhatCannotBeKept) {
  for (unsigned seed = 1; seed <= 8; ++seed) {
    Case one(seed, 0.1, infinity, 0.0);
    if (!one.is_solved) continue;
    const int ns = one.problem->capacity().states;
    one.limited->clear_limits();
    Iterate iterate = one.start;
    const auto solver = gn_rti("{mode: rti}");
    solver->setup(*one.limited);
    ASSERT_TRUE(is_usable(solver->solve(iterate).status));
    // Of one input: above what the other limit, of twice the room beyond it, asks for.
    const double now = iterate.control(2)[0];
    one.limited->add(2, Limit{.kind = Limit::Kind::linear, .of = {ns}, .with = {1.0}, .lower = now + 0.2});
    one.limited->add(2, Limit{.kind = Limit::Kind::linear, .of = {ns}, .with = {1.0}, .upper = now + 0.1});
    const long before = allocation_count();
    solver->prepare(iterate);
    const Report report = solver->solve(iterate);
    EXPECT_EQ(allocation_count(), before);
    EXPECT_EQ(report.status, Status::relaxed);
    EXPECT_TRUE(is_usable(report.status));
    EXPECT_TRUE(report.fallback_used);
    EXPECT_EQ(report.iterations, 1);
    EXPECT_GE(iterate.control(2)[0], now + 0.1 - 1e-4) << "the sum of both is least between them";
    EXPECT_LE(iterate.control(2)[0], now + 0.2 + 1e-4);
    one.limited->clear_limits();
    EXPECT_EQ(solver->solve(iterate).status, Status::step_taken) << "and it goes on from there";
  }
}

TEST(GnRtiLimits, GetsPastLinearisedLimitsThatContradictEachOther) {
  for (unsigned seed = 1; seed <= 8; ++seed) {
    Case one(seed, 0.1, infinity, 0.0);
    const int ns = one.problem->capacity().states;
    one.limited->clear_limits();
    const double now = one.start.control(2)[0];
    Iterate iterate = one.start;
    iterate.control(2)[0] = 0.01 * now;
    // From here the first one's linearisation asks for about 50 times as much as is possible, the second one forbids
    // it.
    Limit square{.kind = Limit::Kind::squares, .of = {ns}, .with = {1.0}};
    square.lower = now * now;
    Limit side{.kind = Limit::Kind::linear, .of = {ns}, .with = {1.0}};
    side.lower = -1.5 * std::abs(now);
    side.upper = 1.5 * std::abs(now);
    one.limited->add(2, square);
    one.limited->add(2, side);
    const auto solver = gn_rti("{mode: converge}");
    solver->setup(*one.limited);
    const Report report = solver->solve(iterate);
    EXPECT_EQ(report.status, Status::solved) << "seed " << seed << ", residual " << report.kkt.largest();
    EXPECT_TRUE(report.fallback_used) << "seed " << seed;
    EXPECT_GT(std::abs(iterate.control(2)[0]), (1.0 - 1e-6) * std::abs(now));
  }
}

}  // namespace converge_test
}  // namespace rhec
