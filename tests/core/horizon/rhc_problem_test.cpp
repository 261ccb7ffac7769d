#include "rhec/core/horizon/rhc_problem.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "rhec/core/base/error.hpp"
#include "rhec/core/control/input_rate_model.hpp"
#include "support/cart.hpp"
#include "support/error_of.hpp"

namespace rhec {
namespace rhc_problem_test {

using testing::cart;
using testing::cart_control;
using testing::scattered_point;

constexpr double infinity = HUGE_VAL;

/// The sum given in the header, term by term.
double tracking_cost(const RhcProblem& problem, const Iterate& point) {
  double total = 0.0;
  const RhcProblem::Setup& setup = problem.setup();
  for (int i = 0; i <= problem.intervals(); ++i) {
    const auto& weights = i < problem.intervals() ? setup.state_weights : setup.terminal_weights;
    for (int j = 0; j < 2; ++j) total += weights[j] * std::pow(point.state(i)[j] - problem.state_reference(i)[j], 2);
    if (i == problem.intervals()) break;
    double u = 0.0;
    problem.structure().inputs_on(point, i, &u);
    total += setup.input_weights[0] * std::pow(u - problem.input_reference(i)[0], 2);
  }
  return total;
}

TEST(RhcProblem, CostsWhatIsWrittenOfIt) {
  for (const std::vector<int>& blocked : {std::vector<int>{}, std::vector<int>{0}}) {
    const auto problem = cart_control(5, blocked);
    if (!blocked.empty()) {
      const std::uint8_t begins[] = {1, 0, 0, 1, 0};
      problem->set_blocks(0, begins);
      std::vector<double> memory(problem->scratch_size());
      problem->finish(memory);
    }
    const Iterate point = scattered_point(*problem);
    std::vector<double> scratch(problem->scratch_size());
    EXPECT_NEAR(problem->evaluate(point, nullptr, scratch), tracking_cost(*problem, point), 1e-12);
  }
}

TEST(RhcProblem, RefusesASetUpThatDoesNotFit) {
  const RhcProblem::Setup right = cart_control(3)->setup();
  const auto refused = [&](const auto& spoil) {
    RhcProblem::Setup setup = right;
    spoil(setup);
    return error_of([&] { RhcProblem(cart(), setup); });
  };
  EXPECT_EQ(refused([](RhcProblem::Setup&) {}), "");
  EXPECT_NE(refused([](RhcProblem::Setup& s) { s.state_weights = {1.0}; }).find("state weights"), std::string::npos);
  EXPECT_NE(refused([](RhcProblem::Setup& s) { s.terminal_weights[1] = -1.0; }).find("'v'"), std::string::npos);
  EXPECT_NE(refused([](RhcProblem::Setup& s) { s.input_weights.clear(); }).find("input weights"), std::string::npos);
  EXPECT_NE(refused([](RhcProblem::Setup& s) {
              s.input_lower = {2.0};
              s.input_upper = {1.0};
            }).find("lower <= upper"),
            std::string::npos);
  EXPECT_NE(refused([](RhcProblem::Setup& s) { s.max_intervals = 0; }), "");
}

TEST(RhcProblem, BoundsStatesFromTheFirstNodeOnAndInputsPerInterval) {
  const auto problem = cart_control(4);
  problem->input_lower(2, 0) = -0.25;
  std::vector<double> scratch(problem->scratch_size());
  EXPECT_EQ(problem->finish(scratch), 0);
  EXPECT_EQ(problem->state_upper(0)[1], infinity) << "the initial state is given";
  for (int i = 1; i <= 4; ++i) {
    EXPECT_EQ(problem->state_lower(i)[1], -5.0);
    EXPECT_EQ(problem->state_upper(i)[1], 5.0);
    EXPECT_EQ(problem->state_upper(i)[0], infinity);
  }
  EXPECT_EQ(problem->control_lower(1)[0], -1.0);
  EXPECT_EQ(problem->control_lower(2)[0], -0.25);
}

TEST(RhcProblem, KeepsTheBoundsOfEveryIntervalThatABlockCovers) {
  const auto problem = cart_control(4, {0});
  const std::uint8_t begins[] = {1, 0, 1, 0};
  problem->set_blocks(0, begins);
  problem->input_lower(1, 0) = -0.5;
  problem->input_upper(0, 0) = 0.75;
  problem->input_upper(3, 0) = 0.25;
  std::vector<double> scratch(problem->scratch_size());
  problem->finish(scratch);
  EXPECT_EQ(problem->control_count(0), 1);
  EXPECT_EQ(problem->control_count(1), 0);
  EXPECT_EQ(problem->control_lower(0)[0], -0.5);
  EXPECT_EQ(problem->control_upper(0)[0], 0.75);
  EXPECT_EQ(problem->control_lower(2)[0], -1.0);
  EXPECT_EQ(problem->control_upper(2)[0], 0.25);
}

TEST(RhcProblem, MovesBoundsThatAreOutOfReachNoFurtherThanItMust) {
  const auto problem = cart_control(8);
  problem->given_parameters()[0] = 0.0;   // no drag
  problem->given_state()[1] = 5.0 + 0.5;  // a brake of 0.9 m/s2 needs 0.56 s: up to node 2 it is still too fast
  std::vector<double> scratch(problem->scratch_size());
  EXPECT_EQ(problem->finish(scratch), 2);
  for (int i = 1; i <= 8; ++i) {
    const double fastest_braking = 5.5 - 0.9 * 0.2 * i;
    EXPECT_NEAR(problem->state_upper(i)[1], std::max(5.0, fastest_braking), 2e-5) << i;
    EXPECT_GE(problem->state_upper(i)[1], fastest_braking) << "there must be a point that keeps them";
    EXPECT_EQ(problem->state_lower(i)[1], -5.0);
  }
  problem->given_state()[1] = 1.0;
  EXPECT_EQ(problem->finish(scratch), 0);
  EXPECT_EQ(problem->state_upper(1)[1], 5.0) << "they are back where they were";
}

/// The cart with its acceleration as a third state.
std::unique_ptr<RhcProblem> cart_with_rates(double largest_rate) {
  RhcProblem::Setup setup;
  setup.max_intervals = 6;
  setup.state_weights = {2.0, 0.5, 0.3};
  setup.terminal_weights = {7.0, 0.0, 0.3};
  setup.input_weights = {0.2};
  setup.input_lower = {-largest_rate};
  setup.input_upper = {largest_rate};
  setup.rates = {{0, 2}};
  auto problem = std::make_unique<RhcProblem>(std::make_shared<InputRateModel>(cart(), std::vector{0}), setup);
  problem->set_intervals(6);
  for (int i = 0; i < 6; ++i) problem->set_duration(i, 0.2);
  problem->given_parameters()[1] = 1.0;
  return problem;
}

TEST(RhcProblem, HeldInputsReturnToTheirBoundsAsFastAsTheirRatesMay) {
  const auto slow = cart_with_rates(2.0), free = cart_with_rates(infinity);
  std::vector<double> scratch(slow->scratch_size());
  for (RhcProblem* problem : {slow.get(), free.get()}) problem->given_state()[2] = 1.9;  // up to 1 is allowed
  EXPECT_EQ(slow->finish(scratch), 2);
  for (int i = 1; i <= 6; ++i)
    EXPECT_NEAR(slow->state_upper(i)[2], std::max(1.0, 1.9 - 0.4 * i), 1e-5) << "2 m/s3 are 0.4 m/s2 an interval";
  EXPECT_EQ(free->finish(scratch), 0) << "one that may jump is back at once";
  // A state that only a held input can bring back: the speed, with the strongest brake.
  for (RhcProblem* problem : {slow.get(), free.get()}) {
    problem->given_state()[1] = 5.1;
    problem->given_state()[2] = 0.0;
  }
  EXPECT_EQ(free->finish(scratch), 0) << "0.2 m/s an interval";
  EXPECT_EQ(slow->finish(scratch), 1) << "0.08 m/s on the first, 0.16 on the second";
  EXPECT_NEAR(slow->state_upper(1)[1], 5.1 - 0.08, 1e-4);
}

TEST(RhcProblem, TakesNewBoundsOfStatesOnceItIsFinished) {
  const auto problem = cart_with_rates(infinity);
  std::vector<double> scratch(problem->scratch_size());
  problem->finish(scratch);
  EXPECT_EQ(problem->state_upper(3)[2], 1.0);
  problem->set_state_bounds(2, -0.5, 0.25);
  problem->finish(scratch);
  EXPECT_EQ(problem->state_lower(3)[2], -0.5);
  EXPECT_EQ(problem->state_upper(6)[2], 0.25);
  const auto other = cart_with_rates(infinity);
  other->take_data(*problem);
  EXPECT_EQ(other->setup().state_upper[2], 0.25);
  EXPECT_EQ(other->state_upper(6)[2], 0.25);
}

TEST(RhcProblem, RefusesRatesThatAreNotThere) {
  const auto refused = [&](const auto& spoil) {
    RhcProblem::Setup setup = cart_with_rates(1.0)->setup();
    spoil(setup);
    return error_of([&] { RhcProblem(std::make_shared<InputRateModel>(cart(), std::vector{0}), setup); });
  };
  EXPECT_EQ(refused([](RhcProblem::Setup&) {}), "");
  EXPECT_NE(refused([](RhcProblem::Setup& s) { s.rates = {{1, 2}}; }).find("input 1"), std::string::npos);
  EXPECT_NE(refused([](RhcProblem::Setup& s) { s.rates = {{0, 3}}; }).find("state 3"), std::string::npos);
  EXPECT_NE(refused([](RhcProblem::Setup& s) { s.blocked_inputs = {0}; }).find("blocked"), std::string::npos);
}

TEST(RhcProblem, TakesOnTheDataOfAnother) {
  const auto from = cart_control(5), to = cart_control(5);
  from->set_intervals(3);
  from->set_duration(1, 0.7);
  from->state_reference(2)[0] = 3.0;
  from->input_reference(1)[0] = 0.5;
  from->input_upper(1, 0) = 0.125;
  from->given_state()[0] = 8.0;
  std::vector<double> scratch(from->scratch_size());
  from->finish(scratch);
  to->take_data(*from);
  EXPECT_EQ(to->intervals(), 3);
  EXPECT_EQ(to->duration(1), 0.7);
  EXPECT_EQ(to->control_upper(1)[0], 0.125);
  EXPECT_EQ(to->initial_state()[0], 8.0);
  const Iterate point = scattered_point(*from);
  EXPECT_EQ(to->evaluate(point, nullptr, scratch), from->evaluate(point, nullptr, scratch));
}

}  // namespace rhc_problem_test
}  // namespace rhec
