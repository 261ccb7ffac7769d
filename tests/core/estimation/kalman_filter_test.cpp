#include "rhec/core/estimation/kalman_filter.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "rhec/core/estimation/measurement.hpp"
#include "support/cart.hpp"
#include "support/largest.hpp"
#include "support/linear_case.hpp"
#include "support/turntable.hpp"

namespace rhec {
namespace kalman_filter_test {

using namespace testing;

KalmanFilter filter_for(const std::shared_ptr<const Model>& model) {
  KalmanFilter filter(model, variances_of(*model), 1);
  filter.mean = initial_mean(*model);
  filter.covariance = initial_covariance(*model);
  return filter;
}

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

/// Half of its range, where it is bounded closely.
TEST(KalmanFilter, KnowsOfAnInputThatIsMissingThatItIsWithinItsBounds) {
  Variable speed;
  speed.scale = 2.0;
  EXPECT_EQ(unknown_sigma(speed), 200.0);
  speed.lower = -1.0;
  EXPECT_EQ(unknown_sigma(speed), 200.0);
  speed.upper = 5.0;
  EXPECT_EQ(unknown_sigma(speed), 3.0);
}

TEST(KalmanFilter, CarriesDeviationsAsItMovesTheMean) {
  const auto model = linear_model<Hovercraft>();
  const double inputs[] = {0.3, -0.2}, zeros[] = {0.0, 0.0};
  KalmanFilter filter = filter_for(model);
  const Eigen::Index n = filter.mean.size();
  KalmanFilter::Deviations moved{
      .columns = 0.1 * Eigen::MatrixXd::Random(n, 7), .by_input = 0.1 * Eigen::MatrixXd::Random(2, 7), .used = 6};
  const Eigen::MatrixXd before = moved.columns;
  std::vector<Eigen::VectorXd> ends;
  for (Eigen::Index m = 0; m < moved.used; ++m) {
    KalmanFilter other = filter_for(model);
    other.mean += before.col(m);
    const Eigen::Vector2d off = Eigen::Vector2d(inputs[0], inputs[1]) + moved.by_input.col(m);
    other.predict(off.data(), zeros, 0.2);
    ends.push_back(other.mean);
  }
  filter.predict(inputs, zeros, 0.2);
  filter.carry(moved);
  EXPECT_EQ(moved.columns.col(moved.used), before.col(moved.used));
  for (Eigen::Index m = 0; m < moved.used; ++m)
    EXPECT_LT((filter.mean + moved.columns.col(m) - ends[static_cast<std::size_t>(m)]).norm(), 1e-12) << m;
}

TEST(KalmanFilter, AnInputThatIsMissingIsNotOff) {
  const auto model = linear_model<Hovercraft>();
  const double nan = std::numeric_limits<double>::quiet_NaN(), inputs[] = {0.3, nan};
  KalmanFilter filter = filter_for(model), other = filter_for(model);
  const Eigen::Index n = filter.mean.size();
  KalmanFilter::Deviations moved{
      .columns = Eigen::MatrixXd::Zero(n, 1), .by_input = Eigen::MatrixXd::Constant(2, 1, 0.1), .used = 1};
  filter.predict(inputs, nullptr, 0.2);
  filter.carry(moved);
  const double off[] = {inputs[0] + 0.1, nan};
  other.predict(off, nullptr, 0.2);
  EXPECT_GT(moved.columns.norm(), 1e-3);
  EXPECT_LT((filter.mean + moved.columns.col(0) - other.mean).norm(), 1e-12);
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

/// With a scale error of the gyro its state stands before the gyro's value.
KalmanFilter turntable_filter(const TurntableNoise& noise, bool looks_ahead, double scale_sigma = 0.0) {
  const double infinity = std::numeric_limits<double>::infinity();
  const bool has_scale_error = scale_sigma > 0.0;
  KalmanFilter filter(turntable(has_scale_error),
                      {.output_variances = {noise.angle * noise.angle, noise.gyro * noise.gyro},
                       .input_variances = {noise.omega * noise.omega},
                       .parameter_lower = {-infinity},
                       .parameter_upper = {infinity},
                       .motion_outputs = looks_ahead ? std::vector{1} : std::vector<int>{}},
                      1, 20);
  const Eigen::Index last = filter.mean.size() - 1;
  filter.mean.setZero();
  filter.mean[last] = 0.75;
  filter.covariance.setIdentity();
  filter.covariance(0, 0) = 1e-4;
  if (has_scale_error) filter.covariance(1, 1) = scale_sigma * scale_sigma;
  filter.covariance(last, last) = noise.kappa * noise.kappa;
  return filter;
}

/// One interval at whose end the gyro is read, over many draws: what the filter says of the traction holds, and so does
/// that about the product, on the average. The exact mean given the measurements, by quadrature, is not far.
TEST(KalmanFilter, KnowsOfAProductWhatItsFactorsAllow) {
  const TurntableNoise noise{.gyro = 0.005, .omega = 0.1};
  const double zero = 0.0, nan = std::numeric_limits<double>::quiet_NaN();
  std::mt19937_64 random(11);
  std::normal_distribution<double> normal;
  constexpr int draws = 3000, steps = 400;
  double squares = 0.0, errors = 0.0, best = 0.0;
  for (int draw = 0; draw < draws; ++draw) {
    const double kappa = 0.75 + noise.kappa * normal(random), omega = 0.3 * normal(random),
                 measured = omega + noise.omega * normal(random), gyro = kappa * omega + noise.gyro * normal(random);
    KalmanFilter filter = turntable_filter(noise, true);
    const double outputs[] = {nan, gyro};
    filter.predict({.duration = 0.2, .inputs = &measured}, &zero, nullptr, nullptr, outputs);
    filter.update(outputs, nullptr);
    const double error = filter.mean[2] - kappa;
    squares += error * error / filter.covariance(2, 2) / draws;
    errors += error * error / draws;
    // Given kappa, the gyro less kappa times the drive has the variance of both.
    double total = 0.0, mean = 0.0;
    for (int i = 0; i <= steps; ++i) {
      const double k = 0.75 + noise.kappa * (12.0 * i / steps - 6.0), prior = (k - 0.75) / noise.kappa,
                   variance = noise.gyro * noise.gyro + k * k * noise.omega * noise.omega, rest = gyro - k * measured,
                   density = std::exp(-0.5 * (prior * prior + rest * rest / variance)) / std::sqrt(variance);
      total += density;
      mean += density * k;
    }
    best += std::pow(mean / total - kappa, 2) / draws;
  }
  EXPECT_GT(squares, 0.85);
  EXPECT_LT(squares, 1.15);
  EXPECT_LT(errors, 1.05 * best) << "of the least mean square there is";
}

/// A gyro that is read often knows the product well, and neither of its factors by itself. About each reading's own
/// mean the directions differ by noise, and seem to tell them apart.
TEST(KalmanFilter, DoesNotTellFactorsApartByManyReadingsOfTheirProduct) {
  const TurntableNoise noise;
  constexpr int readings = 20, intervals = 60;
  const double zero = 0.0, nan = std::numeric_limits<double>::quiet_NaN();
  const auto look = [&](bool looks_ahead) {
    std::mt19937_64 random(5);
    std::normal_distribution<double> normal;
    double within = 0.0, error = 0.0;
    for (int drive = 0; drive < 30; ++drive) {
      const double kappa = 0.75 + noise.kappa * normal(random);
      KalmanFilter filter = turntable_filter(noise, looks_ahead);
      for (int k = 0; k < intervals; ++k) {
        const double omega = 0.2 * std::sin(0.15 * k), measured = omega + noise.omega * normal(random);
        double times[readings], between[2 * readings];
        for (int i = 0; i < readings; ++i) {
          times[i] = 0.2 * (i + 0.5) / readings;
          between[2 * i] = nan;
          between[2 * i + 1] = kappa * omega + noise.gyro * normal(random);
        }
        filter.predict({.duration = 0.2, .inputs = &measured, .between = readings, .times = times, .outputs = between},
                       &zero, nullptr);
        within += std::abs(filter.mean[2] - kappa) < 2.0 * std::sqrt(filter.covariance(2, 2));
        error += std::abs(filter.mean[2] - kappa);
      }
    }
    return std::pair(within / (30.0 * intervals), error / (30.0 * intervals));
  };
  const auto [share, error] = look(true);
  const auto [share_before, error_before] = look(false);
  EXPECT_GT(share, 0.85);
  EXPECT_LT(share_before, 0.7) << "otherwise the case shows nothing";
  EXPECT_LT(error, 0.8 * error_before);
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

/// A gyro with a scale error sees a product of three. With the slip unknown while the drive stands, neither it nor the
/// scale is learnt from noise.
TEST(KalmanFilter, DoesNotTakeNoiseForKnowledgeOfAScaleError) {
  const TurntableNoise noise;
  const double zero = 0.0;
  std::mt19937_64 random(13);
  std::normal_distribution<double> normal;
  int within = 0, count = 0;
  for (int drive = 0; drive < 40; ++drive) {
    const double kappa = 0.75 + noise.kappa * normal(random), scale = 0.1 * normal(random);
    KalmanFilter filter = turntable_filter(noise, true, 0.1);
    for (int k = 0; k < 100; ++k) {
      const double truth = k % 10 == 0 ? 0.3 : 0.0, omega = truth + noise.omega * normal(random);
      const double outputs[] = {noise.angle * normal(random),
                                (1.0 + scale) * kappa * truth + noise.gyro * normal(random)};
      filter.predict({.duration = 0.2, .inputs = &omega}, &zero, nullptr, nullptr, outputs);
      filter.update(outputs, nullptr);
      within += std::abs(filter.mean[3] - kappa) < 2.0 * std::sqrt(filter.covariance(3, 3));
      within += std::abs(filter.mean[1] - scale) < 2.0 * std::sqrt(filter.covariance(1, 1));
      count += 2;
    }
  }
  EXPECT_GT(static_cast<double>(within) / count, 0.85);
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
