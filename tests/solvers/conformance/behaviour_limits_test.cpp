// How every solver that is found behaves with limits: when they move from sample to sample, from its own solution, and
// where they are no numbers.
#include "behaviour.hpp"

#include <fmt/format.h>

#include <limits>
#include <string>
#include <vector>

#include "rhec/core/base/infinity.hpp"

namespace rhec::conformance {
namespace behaviour_limits_test {

using testing::Limit;
using testing::LimitedOcp;

class BehaviourWithLimits : public Behaviour {
 protected:
  void SetUp() override {
    const std::string reason = make()->why_not(problem("rhc_limits").posed());
    if (!reason.empty()) GTEST_SKIP() << reason;
  }
};

/// The limits of a problem as they are at a sample: sides move by a few hundredths, and some limits are not there at
/// every sample.
void move_limits(const std::vector<std::vector<Limit>>& from, int sample, LimitedOcp& to) {
  to.clear_limits();
  for (int i = 0; i < static_cast<int>(from.size()); ++i) {
    for (const Limit& limit : from[i]) {
      if ((i + sample) % 7 == 0) continue;
      Limit moved = limit;
      const double by = 0.02 * (1.0 + std::sin(0.7 * sample + 0.3 * i));  // outwards: some point meets them all
      moved.lower -= by;
      moved.upper += by;
      to.add(i, moved);
    }
  }
}

TEST_P(BehaviourWithLimits, FollowsLimitsThatMove) {
  for (const char* name : {"rhc_limits", "rhc_limits_soft", "rhe_limits"}) {
    Problem of = problem(name);
    std::vector<std::vector<Limit>> limits;
    for (int i = 0; i <= of.ocp->intervals(); ++i) limits.push_back(of.limited->limits(i));
    const auto solver = make();
    solver->setup(of.posed());
    for (int sample = 0; sample < 8; ++sample) {
      const std::string when = fmt::format("{}, sample {}", name, sample);
      move_limits(limits, sample, *of.limited);
      // What multipliers of limits there were belongs to other rows, where some limits are new.
      const Assessment assessed = solve(*solver, of), fresh = by_new_instance(of);
      expect_solved(assessed, when);
      EXPECT_NEAR(assessed.objective, fresh.objective, 1e-8 * (1e-3 + std::abs(fresh.objective))) << when;
      of.guess = assessed.point;
    }
  }
}

TEST_P(BehaviourWithLimits, RecognisesItsOwnSolution) {
  for (const char* name : {"rhc_limits", "rhe_limits", "rhc_limits_corridor", "rhc_limits_soft",
                           "rhc_limits_soft_linear", "rhc_limits_soft_quadratic", "rhc_limits_dependent"}) {
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

TEST_P(BehaviourWithLimits, ResetGivesTheBitsOfANewInstance) {
  const Problem wanted = problem("rhc_limits", 2), other = problem("rhc_limits_soft", 1);
  const Assessment expected = by_new_instance(wanted);
  const auto solver = make();
  solver->setup(other.posed());
  solve(*solver, other);
  EXPECT_TRUE(same_bits(wanted.posed(), set_up_and_solve(*solver, wanted).point, expected.point)) << "set up anew";
  solver->reset();
  EXPECT_TRUE(same_bits(wanted.posed(), solve(*solver, wanted).point, expected.point)) << "reset";
}

TEST_P(BehaviourWithLimits, SaysBadInputWhereALimitOrItsMultiplierIsNoNumber) {
  Problem of = problem("rhc_limits");
  const std::vector<Limit> good = of.limited->limits(4);
  ASSERT_FALSE(good.empty());
  const auto solver = make();
  solver->setup(of.posed());
  const auto expect_bad_input = [&](const Iterate& guess, const char* when) {
    Iterate point = guess;
    solver->prepare(point);
    const Report report = solver->solve(point);
    EXPECT_EQ(report.status, Status::bad_input) << when << ": " << name_of(report.status);
    EXPECT_TRUE(same_bits(of.posed(), point, guess)) << when;
  };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  Iterate poisoned = of.guess;
  poisoned.limit_bound(4)[0] = nan;
  expect_bad_input(poisoned, "multiplier");
  std::vector<std::vector<Limit>> limits;
  for (int i = 0; i <= of.ocp->intervals(); ++i) limits.push_back(of.limited->limits(i));
  limits[4][0].upper = nan;
  move_limits(limits, 1, *of.limited);
  expect_bad_input(of.guess, "side");
  limits[4] = good;
  move_limits(limits, 1, *of.limited);
  expect_right(*solver, of, "after a limit that was no number");
}

INSTANTIATE_TEST_SUITE_P(Every, BehaviourWithLimits, ::testing::ValuesIn(all_pairs()),
                         [](const auto& of) { return of.param.solver + "_on_" + of.param.model; });

}  // namespace behaviour_limits_test
}  // namespace rhec::conformance
