#include "rhec/core/estimation/kalman_filter.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "support/cart.hpp"
#include "support/linear_case.hpp"
#include "support/turntable.hpp"

namespace rhec {
namespace kalman_filter_test {

using namespace testing;

/// The noise variances of a linear case.
KalmanFilter::Noise variances_of(const Model& model) {
  const testing::Noise noise = noise_of(model);
  const double infinity = std::numeric_limits<double>::infinity();
  KalmanFilter::Noise variances;
  for (const double sigma : noise.outputs) variances.output_variances.push_back(sigma * sigma);
  for (const double sigma : noise.inputs) variances.input_variances.push_back(sigma * sigma);
  variances.parameter_lower.assign(model.parameter_count(), -infinity);
  variances.parameter_upper.assign(model.parameter_count(), infinity);
  return variances;
}

KalmanFilter filter_for(const std::shared_ptr<const Model>& model) {
  KalmanFilter filter(model, variances_of(*model), 1);
  filter.mean = initial_mean(*model);
  filter.covariance = initial_covariance(*model);
  return filter;
}

double largest(const Eigen::MatrixXd& matrix) { return matrix.cwiseAbs().maxCoeff(); }

TEST(KalmanFilter, IsTheTextbooksOnALinearModel) {
  for (const bool ramps : {false, true}) {
    const auto model = linear_model<Hovercraft>();
    const auto samples = simulate(*model, 40, false, 3);
    ReferenceFilter reference(*model, noise_of(*model), {{.variance = 0.02, .ramp = ramps}, {.variance = 0.01}});
    KalmanFilter filter = filter_for(model);
    const double zeros[2] = {0.0, 0.0};
    for (int k = 0; k <= 40; ++k) {
      if (k > 0) {
        reference.predict(k - 1, samples[k]);
        const bool jumps = k > 1;
        const double ramp[2] = {ramps && jumps ? 0.02 : 0.0, 0.0};
        if (jumps && !ramps) filter.add_parameter_variance(0, 0.02);
        if (jumps) filter.add_parameter_variance(1, 0.01);
        filter.predict(samples[k].inputs.data(), zeros, samples[k].duration, ramp);
      }
      reference.update(samples[k]);
      filter.update(samples[k].outputs.data(), nullptr);
      EXPECT_LT(largest(filter.mean - reference.mean.cast<double>()), 1e-9) << k;
      EXPECT_LT(largest(filter.covariance - reference.covariance.cast<double>()), 1e-9) << k;
      EXPECT_EQ(largest(filter.covariance - filter.covariance.transpose()), 0.0) << k;
    }
  }
}

TEST(KalmanFilter, TakesRobustWeightsAsPartsOfTheInformation) {
  const auto model = linear_model<Trolley>();
  const double y[] = {0.7, -0.2}, weights[] = {0.25, 1.0};
  KalmanFilter weighted = filter_for(model);
  weighted.update(y, weights);
  KalmanFilter::Noise noise = variances_of(*model);
  noise.output_variances[0] *= 4.0;
  KalmanFilter wide(model, noise, 1);
  wide.mean = initial_mean(*model);
  wide.covariance = initial_covariance(*model);
  wide.update(y, nullptr);
  EXPECT_LT(largest(weighted.mean - wide.mean), 1e-12);
  EXPECT_LT(largest(weighted.covariance - wide.covariance), 1e-12);
}

TEST(KalmanFilter, PassesOverWhatIsNoNumber) {
  const auto model = linear_model<Trolley>();
  KalmanFilter filter = filter_for(model);
  const Eigen::VectorXd mean = filter.mean;
  const Eigen::MatrixXd covariance = filter.covariance;
  const double nothing[] = {nan, nan};
  filter.update(nothing, nullptr);
  EXPECT_EQ(filter.mean, mean);
  EXPECT_EQ(filter.covariance, covariance);
  const double infinite[] = {HUGE_VAL, 1.0};
  filter.update(infinite, nullptr);
  EXPECT_TRUE(filter.mean.allFinite() && filter.covariance.allFinite());
}

TEST(KalmanFilter, GuessesAnInputThatIsMissingAndTrustsItLittle) {
  const auto model = linear_model<Trolley>();
  const double missing = nan, measured = 0.5, guess = 0.5;
  KalmanFilter without = filter_for(model), with = without;
  without.predict(&missing, &guess, 0.2);
  with.predict(&measured, &guess, 0.2);
  EXPECT_LT(largest(without.mean - with.mean), 1e-12);
  EXPECT_GT(without.covariance(1, 1), with.covariance(1, 1) + 100.0);
}

TEST(KalmanFilter, RestartsAParameterAsIfNothingWereKnownOfIt) {
  const auto model = linear_model<Boat>();
  KalmanFilter filter = filter_for(model);
  const Eigen::VectorXd mean = filter.mean;
  const Eigen::MatrixXd covariance = filter.covariance;
  filter.restart_parameter(0, 9.0);
  EXPECT_EQ(filter.mean, mean);
  EXPECT_EQ(filter.covariance(3, 3), 9.0);
  for (int j = 0; j < 3; ++j) EXPECT_EQ(filter.covariance(3, j), 0.0);
  EXPECT_EQ(largest(filter.covariance.topLeftCorner(3, 3) - covariance.topLeftCorner(3, 3)), 0.0);
}

TEST(KalmanFilter, KeepsItsParametersWithinTheirBounds) {
  KalmanFilter filter(cart(), {{0.01, 0.01}, {0.01}, {0.0, 0.2}, {0.5, 2.0}}, 2);
  filter.mean = Eigen::Vector4d(0.0, 3.0, 0.3, 1.0);
  filter.covariance = Eigen::Vector4d(0.1, 0.1, 1.0, 1.0).asDiagonal();
  // It gains speed whatever the drag.
  for (int k = 1; k <= 10; ++k) {
    const double u = 0.0, y[] = {0.65 * k, std::pow(3.0 + 0.1 * k, 2)};
    filter.predict(&u, &u, 0.2);
    filter.update(y, nullptr);
    EXPECT_GE(filter.mean[2], 0.0) << k;
    EXPECT_LE(filter.mean[2], 0.5) << k;
  }
  EXPECT_EQ(filter.mean[2], 0.0);
}

KalmanFilter turntable_filter(const TurntableNoise& noise, bool looks_ahead) {
  const double infinity = std::numeric_limits<double>::infinity();
  KalmanFilter filter(turntable(),
                      {.output_variances = {noise.angle * noise.angle, noise.gyro * noise.gyro},
                       .input_variances = {noise.omega * noise.omega},
                       .parameter_lower = {-infinity},
                       .parameter_upper = {infinity},
                       .motion_outputs = looks_ahead ? std::vector{1} : std::vector<int>{}},
                      1);
  filter.mean << 0.0, 0.0, 0.75;
  filter.covariance = Eigen::Vector3d(1e-4, 1.0, noise.kappa * noise.kappa).asDiagonal();
  return filter;
}

/// One interval at whose end the gyro is read: what is left is a sum of three squares in kappa and omega.
TEST(KalmanFilter, IsTheMinimiserOfAnIntervalWithAnOutputOfMotion) {
  const TurntableNoise noise{.gyro = 0.02, .omega = 0.2};
  const double zero = 0.0, nan = std::numeric_limits<double>::quiet_NaN();
  for (const double omega : {-0.3, -0.02, 0.1, 0.5}) {
    for (const double gyro : {-0.1, 0.01, 0.3}) {
      KalmanFilter filter = turntable_filter(noise, true);
      const double outputs[] = {nan, gyro};
      filter.predict({.duration = 0.2, .inputs = &omega}, &zero, nullptr, nullptr, outputs);
      filter.update(outputs, nullptr);
      Eigen::Vector2d at(0.75, omega);
      Eigen::Matrix2d information;
      for (int step = 0; step < 100; ++step) {
        const Eigen::Vector3d residuals((at[0] - 0.75) / noise.kappa, (at[1] - omega) / noise.omega,
                                        (at[0] * at[1] - gyro) / noise.gyro);
        Eigen::Matrix<double, 3, 2> J;
        J << 1.0 / noise.kappa, 0.0, 0.0, 1.0 / noise.omega, at[1] / noise.gyro, at[0] / noise.gyro;
        information = J.transpose() * J;
        at -= information.inverse() * J.transpose() * residuals;
      }
      const double sigma = std::sqrt(information.inverse()(0, 0));
      EXPECT_NEAR(filter.mean[2], at[0], 0.05 * sigma) << omega << ", " << gyro;
      EXPECT_NEAR(std::sqrt(filter.covariance(2, 2)) / sigma, 1.0, 0.05) << omega << ", " << gyro;
    }
  }
}

/// The drive stands, so that the gyro tells nothing of traction. Linearised about what the drive's encoder reads, its
/// noise passes for motion.
TEST(KalmanFilter, DoesNotTakeTheNoiseOfAnInputForKnowledge) {
  const TurntableNoise noise;
  const double zero = 0.0;
  const auto share_within_two_sigmas = [&](bool looks_ahead) {
    std::mt19937_64 random(7);
    std::normal_distribution<double> normal;
    int within = 0, count = 0;
    for (int drive = 0; drive < 40; ++drive) {
      const double kappa = 0.75 + noise.kappa * normal(random);
      KalmanFilter filter = turntable_filter(noise, looks_ahead);
      for (int k = 0; k < 100; ++k) {
        const double omega = noise.omega * normal(random);
        const double outputs[] = {noise.angle * normal(random), noise.gyro * normal(random)};
        filter.predict({.duration = 0.2, .inputs = &omega}, &zero, nullptr, nullptr, outputs);
        filter.update(outputs, nullptr);
        within += std::abs(filter.mean[2] - kappa) < 2.0 * std::sqrt(filter.covariance(2, 2));
        ++count;
      }
    }
    return static_cast<double>(within) / count;
  };
  EXPECT_GT(share_within_two_sigmas(true), 0.85);
  EXPECT_LT(share_within_two_sigmas(false), 0.3) << "otherwise the case shows nothing";
}

/// Readings between the nodes are taken in one after the other, about the mean as it is by then; so is the one at the
/// end.
TEST(KalmanFilter, LinearisesAboutTheMeanWhereAGyroIsReadBetweenNodes) {
  const TurntableNoise noise;
  const double zero = 0.0, omega = 0.04, time = 0.1;
  const double read[] = {std::numeric_limits<double>::quiet_NaN(), 0.001};
  KalmanFilter ahead = turntable_filter(noise, true),
               plain(turntable(), turntable_filter(noise, false).noise(), 1, true);
  plain.mean = ahead.mean;
  plain.covariance = ahead.covariance;
  const MeasuredInterval interval{.duration = 0.2, .inputs = &omega, .between = 1, .times = &time, .outputs = read};
  for (KalmanFilter* each : {&ahead, &plain}) {
    each->predict(interval, &zero, nullptr, nullptr, read);
    each->update(read, nullptr);
  }
  EXPECT_EQ(ahead.mean, plain.mean);
  EXPECT_EQ(ahead.covariance, plain.covariance);
}

TEST(KalmanFilter, IsNotMovedFarByAGyroThatLies) {
  const TurntableNoise noise;
  const double zero = 0.0, omega = 0.1;
  const double lie[] = {0.0, 1e6}, infinite[] = {0.0, std::numeric_limits<double>::infinity()};
  for (const double* outputs : {lie, infinite}) {
    KalmanFilter filter = turntable_filter(noise, true);
    filter.predict({.duration = 0.2, .inputs = &omega}, &zero, nullptr, nullptr, outputs);
    EXPECT_NEAR(filter.mean[0], 0.2 * 0.75 * omega, 0.1);
    EXPECT_TRUE(filter.covariance.allFinite());
  }
}

}  // namespace kalman_filter_test
}  // namespace rhec
