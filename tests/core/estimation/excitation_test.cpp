#include "core/estimation/excitation.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "support/linear_case.hpp"
#include "support/turntable.hpp"

namespace rhec {
namespace excitation_test {

using namespace testing;

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

/// A turntable whose traction is about 0.8, with a gyro that is read once or often on an interval.
struct Case {
  TurntableNoise noise{.angle = 1.0, .gyro = 0.005, .omega = 0.02};
  std::shared_ptr<const Model> model = turntable();
  Excitation excitation{model, {1}, 1, 8};
  std::vector<double> history = std::vector<double>(excitation.history_size(), 0.0);
  Eigen::VectorXd mean = Eigen::Vector3d(0.0, 0.0, 0.8);
  Eigen::MatrixXd covariance = Eigen::Vector3d(0.01, 1.0, 0.04).asDiagonal();

  bool find(double omega, double gyro, int readings = 0) {
    std::vector<double> times, between;
    for (int i = 0; i < readings; ++i) {
      times.push_back(0.2 * (i + 0.5) / readings);
      between.insert(between.end(), {nan, gyro});
    }
    const std::vector<double> weights(between.size(), 1.0);
    const double end[] = {0.1, readings > 0 ? nan : gyro}, input_variance = noise.omega * noise.omega,
                 output_variances[] = {noise.angle * noise.angle, noise.gyro * noise.gyro};
    return excitation.find({0.2, &omega, readings, times.data(), between.data()}, weights.data(), end,
                           {mean, covariance, &omega, &input_variance, output_variances}, history.data());
  }
  /// Variance of the drive's rate given so many readings, and the rate.
  double variance(int readings) const {
    return 1.0 / (std::pow(noise.omega, -2) + readings * std::pow(mean[2] / noise.gyro, 2));
  }
};

TEST(Excitation, LeavesAnIntervalThatTurns) {
  Case turning;
  for (int k = 0; k < 20; ++k) EXPECT_FALSE(turning.find(0.41, 0.32));
  ASSERT_EQ(turning.history.size(), 1);
  EXPECT_GT(turning.history[0], 8.0);
}

TEST(Excitation, BelievesAShareOfARateThatIsAsSmallAsItsNoise) {
  for (const int readings : {0, 1, 8}) {
    Case resting;
    const double V = resting.variance(std::max(1, readings)), omega = 0.02, gyro = 2.0 * std::sqrt(V) * 0.8;
    const double found = V * (omega / std::pow(resting.noise.omega, 2) +
                              std::max(1, readings) * 0.8 * gyro / std::pow(resting.noise.gyro, 2));
    ASSERT_LT(found * found, 9.0 * V) << "not significant";
    // Nothing is known of the last intervals: nothing is believed.
    EXPECT_TRUE(resting.find(omega, gyro, readings));
    EXPECT_NEAR(resting.excitation.target()[2], 0.0, 1e-12);
    EXPECT_NEAR(resting.history[0], (found * found / V - 1.0) / 8.0, 1e-9);
    resting.history[0] = 3.0;
    EXPECT_TRUE(resting.find(omega, gyro, readings));
    EXPECT_NEAR(resting.excitation.target()[2], 0.75 * found, 1e-9);
  }
}

/// The mean of what is believed is what an honest estimate of kappa has to go on: omega^4 / (omega^2 + V).
TEST(Excitation, TellsOfSlipWhatErrorsInBothVariablesLeave) {
  Case slow;
  const double V = slow.variance(1);
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  for (const double omega : {0.0, std::sqrt(V)}) {
    double told = 0.0;
    constexpr int count = 20000;
    for (int k = 0; k < count; ++k) {
      slow.find(omega + slow.noise.omega * normal(random), 0.8 * omega + slow.noise.gyro * normal(random));
      told += std::pow(slow.excitation.target()[2], 2) / count;
    }
    const double honest = std::pow(omega, 4) / (omega * omega + V);
    EXPECT_NEAR(told, honest, 0.35 * V) << "linearised where it is, it tells " << omega * omega + V;
    EXPECT_LT(told, 0.6 * (omega * omega + V));
  }
}

TEST(Excitation, KeepsWhatItKnowsWhereNothingIsMeasured) {
  Case silent;
  silent.history[0] = 2.0;
  EXPECT_FALSE(silent.find(0.01, nan));
  EXPECT_EQ(silent.history[0], 2.0);
}

/// Of a linear vehicle an output's gradient is known, whatever is measured.
TEST(Excitation, HasNothingToDoOnALinearVehicle) {
  const auto model = linear_model<Trolley>();
  const int nx = model->state_count(), np = model->parameter_count(), ny = model->output_count();
  Excitation excitation(model, {0}, 1, 0);
  std::vector<double> history(excitation.history_size(), 0.0), inputs(model->input_count(), 0.0),
      input_variances(model->input_count(), 0.01), output_variances(ny, 0.01), outputs(ny, 0.001);
  const Eigen::VectorXd mean = Eigen::VectorXd::Zero(nx + np);
  const Eigen::MatrixXd covariance = Eigen::MatrixXd::Identity(nx + np, nx + np);
  EXPECT_FALSE(excitation.find({.duration = 0.2, .inputs = inputs.data()}, nullptr, outputs.data(),
                               {mean, covariance, inputs.data(), input_variances.data(), output_variances.data()},
                               history.data()));
  for (const double each : history) EXPECT_EQ(each, 0.0);
}

}  // namespace excitation_test
}  // namespace rhec
