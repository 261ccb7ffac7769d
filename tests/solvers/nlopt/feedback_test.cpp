#include "solvers/nlopt/feedback.hpp"

#include <gtest/gtest.h>

#include "rhec/core/qp/stage_qp_views.hpp"
#include "solvers/nlopt/condensed.hpp"
#include "support/cart.hpp"
#include "support/unstable.hpp"

namespace rhec::nlopt {
namespace feedback_test {

using rhec::testing::cart_control;
using rhec::testing::unstable_control;
using rhec::testing::unstable_guess;
using Matrix = Eigen::MatrixXd;

TEST(Regulator, SaysByHowMuchDeviationsGrow) {
  const auto unstable = unstable_control(20);
  std::vector<double> scratch(unstable->scratch_size());
  Regulator regulator;
  regulator.setup(*unstable);
  Iterate at_rest(unstable->capacity());
  roll_out(*unstable, at_rest, scratch);
  // x' = 3 x at rest, over 4 s, by Runge-Kutta of fourth order.
  const double h = 3.0 * 0.2, step = 1.0 + h + h * h / 2.0 + h * h * h / 6.0 + h * h * h * h / 24.0;
  EXPECT_NEAR(regulator.growth(*unstable, at_rest, scratch), std::pow(step, 20), 1e-9 * std::pow(step, 20));

  const auto cart = cart_control(20);
  scratch.resize(cart->scratch_size());
  regulator.setup(*cart);
  Iterate drive(cart->capacity());
  roll_out(*cart, drive, scratch);
  EXPECT_LT(regulator.growth(*cart, drive, scratch), 2.0);
}

TEST(Regulator, HasAPolicyAlongWhichDeviationsDecay) {
  const int intervals = 20;
  const auto problem = unstable_control(intervals);
  std::vector<double> scratch(problem->scratch_size());
  problem->input_lower(4, 0) = problem->input_upper(4, 0) = 0.5;
  problem->finish(scratch);
  Iterate point(problem->capacity());
  point.state(0)[0] = problem->initial_state()[0];
  roll_out(*problem, point, scratch);
  Regulator regulator;
  regulator.setup(*problem);
  const auto feedback = regulator.about(*problem, point, scratch);
  ASSERT_NE(feedback, nullptr);
  StageQp qp(problem->capacity());
  problem->linearise(all_stages(*problem), point, Hessian::none, qp, scratch);
  for (int i = 0; i < intervals; ++i) {
    const Matrix& K = feedback->gains[static_cast<std::size_t>(i)];
    if (i == 4) {
      EXPECT_EQ(K(0, 0), 0.0) << "a fixed control follows nothing";
    } else {
      EXPECT_LT(std::abs((A_of(qp, i) + B_of(qp, i) * K)(0, 0)), 0.9) << i;
    }
    EXPECT_EQ(feedback->of(i, 0, point), 0.0);
  }
}

TEST(Regulator, KeepsSimulationsTogether) {
  const int intervals = 40;
  const auto problem = unstable_control(intervals);
  std::vector<double> scratch(problem->scratch_size());
  Iterate point(problem->capacity());
  point.state(0)[0] = problem->initial_state()[0];
  roll_out(*problem, point, scratch);
  Regulator regulator;
  regulator.setup(*problem);
  const auto largest = [&](const std::shared_ptr<const Feedback>& feedback) {
    CondensedProblem condensed(*problem);
    EXPECT_TRUE(condensed.take(*problem, feedback));
    Eigen::VectorXd x = condensed.read(point);
    EXPECT_TRUE(condensed.move_to(x));
    EXPECT_EQ(condensed.iterate().state(intervals)[0], point.state(intervals)[0]) << "it begins where it is about";
    x[0] += 1e-6;
    EXPECT_TRUE(condensed.move_to(x));
    double change = 0.0;
    for (int i = 0; i <= intervals; ++i)
      change = std::max(change, std::abs(condensed.iterate().state(i)[0] - point.state(i)[0]));
    return change;
  };
  EXPECT_GT(largest(nullptr), 1e2);
  EXPECT_LT(largest(regulator.about(*problem, point, scratch)), 1e-6);
}

}  // namespace feedback_test
}  // namespace rhec::nlopt
