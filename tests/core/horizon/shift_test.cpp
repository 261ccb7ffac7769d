#include "rhec/core/horizon/shift.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <vector>

#include "rhec/core/horizon/rhc_problem.hpp"
#include "rhec/core/horizon/rhe_problem.hpp"
#include "rhec/core/model/formula_model.hpp"
#include "rhec/core/qp/kkt.hpp"
#include "rhec/core/qp/stage_qp_views.hpp"
#include "support/allocations.hpp"

namespace rhec {
namespace shift_test {

constexpr double missing = std::numeric_limits<double>::quiet_NaN();

/// A cart: position and speed; acceleration and a second input without effect on the speed; drag as parameter.
template <class Scalar>
struct Cart {
  static constexpr int state_count = 2, input_count = 2, parameter_count = 2, output_count = 1;
  void dynamics(const Scalar* x, const Scalar* u, const Scalar* p, Scalar* dxdt) const {
    dxdt[0] = x[1] + u[1];
    dxdt[1] = u[0] * p[1] - p[0] * x[1];
  }
  void outputs(const Scalar* x, Scalar* y) const { y[0] = x[0]; }
};

std::shared_ptr<const Model> cart() {
  ModelDescription about;
  about.name = "cart";
  about.states = {{"x", "m", ""}, {"v", "m/s", "", -50.0, 50.0}};
  about.inputs = {{"a", "m/s^2", "", -2.0, 2.0}, {"w", "m/s", "", -2.0, 2.0}};
  about.parameters = {{"drag", "1/s", "", 0.0, 1.0}, {"gain", "1", "", 0.0, 2.0}};
  about.outputs = {{"x", "m", ""}};
  return std::make_shared<FormulaModel<Cart>>(Cart<double>{}, about);
}

RheProblem estimator(int intervals) {
  RheProblem::Setup setup;
  setup.max_intervals = 8;
  setup.output_weights = {1.0};
  setup.input_weights = {1.0, 1.0};
  RheProblem problem(cart(), setup);
  problem.set_intervals(intervals);
  for (int i = 0; i < intervals; ++i) problem.set_duration(i, 0.1);
  return problem;
}

/// Blocks of `drag` begin at the given intervals; `gain` is one block.
void set_blocks(RheProblem& problem, int intervals, std::vector<int> starts, Transition transition = Transition::step) {
  problem.set_intervals(intervals);
  for (int i = 0; i < intervals; ++i) problem.set_duration(i, 0.1);
  std::vector<std::uint8_t> drag(intervals, 0), gain(intervals, 0);
  gain[0] = 1;
  for (const int start : starts) drag[start] = 1;
  problem.set_blocks(0, drag.data(), transition);
  problem.set_blocks(1, gain.data(), Transition::step);
  problem.finish();
}

/// A point with a different number everywhere, without defects.
Iterate point_of(const HorizonProblem& problem) {
  Iterate point(problem.capacity());
  const int N = problem.intervals(), nx = 2;
  std::vector<double> inputs, parameters;
  for (int i = 0; i < N; ++i) {
    inputs.insert(inputs.end(), {0.1 * (i + 1), -0.01 * (i + 1)});
    parameters.insert(parameters.end(), {0.02 * (i + 1), 1.5});
  }
  point.state(0)[0] = 3.0;
  point.state(0)[1] = 2.0;
  problem.structure().set_decisions(point, inputs.data(), parameters.data());
  std::vector<double> scratch(problem.scratch_size());
  roll_out(problem, point, scratch);
  for (int i = 0; i <= N; ++i) {
    for (int j = 0; j < nx; ++j) {
      point.costate(i)[j] = 10.0 * i + j + 1.0;
      point.state_bound(i)[j] = -0.5 * i - 0.25;
    }
    for (int j = 0; i < N && j < problem.control_count(i); ++j) point.control_bound(i)[j] = i + 0.1 * j;
  }
  return point;
}

double largest_defect(const HorizonProblem& problem, const Iterate& point) {
  std::vector<double> scratch(problem.scratch_size());
  std::vector<double> defects(static_cast<std::size_t>(problem.intervals()) * problem.capacity().states);
  problem.evaluate(point, defects.data(), scratch);
  double largest = 0.0;
  for (const double defect : defects) largest = std::max(largest, std::abs(defect));
  return largest;
}

std::array<double, 2> inputs_on(const HorizonProblem& problem, const Iterate& point, int interval) {
  std::array<double, 2> u{};
  problem.structure().inputs_on(point, interval, u.data());
  return u;
}

std::array<double, 2> parameters_on(const HorizonProblem& problem, const Iterate& point, int interval) {
  std::array<double, 2> p{};
  problem.structure().parameters_on(point, interval, p.data());
  return p;
}

TEST(Shift, MovesAnEstimatorsWindowWhoseBordersSlide) {
  RheProblem problem = estimator(6);
  set_blocks(problem, 6, {0, 1, 4});
  const Iterate old = point_of(problem);
  GuessShifter shifter(problem);
  shifter.take(problem, old);
  std::vector<std::array<double, 2>> inputs, parameters;
  for (int i = 0; i < 6; ++i) {
    inputs.push_back(inputs_on(problem, old, i));
    parameters.push_back(parameters_on(problem, old, i));
  }

  set_blocks(problem, 6, {0, 3});  // the block that began at 1 is now the window's first
  for (int i = 0; i < 6; ++i) problem.measured_input(i)[0] = 1.25;
  problem.measured_input(5)[1] = missing;
  Iterate guess(problem.capacity());
  ASSERT_TRUE(shifter.apply(1, problem, guess));
  for (int i = 0; i < 5; ++i) {
    EXPECT_EQ(inputs_on(problem, guess, i), inputs[i + 1]) << i;
    EXPECT_EQ(parameters_on(problem, guess, i), parameters[i + 1]) << i;
    EXPECT_EQ(guess.state(i)[0], old.state(i + 1)[0]);
    EXPECT_EQ(guess.state(i)[1], old.state(i + 1)[1]);
  }
  EXPECT_EQ(inputs_on(problem, guess, 5)[0], 1.25) << "as measured";
  EXPECT_EQ(inputs_on(problem, guess, 5)[1], inputs[5][1]) << "as last where nothing was measured";
  EXPECT_EQ(parameters_on(problem, guess, 5), parameters[5]);
  EXPECT_LT(largest_defect(problem, guess), 1e-12);
  EXPECT_TRUE(guess.is_finite());
}

TEST(Shift, MayWriteIntoThePointThatWasTaken) {
  RheProblem problem = estimator(6);
  set_blocks(problem, 6, {0, 1, 4});
  Iterate point = point_of(problem);
  GuessShifter shifter(problem);
  Iterate fresh(problem.capacity());
  long before = allocation_count();
  shifter.take(problem, point);
  EXPECT_EQ(allocation_count() - before, 0);
  set_blocks(problem, 6, {0, 3});
  before = allocation_count();
  ASSERT_TRUE(shifter.apply(1, problem, fresh));
  ASSERT_TRUE(shifter.apply(1, problem, point));
  EXPECT_EQ(allocation_count() - before, 0) << "nothing is allocated once the shifter is there";
  for (int i = 0; i <= 6; ++i) {
    for (int j = 0; j < problem.capacity().states; ++j) {
      EXPECT_EQ(point.state(i)[j], fresh.state(i)[j]);
      EXPECT_EQ(point.costate(i)[j], fresh.costate(i)[j]);
      EXPECT_EQ(point.state_bound(i)[j], fresh.state_bound(i)[j]);
    }
    for (int j = 0; i < 6 && j < problem.control_count(i); ++j) {
      EXPECT_EQ(point.control(i)[j], fresh.control(i)[j]);
      EXPECT_EQ(point.control_bound(i)[j], fresh.control_bound(i)[j]);
    }
  }
}

TEST(Shift, GrowsAWindow) {
  RheProblem problem = estimator(3);
  set_blocks(problem, 3, {0, 2});
  const Iterate old = point_of(problem);
  GuessShifter shifter(problem);
  shifter.take(problem, old);
  set_blocks(problem, 4, {0, 2});
  problem.measured_input(3)[0] = 100.0;  // beyond no bound: measured inputs have none here
  Iterate guess(problem.capacity());
  ASSERT_TRUE(shifter.apply(0, problem, guess));
  for (int i = 0; i <= 3; ++i) EXPECT_EQ(guess.state(i)[0], old.state(i)[0]);
  EXPECT_EQ(inputs_on(problem, guess, 3)[0], 100.0);
  EXPECT_LT(largest_defect(problem, guess), 1e-12);
}

TEST(Shift, KeepsTheValueBeforeARampThatReachesTheWindowsEdge) {
  RheProblem problem = estimator(6);
  set_blocks(problem, 6, {2}, Transition::ramp);
  const Iterate old = point_of(problem);
  const double before = old.state(2)[2], after = old.state(3)[2];
  ASSERT_NE(before, after);
  GuessShifter shifter(problem);
  shifter.take(problem, old);
  set_blocks(problem, 6, {0}, Transition::ramp);
  Iterate guess(problem.capacity());
  ASSERT_TRUE(shifter.apply(2, problem, guess));
  EXPECT_EQ(guess.state(0)[2], before);
  EXPECT_EQ(parameters_on(problem, guess, 0)[0], after);
  EXPECT_LT(largest_defect(problem, guess), 1e-12);
}

TEST(Shift, MovesMultipliersInTheVehiclesTerms) {
  RheProblem problem = estimator(6);
  set_blocks(problem, 6, {0, 2, 4});
  Iterate old = point_of(problem);
  old.control_bound(2)[2] = 8.0;  // of the block of intervals 2, 3
  old.control_bound(4)[2] = 6.0;
  GuessShifter shifter(problem);
  shifter.take(problem, old);
  set_blocks(problem, 6, {0, 2});  // moved by 2: both blocks are there as they were, the last one longer
  Iterate guess(problem.capacity());
  ASSERT_TRUE(shifter.apply(2, problem, guess));
  EXPECT_NEAR(guess.state_bound(0)[2], 8.0, 1e-12) << "the window's first block is decided at node 0";
  EXPECT_NEAR(guess.control_bound(2)[2], 6.0, 1e-12);
  for (int j = 0; j < 2; ++j) EXPECT_EQ(guess.costate(0)[j], 0.0) << "a free initial state has no costate";
  EXPECT_EQ(guess.costate(3)[1], old.costate(5)[1]);
  EXPECT_EQ(guess.costate(5)[1], 0.0) << "beyond what was known";
  EXPECT_EQ(guess.state_bound(1)[1], old.state_bound(3)[1]);
  EXPECT_EQ(guess.state_bound(1)[0], 0.0) << "no bound, no multiplier";
  EXPECT_EQ(guess.state_bound(5)[1], 0.0);
}

RhcProblem controller(std::vector<int> blocked) {
  RhcProblem::Setup setup;
  setup.max_intervals = 6;
  setup.state_weights = {1.0, 0.0};
  setup.input_weights = {1.0, 1.0};
  setup.terminal_weights = {10.0, 0.0};
  setup.blocked_inputs = std::move(blocked);
  RhcProblem problem(cart(), setup);
  problem.set_intervals(6);
  for (int i = 0; i < 6; ++i) problem.set_duration(i, 0.1);
  problem.given_state()[0] = 3.0;
  problem.given_state()[1] = 2.0;
  problem.given_parameters()[0] = 0.3;
  problem.given_parameters()[1] = 1.5;
  const std::array<std::uint8_t, 6> begins{1, 0, 1, 0, 1, 0};
  problem.set_blocks(0, begins.data());
  std::vector<double> scratch(problem.scratch_size());
  problem.finish(scratch);
  return problem;
}

TEST(Shift, MovesAControllersPlan) {
  RhcProblem problem = controller({});
  const Iterate old = point_of(problem);
  GuessShifter shifter(problem);
  shifter.take(problem, old);
  Iterate guess(problem.capacity());
  ASSERT_TRUE(shifter.apply(1, problem, guess));
  for (int i = 0; i < 6; ++i) EXPECT_EQ(inputs_on(problem, guess, i), inputs_on(problem, old, std::min(i + 1, 5)));
  EXPECT_LT(largest_defect(problem, guess), 1e-12);
  for (int i = 0; i < 6; ++i) EXPECT_EQ(guess.costate(i)[0], old.costate(i + 1)[0]);
  EXPECT_EQ(guess.costate(6)[0], old.costate(6)[0]);
  for (int j = 0; j < 4; ++j) EXPECT_EQ(guess.state_bound(0)[j], 0.0) << "node 0 is given, not bounded";
}

TEST(Shift, ClipsToBoundsThatHaveMoved) {
  RhcProblem problem = controller({});
  const Iterate old = point_of(problem);
  GuessShifter shifter(problem);
  shifter.take(problem, old);
  for (int i = 0; i < 6; ++i) problem.input_upper(i, 0) = 0.25;
  std::vector<double> scratch(problem.scratch_size());
  problem.finish(scratch);
  Iterate guess(problem.capacity());
  ASSERT_TRUE(shifter.apply(1, problem, guess));
  for (int i = 0; i < 6; ++i) EXPECT_LE(inputs_on(problem, guess, i)[0], 0.25);
}

TEST(Shift, MovesBlockedInputsThroughBordersThatStay) {
  RhcProblem problem = controller({0});
  const Iterate old = point_of(problem);
  GuessShifter shifter(problem);
  shifter.take(problem, old);
  Iterate guess(problem.capacity());
  ASSERT_TRUE(shifter.apply(1, problem, guess));
  for (int i = 0; i < 6; ++i) {
    EXPECT_EQ(inputs_on(problem, guess, i)[0], inputs_on(problem, old, std::min(2 * (i / 2) + 1, 5))[0]);
    EXPECT_EQ(inputs_on(problem, guess, i)[1], inputs_on(problem, old, std::min(i + 1, 5))[1]);
  }
  EXPECT_TRUE(guess.is_finite());
}

TEST(Shift, SaysWhenNothingIsLeft) {
  RhcProblem problem = controller({});
  GuessShifter shifter(problem);
  Iterate guess(problem.capacity());
  guess.state(0)[0] = 7.0;
  EXPECT_FALSE(shifter.apply(1, problem, guess)) << "nothing was taken";
  shifter.take(problem, point_of(problem));
  EXPECT_FALSE(shifter.apply(7, problem, guess));
  EXPECT_FALSE(shifter.apply(-1, problem, guess));
  EXPECT_EQ(guess.state(0)[0], 7.0);
  EXPECT_TRUE(shifter.apply(6, problem, guess)) << "the last node is left";
  shifter.forget();
  EXPECT_FALSE(shifter.apply(1, problem, guess));
}

/// The costates of carried parameters satisfy stationarity in the new structure too.
TEST(Shift, CostatesOfCarriedParametersFitTheNewStructure) {
  RheProblem problem = estimator(6);
  set_blocks(problem, 6, {0, 2, 4});
  for (int i = 0; i <= 6; ++i) problem.output(i)[0] = 3.0 + 0.3 * i;
  const auto stationary = [&](Iterate& point) {
    StageQp qp(problem.capacity());
    std::vector<double> scratch(problem.scratch_size());
    problem.linearise(all_stages(problem), point, Hessian::gauss_newton, qp, scratch);
    set_costates(qp, point);
    // Stationarity in the controls that start blocks, by the multipliers of their bounds.
    for (int i = 0; i < problem.intervals(); ++i) {
      for (int j = 0; j < problem.control_count(i); ++j) {
        double sum = qp.r(i)[j];
        for (int r = 0; r < 4; ++r) sum += B_of(qp, i)(r, j) * point.costate(i + 1)[r];
        point.control_bound(i)[j] = -sum;
      }
    }
  };
  Iterate old = point_of(problem);
  old.clear_multipliers();
  old.control(2)[2] =
      old.state(0)[2];  // the same value in the blocks that will be one, so that the point stays the same
  std::vector<double> room(problem.scratch_size());
  roll_out(problem, old, room);
  stationary(old);
  GuessShifter shifter(problem);
  shifter.take(problem, old);
  Iterate guess(problem.capacity());
  set_blocks(problem, 6, {0, 4});  // the same horizon, but two blocks are one now
  ASSERT_TRUE(shifter.apply(0, problem, guess));
  EXPECT_EQ(guess.costate(6)[2], 0.0);
  EXPECT_NEAR(guess.costate(5)[2], old.costate(5)[2], 1e-12);
  EXPECT_EQ(guess.costate(4)[2], 0.0) << "a block starts there: what was before it does not matter";
  EXPECT_NEAR(guess.costate(3)[2], old.costate(3)[2], 1e-12);
  // In interval 2 the block started before; now it carries, and its gradient adds to that of interval 3.
  StageQp qp(problem.capacity());
  std::vector<double> scratch(problem.scratch_size());
  problem.linearise(all_stages(problem), old, Hessian::gauss_newton, qp, scratch);
  double expected = qp.q(2)[2] + old.costate(3)[2];
  for (int r = 0; r < 2; ++r) expected += A_of(qp, 2)(r, 2) * old.costate(3)[r];
  EXPECT_NEAR(guess.costate(2)[2], expected, 1e-9 * (1.0 + std::abs(expected)));
}

}  // namespace shift_test
}  // namespace rhec
