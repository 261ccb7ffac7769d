// Members of a bank one by one: outputs of motion, bounds, and what weighs them.
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "rhec/core/estimation/kalman_filter.hpp"
#include "rhec/core/estimation/prior_bank.hpp"
#include "support/bank_case.hpp"
#include "support/largest.hpp"
#include "support/turntable.hpp"

namespace rhec {
namespace prior_bank_filters_test {

using namespace testing;

/// With outputs of motion, at nodes and between them, few or many, a member is linearised where the Kalman filter is,
/// and has its second-order terms; with a scale error beside them too, and if some readings are less accurate than
/// others.
TEST(PriorBankFilters, IsTheKalmanFilterWithOutputsOfMotion) {
  constexpr double sigma = 0.05, nan = std::numeric_limits<double>::quiet_NaN();
  constexpr int most = 12;
  const TurntableNoise noise{.gyro = 0.01};
  for (const auto& [has_scale_error, has_loss] : {std::pair{false, false}, {true, false}, {true, true}}) {
    const auto model = turntable(has_scale_error);
    const int nx = model->state_count();
    PriorBank::Setup setup;
    setup.members = {{prior("walk", "{sigma: 0.05, along: time, course: ramp}")}};
    setup.output_variances = {noise.angle * noise.angle, noise.gyro * noise.gyro};
    setup.input_variances = {noise.omega * noise.omega};
    setup.most_between = most;
    setup.motion_outputs = {1};
    // A loss that nothing is large enough for keeps no other output from being summarised.
    if (has_loss) setup.robust = {{.outputs = {0}, .delta = 1e8}};
    PriorBank bank(model, setup);
    const double infinity = std::numeric_limits<double>::infinity();
    KalmanFilter filter(model, {setup.output_variances, setup.input_variances, {-infinity}, {infinity}, {1}}, 1, most);
    Eigen::VectorXd start = Eigen::VectorXd::Zero(nx);
    start[0] = 0.1;
    Eigen::MatrixXd spread = Eigen::MatrixXd::Identity(nx, nx) * 0.01;
    spread(nx - 1, nx - 1) = 1.0;
    bank.reset(start, spread);
    Eigen::VectorXd mean;
    Eigen::MatrixXd covariance;
    bank.moments(mean, covariance);
    filter.mean = mean;
    filter.covariance = covariance;
    EXPECT_TRUE(bank.looks_ahead());
    for (int k = 1; k <= 60; ++k) {
      const double duration = 0.2, omega = 0.3 * std::sin(0.1 * k) + 0.05 * std::cos(5.0 * k), zero = 0.0,
                   ramp = sigma * sigma * duration;
      const double outputs[] = {0.3 * k * duration,
                                k % 5 == 0 ? nan : 0.2 * std::sin(0.1 * k) + 0.01 * std::sin(9.0 * k)};
      const int readings = k % 3 == 0 ? 2 : k % 3 == 1 ? most : 0;
      double times[most], between[2 * most], weights[2 * most];
      for (int i = 0; i < readings; ++i) {
        times[i] = duration * (i + 0.3) / readings;
        between[2 * i] = i == 1 ? 0.3 * k * duration : nan;
        between[2 * i + 1] =
            readings == 2 && i == 1 ? nan : 0.2 * std::sin(0.1 * k - 0.05) + 0.01 * std::sin(7.0 * i + k);
        weights[2 * i] = 1.0 + 0.5 * std::sin(i);
        weights[2 * i + 1] = std::exp(std::sin(3.0 * i));
      }
      const double weights_of_end[] = {0.4, 2.5};
      const Measured end{outputs, k % 2 == 0 ? weights_of_end : nullptr};
      const MeasuredInterval interval{.duration = duration,
                                      .inputs = &omega,
                                      .between = readings,
                                      .times = times,
                                      .outputs = between,
                                      .weights = k % 4 > 1 ? weights : nullptr};
      bank.predict(interval, end);
      filter.predict(interval, &zero, &ramp, nullptr, end);
      if (k % 7 == 0) {  // what was expected of an end goes with it
        const double nothing[] = {nan, nan};
        bank.predict(interval, nothing);
        filter.predict(interval, &zero, &ramp, nullptr, nothing);
      }
      bank.update(end);
      filter.update(end);
      bank.moments(mean, covariance);
      ASSERT_LT(largest(mean - filter.mean), 1e-9) << k;
      ASSERT_LT(largest(covariance - filter.covariance), 1e-9 * (1.0 + largest(covariance))) << k;
    }
  }
}

/// Two laws of a turntable's traction, and a gyro beside an angle that is hardly measured.
PriorBank::Setup of_two_laws(const TurntableNoise& noise, const char* calm, const char* quick) {
  PriorBank::Setup setup;
  setup.members = {{prior("walk", calm)}, {prior("walk", quick)}};
  setup.output_variances = {noise.angle * noise.angle, noise.gyro * noise.gyro};
  setup.input_variances = {noise.omega * noise.omega};
  setup.most_between = 20;
  setup.motion_outputs = {1};
  return setup;
}

/// While nothing turns, a gyro tells nothing of traction, at whatever rate: neither does the mean move, nor is it known
/// better.
TEST(PriorBankFilters, DoesNotLearnTractionFromATurntableThatRests) {
  const TurntableNoise noise{.angle = 0.1, .gyro = 0.005, .omega = 0.02};
  for (const int readings : {0, 19}) {
    const auto model = turntable();
    PriorBank bank(model, of_two_laws(noise, "{sigma: 0.001, along: time, course: ramp, mean: 0.75, mean_sigma: 0.3}",
                                      "{sigma: 0.002, along: time, course: ramp, mean: 0.75, mean_sigma: 0.3}"));
    std::mt19937 random(11);
    std::normal_distribution<double> normal;
    int inside = 0, count = 0;
    double shift = 0.0, least = 1.0;
    for (int run = 0; run < 20; ++run) {
      bank.reset(Eigen::VectorXd::Zero(model->state_count()),
                 Eigen::MatrixXd::Identity(model->state_count(), model->state_count()) * 1e-4);
      Eigen::VectorXd mean;
      Eigen::MatrixXd covariance;
      for (int k = 0; k < 200; ++k) {
        const double omega = noise.omega * normal(random), nan = std::numeric_limits<double>::quiet_NaN();
        std::vector<double> times, between;
        for (int i = 1; i <= readings; ++i) {
          times.push_back(0.2 * i / (readings + 1));
          between.insert(between.end(), {nan, noise.gyro * normal(random)});
        }
        const double outputs[] = {noise.angle * normal(random), noise.gyro * normal(random)};
        bank.predict({0.2, &omega, readings, times.data(), between.data()}, outputs);
        bank.update(outputs);
      }
      bank.moments(mean, covariance);
      // Of what it was drawn from, the truth is anywhere: 0.75 is the mean of that.
      const double error = mean[mean.size() - 1] - 0.75, sigma = std::sqrt(covariance.bottomRightCorner<1, 1>()(0));
      inside += std::abs(error) < 0.5 * sigma;
      shift += error / 20.0;
      least = std::min(least, sigma);
      ++count;
    }
    EXPECT_GE(inside, 18) << "of " << count << " with " << readings << " readings between the nodes";
    EXPECT_LT(std::abs(shift), 0.06) << readings;
    EXPECT_GT(least, 0.2) << readings << " readings: a standard deviation of 0.3 stays as large as it was, nearly";
  }
}

/// What no vehicle can do, measured again and again, leads no member to where nothing is finite.
TEST(PriorBankFilters, StaysNearTheBoundsOfItsParameters) {
  const TurntableNoise noise{.angle = 0.01, .gyro = 0.01};
  Variable traction;
  traction.lower = 0.0;
  traction.upper = 1.0;
  const auto model = turntable(false, traction);
  PriorBank bank(model, of_two_laws(noise, "{sigma: 0.01, along: time, course: ramp, mean: 0.8, mean_sigma: 0.3}",
                                    "{sigma: 0.5, along: time, course: ramp, mean: 0.8, mean_sigma: 0.3}"));
  const Eigen::Index nx = model->state_count();
  bank.reset(Eigen::VectorXd::Zero(nx), Eigen::MatrixXd::Identity(nx, nx) * 1e-4);
  Eigen::VectorXd mean;
  Eigen::MatrixXd covariance;
  for (int k = 0; k < 30; ++k) {
    const double omega = 0.5, outputs[] = {k % 2 ? 1e5 : -1e5, k % 3 ? 400.0 : -300.0};
    bank.predict({0.2, &omega}, outputs);
    bank.update(outputs);
    bank.moments(mean, covariance);
    ASSERT_TRUE(mean.allFinite() && covariance.allFinite()) << k;
    ASSERT_GE(mean[nx], -0.5 - 1e-9) << k;
    ASSERT_LE(mean[nx], 1.5 + 1e-9) << k;
  }
}

/// Readings within one interval say the same of a law: with twenty, a law is no more probable than with one.
TEST(PriorBankFilters, WeighsLawsByOneReadingOfAnInterval) {
  const TurntableNoise noise{.angle = 1.0, .gyro = 0.01, .omega = 1e-4};
  const auto model = turntable();
  double weight[2] = {};
  for (const bool often : {false, true}) {
    PriorBank bank(model, of_two_laws(noise, "{sigma: 0.01, along: time, course: ramp, mean: 0.8, mean_sigma: 0.01}",
                                      "{sigma: 0.5, along: time, course: ramp, mean: 0.8, mean_sigma: 0.01}"));
    bank.reset(Eigen::VectorXd::Zero(model->state_count()),
               Eigen::MatrixXd::Identity(model->state_count(), model->state_count()) * 1e-4);
    const double omega = 0.5, outputs[] = {0.08, 0.4};
    std::vector<double> times, between;
    for (int i = 1; i < 20; ++i) {
      times.push_back(0.01 * i);
      between.insert(between.end(), {std::numeric_limits<double>::quiet_NaN(), 0.4});
    }
    const std::vector<double> before(bank.weights().begin(), bank.weights().end());
    bank.predict({0.2, &omega, often ? 19 : 0, times.data(), between.data()}, outputs);
    bank.update(outputs);
    weight[often] = bank.weights()[0];
    EXPECT_GT(weight[often], 0.5) << "the calm law is right";
  }
  EXPECT_LT(weight[1], weight[0]);
}

/// An edge of the ground within an interval is an innovation of tens of standard deviations: laws that know nothing of
/// edges lay it on traction and drive, and no more of it than three standard deviations.
TEST(PriorBankFilters, TakesNoMoreOfAnEdgeThanThreeStandardDeviations) {
  const TurntableNoise noise{.angle = 1.0, .gyro = 0.002, .omega = 0.02};
  const auto model = turntable();
  PriorBank bank(model, of_two_laws(noise, "{sigma: 0.01, along: time, course: ramp, mean: 0.9, mean_sigma: 0.01}",
                                    "{sigma: 0.02, along: time, course: ramp, mean: 0.9, mean_sigma: 0.01}"));
  bank.reset(Eigen::VectorXd::Zero(model->state_count()),
             Eigen::MatrixXd::Identity(model->state_count(), model->state_count()) * 1e-6);
  Eigen::VectorXd before, mean;
  Eigen::MatrixXd spread, covariance;
  const double omega = 0.5, nan = std::numeric_limits<double>::quiet_NaN();
  for (int k = 0; k < 20; ++k) {
    const double outputs[] = {nan, (k < 19 ? 0.9 : 0.3) * omega};
    if (k == 19) bank.moments(before, spread);
    bank.predict({.duration = 0.2, .inputs = &omega}, outputs);
    bank.update(outputs);
  }
  bank.moments(mean, covariance);
  const Eigen::Index kappa = mean.size() - 1;
  EXPECT_LT(mean[kappa], before[kappa]);
  EXPECT_GT(mean[kappa], before[kappa] - 3.5 * std::sqrt(spread(kappa, kappa) + 4e-4 * 0.2));
}

}  // namespace prior_bank_filters_test
}  // namespace rhec
