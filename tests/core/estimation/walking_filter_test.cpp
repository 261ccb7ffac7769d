#include "core/estimation/walking_filter.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <vector>

#include <Eigen/Eigenvalues>

#include "support/linear_case.hpp"
#include "support/sensor_faults.hpp"

namespace rhec {
namespace walking_filter_test {

using namespace rhec::testing;

WalkingFilter make(double step = 0.1) {
  const auto model = linear_model<Boat>();
  WalkingFilter filter(model, {.noise = {.output_variances = {0.04, 0.01},
                                         .input_variances = {0.09},
                                         .parameter_lower = {-1e3},
                                         .parameter_upper = {1e3}},
                               .walk = {0.05},
                               .step = step,
                               .substeps = 4});
  filter.mean() = initial_mean(*model);
  filter.covariance() = initial_covariance(*model);
  return filter;
}

TEST(ChiSquareLimit, IsCloseToTheTables) {
  EXPECT_NEAR(chi_square_limit(1, 1.6449), 3.841, 0.15 * 3.841);    // 95 %
  EXPECT_NEAR(chi_square_limit(2, 2.3263), 9.210, 0.1);             // 99 %
  EXPECT_NEAR(chi_square_limit(4, 3.0902), 18.467, 0.02 * 18.467);  // 99.9 %
}

TEST(WalkingFilter, LongPredictionsAreMadeOfSteps) {
  WalkingFilter once = make(), often = make();
  const double input = 0.7;
  once.predict(&input, 1.0);
  for (int k = 0; k < 10; ++k) often.predict(&input, 0.1);
  EXPECT_LT((once.mean() - often.mean()).norm(), 1e-12);
  EXPECT_LT((once.covariance() - often.covariance()).norm(), 1e-12);
}

/// To the bit, and only where it is asked for the same.
TEST(WalkingFilter, WhatItHasCalculatedIsThereForOthers) {
  WalkingFilter filter = make();
  const std::shared_ptr<const FilterMemo> memo = filter.make_memo();
  KalmanFilter other(linear_model<Boat>(), memo->setup().noise, memo->setup().substeps);
  other.mean = filter.mean();
  other.covariance = filter.covariance();
  KalmanFilter start = other;
  const double input = 0.7, outputs[] = {0.2, nan};
  filter.predict(&input, 0.1);
  const double another = 0.8;
  EXPECT_FALSE(memo->prediction.take({&another, 1}, 0.1, other));
  EXPECT_FALSE(memo->prediction.take({&input, 1}, 0.11, other));
  EXPECT_FALSE(memo->update.take(outputs, 0.0, other)) << "no update yet";
  EXPECT_EQ(other.mean, start.mean);
  ASSERT_TRUE(memo->prediction.take({&input, 1}, 0.1, other));
  EXPECT_EQ(other.mean, filter.mean());
  EXPECT_EQ(other.covariance, filter.covariance());
  EXPECT_FALSE(memo->prediction.take({&input, 1}, 0.1, other)) << "from here, it is another step";
  filter.expect();
  filter.update_as_expected(outputs);
  start.predict(&input, &input, 0.1);
  start.add_parameter_variance(0, 0.05 * 0.05);
  start.update(outputs, nullptr);
  ASSERT_TRUE(memo->update.take(outputs, 0.0, other));
  EXPECT_EQ(other.mean, filter.mean());
  EXPECT_EQ(other.mean, start.mean);
  EXPECT_EQ(other.covariance, start.covariance);
}

TEST(WalkingFilter, WhatIsNotKnownOfInputsCountsOnce) {
  WalkingFilter filter = make(), other = make();
  const double input = 0.7, more = 2.0;
  filter.predict(&input, 0.1, &more);
  other.predict(&input, 0.1);
  EXPECT_GT(filter.covariance()(1, 1), other.covariance()(1, 1) + 0.9 * 0.04);
  // The noise of inputs is as before.
  WalkingFilter after = other;
  filter.mean() = other.mean();
  filter.covariance() = other.covariance();
  filter.predict(&input, 0.1);
  after.predict(&input, 0.1);
  EXPECT_LT((filter.covariance() - after.covariance()).norm(), 1e-14);
}

/// Of a motion that nobody knows it is still known that a steering angle ends at its stop, and a heading on a circle.
TEST(WalkingFilter, AnUnknownMotionStaysWithinBounds) {
  const Robot robot = watched_robot("ekf");
  const auto model = robot.model();
  const int nx = model->state_count(), heading = model->description().roles.heading, steering = 3;
  const Variable& angle = model->description().states[steering];
  WalkingFilter filter(model, {.noise = {.output_variances = {1e-3, 1e-3, 3e-4},
                                         .input_variances = {0.01, 0.01},
                                         .parameter_lower = {0.0, 0.0},
                                         .parameter_upper = {1.0, 1.0}},
                               .walk = {0.03, 0.03}});
  filter.mean() = Eigen::VectorXd::Zero(nx + 2);
  filter.mean().tail(2).setConstant(0.75);
  filter.covariance() = 1e-3 * Eigen::MatrixXd::Identity(nx + 2, nx + 2);
  const std::vector<double> inputs = {4.0, -0.3}, more = {1.0, 0.5};
  for (int second = 1; second <= 60; ++second) {
    filter.predict(inputs.data(), 1.0, more.data());
    const Eigen::MatrixXd& P = filter.covariance();
    EXPECT_LE(std::sqrt(P(heading, heading)), std::numbers::pi + 1e-9);
    EXPECT_LE(std::sqrt(P(steering, steering)), 0.5 * (angle.upper - angle.lower) + 1e-9);
    EXPECT_TRUE(P.allFinite());
    EXPECT_GE(P.selfadjointView<Eigen::Lower>().eigenvalues().minCoeff(), -1e-9 * P.diagonal().maxCoeff());
  }
  EXPECT_DOUBLE_EQ(filter.mean()[steering], angle.lower);
  const Eigen::MatrixXd& P = filter.covariance();
  ASSERT_NEAR(std::sqrt(P(heading, heading)), std::numbers::pi, 1e-9);
  EXPECT_DOUBLE_EQ(P.row(heading).squaredNorm(), P(heading, heading) * P(heading, heading)) << "it may be any";
}

TEST(WalkingFilter, InnovationsAreThoseOfTheTextbook) {
  WalkingFilter filter = make();
  filter.expect();
  const Eigen::Matrix<double, 2, 4> H{{1.0, 0.0, 0.0, 0.0}, {0.0, 1.0, -0.2, 0.0}};
  const Eigen::Vector2d y(3.0, -1.0), expected = H * filter.mean() + Eigen::Vector2d(0.0, 1.0);
  const Eigen::Matrix2d S =
      H * filter.covariance() * H.transpose() + Eigen::Matrix2d(Eigen::Vector2d(0.04, 0.01).asDiagonal());
  Innovation innovation;
  ASSERT_TRUE(filter.innovation({"both", {0, 1}}, y.data(), innovation));
  EXPECT_LT((innovation.value - (y - expected)).norm(), 1e-12);
  EXPECT_LT((innovation.covariance - S).norm(), 1e-12);
  EXPECT_NEAR(innovation.nis, (y - expected).dot(S.inverse() * (y - expected)), 1e-9);
  const Eigen::Vector2d second(nan, -1.0);
  ASSERT_TRUE(filter.innovation({"both", {0, 1}}, second.data(), innovation));
  EXPECT_EQ(innovation.value.size(), 1);
  EXPECT_NEAR(innovation.covariance(0, 0), S(1, 1), 1e-12);
  EXPECT_FALSE(filter.innovation({"first", {0}}, second.data(), innovation));
  EXPECT_TRUE(filter.depends_on(1, 2));
  EXPECT_FALSE(filter.depends_on(0, 2));
}

}  // namespace walking_filter_test
}  // namespace rhec
