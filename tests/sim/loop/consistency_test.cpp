#include "sim/loop/consistency.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <numbers>

namespace rhec::sim {
namespace consistency_test {

/// Two states, the second one an angle, and one parameter.
ModelDescription vehicle() {
  ModelDescription about;
  about.states.resize(2);
  about.states[1].is_angle = true;
  about.parameters.resize(1);
  return about;
}

Sample sample_with_error(double state, double angle, double parameter) {
  Sample sample;
  sample.true_state = Eigen::Vector2d(1.0, 3.0);
  sample.true_parameters = Eigen::VectorXd::Constant(1, 0.8);
  sample.state = sample.true_state + Eigen::Vector2d(state, angle);
  sample.parameters = sample.true_parameters + Eigen::VectorXd::Constant(1, parameter);
  return sample;
}

TEST(Consistency, IsTheErrorSquaredInItsCovariance) {
  const ModelDescription about = vehicle();
  Consistency consistency(about);
  Eigen::Matrix3d root;
  root << 2.0, 0.0, 0.0, 0.5, 1.0, 0.0, -0.3, 0.2, 0.1;
  const Eigen::MatrixXd covariance = root * root.transpose();
  Sample sample = sample_with_error(0.3, -0.2, 0.1);
  consistency.write(covariance, sample);
  const Eigen::Vector3d error(0.3, -0.2, 0.1);
  EXPECT_NEAR(sample.nees, error.dot(covariance.inverse() * error), 1e-12);
  EXPECT_NEAR(sample.sigma[2], std::sqrt(covariance(2, 2)), 1e-15);
  // Whole turns are no error.
  Sample turned = sample_with_error(0.3, 2.0 * std::numbers::pi - 0.2, 0.1);
  consistency.write(covariance, turned);
  EXPECT_NEAR(turned.nees, sample.nees, 1e-9);
}

TEST(Consistency, IsUnknownWithoutACovariance) {
  const ModelDescription about = vehicle();
  Consistency consistency(about);
  Sample sample = sample_with_error(0.3, -0.2, 0.1);
  sample.sigma = Eigen::VectorXd::Ones(3);
  consistency.write({}, sample);
  EXPECT_TRUE(std::isnan(sample.nees));
  EXPECT_EQ(sample.sigma.size(), 0);
}

TEST(Consistency, IsFiniteWhereOneNumberIsKnownExactly) {
  const ModelDescription about = vehicle();
  Consistency consistency(about);
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Identity(3, 3);
  covariance(0, 0) = 0.0;
  Sample sample = sample_with_error(0.0, 2.0, 1.0);
  consistency.write(covariance, sample);
  EXPECT_NEAR(sample.nees, 5.0 + 1.0, 1e-12);  // the number that is known exactly counts as is expected of one
}

// A chain of states far behind the only one that is measured: rounding errors alone make small variances negative.
TEST(Consistency, IsThatOfTheDirectionsThatACovarianceResolves) {
  const ModelDescription about = vehicle();
  Consistency consistency(about);
  const Eigen::Vector3d first(1.0, 2.0, -1.0), second(0.5, -0.1, 0.3);
  for (const double rounding : {1e-15, -1e-15, 1e-13, -1e-13}) {
    Eigen::MatrixXd covariance = first * first.transpose() + second * second.transpose();
    covariance(2, 2) += rounding;
    const Eigen::Vector3d error = 0.7 * first - 1.1 * second;
    Sample sample = sample_with_error(error[0], error[1], error[2]);
    consistency.write(covariance, sample);
    EXPECT_NEAR(sample.nees, 0.7 * 0.7 + 1.1 * 1.1 + 1.0, 1e-9) << rounding;
  }
}

}  // namespace consistency_test
}  // namespace rhec::sim
