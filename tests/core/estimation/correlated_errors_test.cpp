#include "core/estimation/correlated_errors.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>

#include "core/estimation/log_volume.hpp"
#include "support/linear_case.hpp"
#include "support/sensor_faults.hpp"

namespace rhec::correlated_errors_test {
namespace {

using namespace rhec::testing;

constexpr double heads = 0.7;

/// A bicycle that heads there, and what its receiver differs by.
struct Receiver {
  explicit Receiver(unsigned seed) : random(seed) {
    filter.mean() = Eigen::VectorXd::Zero(size());
    filter.mean()[heading()] = heads;
    filter.covariance() = Eigen::MatrixXd::Identity(size(), size());
    filter.expect();
  }
  Eigen::Index size() const { return filter.model().state_count() + filter.model().parameter_count(); }
  int heading() const { return filter.model().description().roles.heading; }
  Eigen::VectorXd state() const { return filter.mean().head(filter.model().state_count()); }
  /// Innovations of which those along and across have these correlations with the ones before.
  void give(CorrelatedErrors& errors, double along, double across, int count) {
    const Eigen::Array2d correlation(along, across);
    for (int k = 0; k < count; ++k) {
      value =
          correlation * value + (1.0 - correlation.square()).sqrt() * Eigen::Array2d(normal(random), normal(random));
      Innovation innovation;
      innovation.value = 0.03 * (Eigen::Rotation2D<double>(heads) * value.matrix());
      innovation.covariance = 0.03 * 0.03 * Eigen::Matrix2d::Identity();
      errors.take(filter, 0, sensors[0], innovation);
    }
    errors.note(0.0, size());
  }
  std::vector<Sensor> sensors = {{"receiver", {0, 1}}};
  WalkingFilter filter{watched_robot("ekf").model(),
                       {.noise = {.output_variances = {9e-4, 9e-4, 3e-4},
                                  .input_variances = {0.01, 0.01},
                                  .parameter_lower = {0.0, 0.0},
                                  .parameter_upper = {1.0, 1.0}},
                        .walk = {0.03, 0.03}}};
  std::mt19937 random;
  std::normal_distribution<double> normal;
  Eigen::Array2d value = Eigen::Array2d::Zero();
};

/// The mean of n values with the correlations r^k has the variance (1 + r) / (1 - r) / n, nine times as large for 0.8.
TEST(CorrelatedErrors, AreToldApartAlongTheWayAndAcross) {
  Eigen::Array2d position = Eigen::Array2d::Zero();
  double of_heading = 0.0, of_slip = 0.0;
  constexpr int sequences = 10;
  for (unsigned seed = 0; seed < sequences; ++seed) {
    Receiver receiver(seed);
    CorrelatedErrors errors(receiver.filter.model());
    errors.reset(receiver.sensors);
    receiver.give(errors, 0.0, 0.8, 1000);
    Eigen::MatrixXd P = receiver.filter.covariance();
    errors.scale(receiver.state(), P);
    const Eigen::Rotation2D<double> to_vehicle(-heads);
    const Eigen::Matrix2d seen =
        to_vehicle.toRotationMatrix() * P.topLeftCorner(2, 2) * to_vehicle.toRotationMatrix().transpose();
    position += seen.diagonal().array() / sequences;
    of_heading += P(receiver.heading(), receiver.heading()) / sequences;
    of_slip += P(receiver.size() - 1, receiver.size() - 1) / sequences;
  }
  EXPECT_LT(position[0], 1.2);
  EXPECT_GT(position[1], 4.0);
  EXPECT_LT(position[1], 9.0);
  EXPECT_NEAR(of_heading, position[1], 1e-12 * of_heading);
  EXPECT_GT(of_slip, 1.5);
  EXPECT_LT(of_slip, 0.8 * position[1]);
}

TEST(CorrelatedErrors, OfWhiteInnovationsTheCovarianceHardlyGrows) {
  double sum = 0.0;
  constexpr int sequences = 40;
  for (unsigned seed = 0; seed < sequences; ++seed) {
    Receiver receiver(seed);
    CorrelatedErrors errors(receiver.filter.model());
    errors.reset(receiver.sensors);
    EXPECT_FALSE(errors.are_any());
    receiver.give(errors, 0.0, 0.0, 1000);
    sum += errors.mean(receiver.size());
  }
  EXPECT_LT(sum / sequences, 1.1);
}

TEST(CorrelatedErrors, ACovarianceStaysOneAndItsVolumeGrowsByWhatIsSaid) {
  Receiver receiver(3);
  CorrelatedErrors errors(receiver.filter.model());
  errors.reset(receiver.sensors);
  receiver.give(errors, 0.3, 0.9, 1000);
  ASSERT_TRUE(errors.are_any());
  const Eigen::Index n = receiver.size();
  Eigen::MatrixXd root(n, n), factor(n, n);
  for (double& each : root.reshaped()) each = receiver.normal(receiver.random);
  const Eigen::MatrixXd before = root * root.transpose();
  Eigen::MatrixXd P = before;
  errors.scale(receiver.state(), P);
  EXPECT_EQ(P, P.transpose());
  EXPECT_EQ(P.llt().info(), Eigen::Success);
  EXPECT_NEAR(log_volume(P, factor) - log_volume(before, factor), errors.in_volume(n), 1e-9);
  EXPECT_NEAR(std::log(errors.mean(n)), 2.0 * errors.in_volume(n) / static_cast<double>(n), 1e-12);
  for (Eigen::Index j = 2; j < n; ++j) EXPECT_LE(P(j, j), errors.largest() * before(j, j) * (1.0 + 1e-12));
}

/// What an estimate does not know anyway does not count twice.
TEST(CorrelatedErrors, CountLessWhereLittleIsKnown) {
  Receiver receiver(4);
  CorrelatedErrors errors(receiver.filter.model());
  errors.reset(receiver.sensors);
  receiver.give(errors, 0.8, 0.8, 1000);
  const double usual = errors.largest();
  ASSERT_GT(usual, 2.0);
  for (int k = 0; k < 100; ++k) errors.note(0.0, receiver.size());  // this is usual
  errors.note(5.0 * static_cast<double>(receiver.size()), receiver.size());
  EXPECT_TRUE(errors.are_any());
  EXPECT_LT(errors.largest(), 1.01);
  errors.note(0.0, receiver.size());
  EXPECT_NEAR(errors.largest(), usual, 0.05 * usual);
}

TEST(CorrelatedErrors, OfAModelThatHeadsNowhereAllIsAsLarge) {
  const auto model = linear_model<Boat>();
  WalkingFilter filter(model, {.noise = {.output_variances = {0.04, 0.01},
                                         .input_variances = {0.09},
                                         .parameter_lower = {-1e3},
                                         .parameter_upper = {1e3}},
                               .walk = {0.05}});
  filter.mean() = initial_mean(*model);
  filter.covariance() = initial_covariance(*model);
  filter.expect();
  const std::vector<Sensor> sensors = {{"both", {0, 1}}};
  CorrelatedErrors errors(*model);
  errors.reset(sensors);
  Innovation innovation;
  innovation.value = Eigen::Vector2d(1.0, -0.5);
  innovation.covariance = Eigen::Matrix2d::Identity();
  for (int k = 0; k < 500; ++k) errors.take(filter, 0, sensors[0], innovation);
  errors.note(0.0, filter.mean().size());
  ASSERT_GT(errors.largest(), 2.0);
  Eigen::MatrixXd P = filter.covariance();
  errors.scale(filter.mean().head(model->state_count()), P);
  EXPECT_LT((P - errors.largest() * filter.covariance()).norm(), 1e-12);
  EXPECT_EQ(errors.by_output()[0], errors.by_output()[1]);
}

TEST(CorrelatedErrors, AreNotWatchedWithoutSensors) {
  Receiver receiver(5);
  CorrelatedErrors errors(receiver.filter.model());
  errors.reset({});
  receiver.give(errors, 0.9, 0.9, 500);
  EXPECT_FALSE(errors.are_any());
  EXPECT_EQ(errors.by_output()[0], nullptr);
}

}  // namespace
}  // namespace rhec::correlated_errors_test
