#include "rhec/core/estimation/bank_estimation.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "rhec/core/base/angle.hpp"
#include "rhec/core/estimation/estimator.hpp"
#include "rhec/core/prior/standard_bank.hpp"
#include "support/linear_case.hpp"

namespace rhec {
namespace bank_estimation_test {

using namespace testing;

BankEstimation::Setup bicycle_setup(const Model& model, double heading, double sigma, int starts) {
  ModelDescription about = model.description();
  for (Variable& parameter : about.parameters) parameter.lower = 0.0, parameter.upper = 1.0;
  BankEstimation::Setup setup;
  setup.bank.members = standard_bank(about);
  setup.bank.output_variances = {0.0025, 0.0025, 1e-4};
  setup.bank.input_variances = {4e-4, 1e-4};
  setup.parameter_lower = {0.0, 0.0};
  setup.parameter_upper = {1.0, 1.0};
  setup.initial_state = Eigen::Vector4d(0.0, 0.0, heading, 0.0);
  setup.initial_covariance = 0.01 * Eigen::Matrix4d::Identity();
  setup.initial_covariance(2, 2) = sigma * sigma;
  setup.heading_starts = starts;
  return setup;
}

/// Drives straight in a direction; returns the estimate after a number of samples.
Estimate drive(BankEstimation& bank, double direction, int steps) {
  const std::vector<double> inputs = {2.0, 0.0};
  const auto outputs = [&](int k) {
    return std::vector<double>{0.32 * k * std::cos(direction) + 0.01 * std::sin(7.0 * k),
                               0.32 * k * std::sin(direction) + 0.01 * std::cos(5.0 * k), 0.0};
  };
  bank.start(outputs(0).data());
  for (int k = 1; k <= steps; ++k) bank.add_node(0.2, inputs.data(), outputs(k).data());
  Estimate estimate = empty_estimate(bank.model());
  bank.estimate(estimate, Clock::time_point::max());
  EXPECT_FALSE(estimate.fallback);
  EXPECT_EQ(estimate.report.status, Status::solved);
  EXPECT_TRUE(estimate.covariance.allFinite());
  return estimate;
}

TEST(BankEstimation, FindsTheSlipOfAStraightDrive) {
  const std::shared_ptr<const Model> model = host().make_model("bicycle_slip");
  BankEstimation bank(model, bicycle_setup(*model, 0.4, 0.1, 1));
  const Estimate estimate = drive(bank, 0.4, 60);
  EXPECT_NEAR(angle_difference(estimate.state[2], 0.4), 0.0, 0.02);
  EXPECT_NEAR(estimate.parameters[model->description().roles.speed_factor], 0.8, 0.02);
}

TEST(BankEstimation, FindsAHeadingByManyStarts) {
  const std::shared_ptr<const Model> model = host().make_model("bicycle_slip");
  BankEstimation bank(model, bicycle_setup(*model, 0.0, 2.0, 12));
  for (const double direction : {0.1, 1.5, 3.0, -2.0})
    EXPECT_NEAR(angle_difference(drive(bank, direction, 40).state[2], direction), 0.0, 0.05) << direction;
}

TEST(BankEstimation, TakesLateOutputsAtTheNodesThatItRemembers) {
  const std::shared_ptr<const Model> model = host().make_model("bicycle_slip");
  BankEstimation bank(model, bicycle_setup(*model, 0.4, 0.1, 1));
  const Estimate before = drive(bank, 0.4, 10);
  EXPECT_EQ(bank.reach(), 11) << "the start of the run";
  const double fix[] = {before.state[0] + 1.0, nan, nan}, inputs[] = {2.0, 0.0}, nothing[] = {nan, nan, nan};
  bank.rewind(3);
  bank.add_node(0.2, inputs, fix);
  for (int k = 0; k < 2; ++k) bank.add_node(0.2, inputs, nothing);
  Estimate after = empty_estimate(*model);
  bank.estimate(after, Clock::time_point::max());
  EXPECT_GT(after.state[0], before.state[0] + 0.05);
}

TEST(BankEstimation, KeepsItsSlipWhereTheVehicleIsPutElsewhere) {
  const std::shared_ptr<const Model> model = host().make_model("bicycle_slip");
  BankEstimation bank(model, bicycle_setup(*model, 0.4, 0.1, 1));
  const Estimate before = drive(bank, 0.4, 60);
  Eigen::VectorXd mean(6);
  mean << 100.0, -50.0, 1.0, 0.1, 0.0, 0.0;
  const Eigen::MatrixXd covariance = 0.04 * Eigen::MatrixXd::Identity(6, 6);
  ASSERT_TRUE(bank.rebase(mean, covariance));
  EXPECT_EQ(bank.reach(), 0);
  Estimate after = empty_estimate(*model);
  bank.estimate(after, Clock::time_point::max());
  EXPECT_LT((after.state - mean.head(4)).norm(), 1e-9);
  EXPECT_LT((after.covariance.topLeftCorner(4, 4) - covariance.topLeftCorner(4, 4)).norm(), 1e-9);
  EXPECT_LT((after.parameters - before.parameters).norm(), 1e-9);
  EXPECT_LT((after.covariance.bottomRightCorner(2, 2) - before.covariance.bottomRightCorner(2, 2)).norm(), 1e-9);
  EXPECT_LT(after.covariance.topRightCorner(4, 2).norm(), 1e-20);
}

TEST(BankEstimation, KeepsItsParametersWithinTheirBounds) {
  const std::shared_ptr<const Model> model = host().make_model("bicycle_slip");
  BankEstimation::Setup setup = bicycle_setup(*model, 0.0, 0.1, 1);
  setup.parameter_upper = {0.5, 0.5};
  BankEstimation bank(model, std::move(setup));
  EXPECT_EQ(drive(bank, 0.0, 40).parameters[model->description().roles.speed_factor], 0.5);
}

}  // namespace bank_estimation_test
}  // namespace rhec
