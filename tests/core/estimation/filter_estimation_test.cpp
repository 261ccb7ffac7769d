#include "rhec/core/estimation/filter_estimation.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "rhec/core/base/angle.hpp"
#include "rhec/core/base/error.hpp"
#include "rhec/core/estimation/estimator.hpp"
#include "support/linear_case.hpp"

namespace rhec {
namespace filter_estimation_test {

using namespace testing;

FilterEstimation::Setup bicycle_setup(double heading, double sigma, int starts) {
  FilterEstimation::Setup setup;
  setup.noise = {{0.0025, 0.0025, 1e-4}, {4e-4, 1e-4}, {0.0, 0.0}, {1.0, 1.0}};
  setup.walk = {0.01, 0.01};
  setup.initial_mean = Eigen::VectorXd::Zero(6);
  setup.initial_mean << 0.0, 0.0, heading, 0.0, 0.8, 0.8;
  setup.initial_covariance = Eigen::MatrixXd::Identity(6, 6) * 0.01;
  setup.initial_covariance(2, 2) = sigma * sigma;
  setup.heading_starts = starts;
  return setup;
}

/// Drives straight in a direction; returns the error of the estimated heading after a number of samples.
double heading_error(FilterEstimation& filter, double direction, int steps) {
  const std::vector<double> inputs = {2.0, 0.0};
  const auto outputs = [&](int k) {
    return std::vector<double>{0.32 * k * std::cos(direction) + 0.01 * std::sin(7.0 * k),
                               0.32 * k * std::sin(direction) + 0.01 * std::cos(5.0 * k), 0.0};
  };
  filter.start(outputs(0).data());
  for (int k = 1; k <= steps; ++k) filter.add_node(0.2, inputs.data(), outputs(k).data());
  Estimate estimate = empty_estimate(filter.model());
  filter.estimate(estimate, Clock::time_point::max());
  EXPECT_FALSE(estimate.fallback);
  EXPECT_EQ(estimate.report.status, Status::solved);
  EXPECT_TRUE(estimate.covariance.allFinite());
  return std::abs(angle_difference(estimate.state[2], direction));
}

TEST(FilterEstimation, FindsAHeadingByABankOfStarts) {
  const std::shared_ptr<const Model> model = host().make_model("bicycle_slip");
  for (const double direction : {0.1, 1.5, 3.0, -2.0}) {
    FilterEstimation bank(model, bicycle_setup(0.0, 2.0, 12));
    EXPECT_LT(heading_error(bank, direction, 40), 0.05) << direction;
    EXPECT_LT(heading_error(bank, direction + 2.0, 40), 0.05) << "it starts anew";
  }
}

TEST(FilterEstimation, TrustsTheInitialHeadingWithOneStart) {
  const std::shared_ptr<const Model> model = host().make_model("bicycle_slip");
  FilterEstimation one(model, bicycle_setup(1.5, 0.2, 1));
  EXPECT_LT(heading_error(one, 1.6, 40), 0.05);
}

TEST(FilterEstimation, AmendsItsNewestNodeOnly) {
  const auto model = linear_model<Trolley>();
  const auto samples = simulate(*model, 5, true, 4);
  FilterEstimation::Setup setup;
  const testing::Noise noise = noise_of(*model);
  for (const double sigma : noise.outputs) setup.noise.output_variances.push_back(sigma * sigma);
  for (const double sigma : noise.inputs) setup.noise.input_variances.push_back(sigma * sigma);
  setup.initial_mean = initial_mean(*model);
  setup.initial_covariance = initial_covariance(*model);
  FilterEstimation at_once(model, setup), in_parts(model, setup);
  Estimate expected = empty_estimate(*model), found = expected;
  const double both[] = {0.4, 0.3}, first[] = {0.4, nan}, second[] = {nan, 0.3}, nothing[] = {nan, nan};
  at_once.start(nothing);
  at_once.add_node(0.2, samples[1].inputs.data(), both);
  at_once.estimate(expected, Clock::time_point::max());
  in_parts.start(nothing);
  in_parts.add_node(0.2, samples[1].inputs.data(), first);
  EXPECT_FALSE(in_parts.amend(1, second)) << "it has no memory of older nodes";
  EXPECT_TRUE(in_parts.amend(0, second));
  in_parts.estimate(found, Clock::time_point::max());
  EXPECT_LT((found.state - expected.state).cwiseAbs().maxCoeff(), 1e-12);
  EXPECT_LT((found.covariance - expected.covariance).cwiseAbs().maxCoeff(), 1e-12);
}

TEST(FilterEstimation, RefusesASetUpThatDoesNotFit) {
  const std::shared_ptr<const Model> model = host().make_model("bicycle_slip");
  FilterEstimation::Setup setup = bicycle_setup(0.0, 0.1, 1);
  setup.walk = {0.01};
  EXPECT_THROW(FilterEstimation(model, setup), Error);
  setup = bicycle_setup(0.0, 0.1, 1);
  setup.initial_mean = Eigen::VectorXd::Zero(4);
  EXPECT_THROW(FilterEstimation(model, setup), Error);
  setup = bicycle_setup(0.0, 0.1, 1);
  setup.initial_covariance = Eigen::MatrixXd::Identity(6, 4);
  EXPECT_THROW(FilterEstimation(model, setup), Error);
}

}  // namespace filter_estimation_test
}  // namespace rhec
