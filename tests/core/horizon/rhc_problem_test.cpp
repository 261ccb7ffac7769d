#include "rhec/core/horizon/rhc_problem.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "rhec/core/base/error.hpp"
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
