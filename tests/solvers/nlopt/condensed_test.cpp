#include "solvers/nlopt/condensed.hpp"

#include <gtest/gtest.h>

#include "problems.hpp"
#include "support/limited_ocp.hpp"

namespace rhec::nlopt {
namespace condensed_test {

using namespace testing;
using rhec::testing::Limit;
using rhec::testing::LimitedOcp;
using rhec::testing::with_limits;
using Vector = Eigen::VectorXd;
using Matrix = Eigen::MatrixXd;

void check_derivatives(const Ocp& ocp, const Iterate& start,
                       const std::shared_ptr<const Feedback>& feedback = nullptr) {
  CondensedProblem problem(ocp);
  ASSERT_TRUE(problem.take(ocp, feedback));
  const Vector x = problem.read(start);
  ASSERT_TRUE(problem.move_to(x));
  const Vector gradient = problem.gradient();
  const Matrix jacobian = problem.jacobian();
  Vector multipliers = Vector::Zero(problem.variables() + problem.rows());
  for (Eigen::Index k = 0; k < problem.rows(); ++k) multipliers[problem.variables() + k] = 0.1 * std::sin(1.0 + k);
  problem.set_multipliers(multipliers);
  const Matrix hessian = problem.hessian(Hessian::exact);
  const auto lagrangian_gradient = [&] {
    return Vector(problem.gradient() + problem.jacobian().transpose() * multipliers.tail(problem.rows()));
  };
  const double step = 1e-5;
  for (Eigen::Index k = 0; k < problem.variables(); ++k) {
    Vector values[2], gradients[2];
    double objectives[2];
    for (const int side : {0, 1}) {
      Vector moved = x;
      moved[k] += side == 0 ? -step : step;
      ASSERT_TRUE(problem.move_to(moved));
      objectives[side] = problem.objective();
      values[side].resize(problem.rows());
      for (int row = 0; row < problem.rows(); ++row) values[side][row] = problem.row_value(row);
      gradients[side] = lagrangian_gradient();
    }
    const double scale = 1.0 + gradient.cwiseAbs().maxCoeff();
    EXPECT_NEAR((objectives[1] - objectives[0]) / (2.0 * step), gradient[k], 1e-6 * scale) << k;
    const Vector column = (values[1] - values[0]) / (2.0 * step);
    if (problem.rows() > 0) {
      EXPECT_LT((column - jacobian.col(k)).cwiseAbs().maxCoeff(), 1e-8) << k;
    }
    const Vector curvature = (gradients[1] - gradients[0]) / (2.0 * step);
    EXPECT_LT((curvature - hessian.col(k)).cwiseAbs().maxCoeff(), 1e-6 * (1.0 + hessian.cwiseAbs().maxCoeff())) << k;
  }
}

TEST(CondensedProblem, HasTheDerivativesThatDifferencesSay) {
  for (const int block : {0, 1, 3}) {
    RandomProblem random(bicycle(), 30U + static_cast<unsigned>(block));
    RandomProblem::RheSpec spec;
    spec.intervals = 7;
    spec.block = block;
    const auto rhe = random.rhe(spec);
    check_derivatives(*rhe, RandomProblem::cold_start(*rhe));
  }
  RandomProblem random(bicycle(), 34);
  RandomProblem::RhcSpec spec;
  spec.intervals = 8;
  spec.blocked_inputs = {1};
  const auto rhc = random.rhc(spec);
  check_derivatives(*rhc, RandomProblem::cold_start(*rhc));
}

/// A hard one, a soft one that is met, and one of the controls that is violated by far, so that differences see one
/// branch: its violation is a part of the objective.
void add_limits(LimitedOcp& limited, int intervals) {
  const int u = limited.capacity().states;
  for (int i = 0; i <= intervals; ++i) {
    limited.add(i, {Limit::Kind::distance, {0, 1}, {0.3 * i, -0.4}, 0.5});
    limited.add(i, {Limit::Kind::linear, {1, 0}, {1.0, -0.3}, -2.0, 1.0, 10.0, 3.0});
    if (i < intervals) limited.add(i, {Limit::Kind::product, {u, 2}, {0.7}, 5.0, infinity, 0.0, 4.0});
  }
}

TEST(CondensedProblem, LimitsAndTheirSlacksHaveTheDerivativesThatDifferencesSay) {
  RandomProblem random(bicycle(), 37);
  RandomProblem::RhcSpec spec;
  spec.intervals = 5;
  const auto rhc = random.rhc(spec);
  LimitedOcp limited(*rhc, 3);
  add_limits(limited, 5);
  const Iterate start = with_limits(limited, RandomProblem::cold_start(*rhc));
  check_derivatives(limited, start);
  CondensedProblem problem(limited);
  ASSERT_TRUE(problem.take(limited));
  CondensedProblem without(*rhc);
  ASSERT_TRUE(without.take(*rhc));
  EXPECT_EQ(problem.variables(), without.variables() + 6 * 2) << "a slack for each side of the linear ones";
  EXPECT_EQ(problem.rows(), without.rows() + 6 * 2);
  problem.move_to(problem.read(start));
  problem.move_to(problem.with_fitting_slacks());
  EXPECT_NEAR(problem.objective(), problem.objective_of_iterate(), 1e-12 * problem.objective());
  for (int row = without.rows(); row < problem.rows(); row += 2)
    EXPECT_LE(problem.row_value(row + 1), problem.row_upper()[row + 1] + 1e-12) << "a slack makes room";
}

/// A controller's problem with bounds of inputs and states, limits of all kinds and a value that is fixed, and a policy
/// about the simulation of other controls.
TEST(CondensedProblem, WithAFeedbackHasTheDerivativesThatDifferencesSay) {
  for (const bool is_blocked : {false, true}) {
    RandomProblem random(bicycle(), 38);
    RandomProblem::RhcSpec spec;
    spec.intervals = 5;
    if (is_blocked) spec.blocked_inputs = {1};
    const auto rhc = random.rhc(spec);
    for (int i = 0; i < 5; ++i) {
      rhc->input_lower(i, 0) = -3.0;
      rhc->input_upper(i, 0) = 3.0;
    }
    rhc->input_lower(2, 0) = rhc->input_upper(2, 0) = 0.7;
    std::vector<double> scratch(rhc->scratch_size());
    rhc->finish(scratch);
    LimitedOcp limited(*rhc, 3);
    add_limits(limited, 5);
    Iterate start = with_limits(limited, RandomProblem::cold_start(*rhc));
    scratch.resize(limited.scratch_size());
    roll_out(limited, start, scratch);
    Regulator regulator;
    regulator.setup(limited);
    const auto feedback = regulator.about(limited, start, scratch);
    ASSERT_NE(feedback, nullptr);
    for (int i = 0; i < 5; ++i) start.control(i)[0] += 0.01 * i;
    roll_out(limited, start, scratch);
    check_derivatives(limited, start, feedback);
    // The same trajectory and the same optimality, in other decisions.
    CondensedProblem problem(limited), without(limited);
    ASSERT_TRUE(problem.take(limited, feedback));
    ASSERT_TRUE(without.take(limited));
    ASSERT_TRUE(problem.move_to(problem.read(start)));
    ASSERT_TRUE(without.move_to(without.read(start)));
    EXPECT_NEAR(problem.objective(), without.objective(), 1e-9 * without.objective());
    EXPECT_EQ(problem.variables(), without.variables());
    EXPECT_GE(problem.rows(), without.rows() + 4) << "bounds of controls";
    Iterate clipped = problem.iterate();
    EXPECT_EQ(clipped.control(2)[0], 0.7);
  }
}

TEST(CondensedProblem, SharesOneSimulationAndOneLinearisationAtAPoint) {
  RandomProblem random(bicycle(), 35);
  const auto ocp = random.rhc({});
  CondensedProblem problem(*ocp);
  ASSERT_TRUE(problem.take(*ocp));
  const Vector x = problem.read(RandomProblem::cold_start(*ocp));
  problem.move_to(x);
  problem.gradient();
  problem.move_to(x);
  problem.jacobian();
  problem.gradient();
  EXPECT_EQ(problem.simulations(), 1);
  EXPECT_EQ(problem.linearisations(), 1);
  problem.move_to(x + Vector::Constant(x.size(), 1e-3));
  problem.gradient();
  EXPECT_EQ(problem.simulations(), 2);
  EXPECT_EQ(problem.linearisations(), 2);
}

TEST(CondensedProblem, LeavesOutWhatItsBoundsFix) {
  RandomProblem random(bicycle(), 36);
  const auto ocp = random.rhc({});
  CondensedProblem problem(*ocp);
  ASSERT_TRUE(problem.take(*ocp));
  const int before = problem.variables();
  ocp->input_lower(3, 0) = ocp->input_upper(3, 0) = 0.7;
  std::vector<double> scratch(ocp->scratch_size());
  ocp->finish(scratch);
  ASSERT_TRUE(problem.take(*ocp));
  EXPECT_EQ(problem.variables(), before - 1);
  problem.move_to(problem.read(RandomProblem::cold_start(*ocp)));
  EXPECT_EQ(problem.iterate().control(3)[0], 0.7);
}

}  // namespace condensed_test
}  // namespace rhec::nlopt
