#include "core/estimation/process_problem.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <limits>

#include "support/bank_case.hpp"

namespace rhec {
namespace process_problem_test {

using namespace testing;

TEST(MakeProcessProblem, TurnsBoundsOfParametersIntoBoundsOfStates) {
  const auto model = linear_model<Hovercraft>();
  const PriorBank bank(model, bank_setup(*model, {linear_priors()[0]}));
  const auto processes = make_process_model(model, bank);
  EXPECT_EQ(processes->state_count(), 4 + 1 + 3) << "a walk, and a Matern 3/2 with its mean";
  RheProblem::Setup setup = linear_setup(*model, 3, ArrivalKind::ekf, {}).problem;
  setup.parameter_lower = {0.25, -1.0};
  setup.parameter_upper = {0.75, 2.0};
  RheProblem problem = make_process_problem(processes, setup);
  problem.set_intervals(3);
  problem.finish();
  EXPECT_EQ(problem.state_lower(1)[4], 0.25);
  EXPECT_EQ(problem.state_upper(1)[4], 0.75);
  EXPECT_EQ(problem.state_lower(1)[5], -1.0);
  EXPECT_EQ(problem.state_upper(1)[5], 2.0);
  EXPECT_EQ(problem.state_lower(1)[6], -std::numeric_limits<double>::infinity());
  EXPECT_EQ(problem.setup().input_weights.back(), 1.0);
}

TEST(InformationOf, IsTheInverse) {
  const Eigen::MatrixXd covariance = initial_covariance(*linear_model<Hovercraft>());
  InformationOf of(6);
  Eigen::MatrixXd information(6, 6);
  of.find(covariance, information);
  EXPECT_LT((information * covariance - Eigen::MatrixXd::Identity(6, 6)).cwiseAbs().maxCoeff(), 1e-10);
  EXPECT_EQ(of.sigmas()[2], std::sqrt(covariance(2, 2)));
}

/// Of two numbers that are the same, and of one that is known: finite, and large where little varies.
TEST(InformationOf, IsFiniteWhereACovarianceIsSingular) {
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Ones(3, 3), information(3, 3);
  covariance.row(2).setZero();
  covariance.col(2).setZero();
  InformationOf of(3);
  of.find(covariance, information);
  EXPECT_TRUE(information.allFinite());
  EXPECT_GT(information(2, 2), 1e20);
  EXPECT_GT(information(0, 0), 1e6);
  EXPECT_EQ(information, information.transpose());
}

}  // namespace process_problem_test
}  // namespace rhec
