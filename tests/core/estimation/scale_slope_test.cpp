// What outputs with scale errors tell of these.
#include "core/estimation/scale_slope.hpp"
#include "rhec/core/estimation/kalman_filter.hpp"
#include "rhec/core/estimation/prior_bank.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <memory>
#include <random>
#include <vector>

#include "rhec/core/model/formula_model.hpp"
#include "rhec/core/model/sensor_model.hpp"

namespace rhec {
namespace scale_slope_test {

/// A joint that a measured rate moves. An encoder of its angle has a scale error.
template <class Scalar>
struct Joint {
  static constexpr int state_count = 1, input_count = 1, parameter_count = 0, output_count = 2;
  void dynamics(const Scalar*, const Scalar* u, const Scalar*, Scalar* dxdt) const { dxdt[0] = u[0]; }
  void outputs(const Scalar* x, Scalar* y) const { y[0] = y[1] = x[0]; }
};

constexpr double rough = 0.3, fine = 0.017, of_rate = 0.1, step = 0.2, of_scale = 0.05;
constexpr int samples = 300, drives = 60;
const double unmeasured = std::numeric_limits<double>::quiet_NaN();

std::shared_ptr<const Model> joint() {
  ModelDescription about;
  about.states.resize(1);
  about.inputs.resize(1);
  about.outputs.resize(2);
  about.states[0].name = "angle";
  about.inputs[0].name = "rate";
  about.outputs[0].name = "rough";
  about.outputs[1].name = "encoder";
  return std::make_shared<SensorModel>(std::make_shared<FormulaModel<Joint>>(Joint<double>{}, about),
                                       SensorModel::Errors{.biased = {}, .scaled = {1}});
}

Eigen::MatrixXd start() { return Eigen::Vector2d(1e-4, of_scale * of_scale).asDiagonal(); }

/// Drives of a joint that is at 0 except for every `period`-th sample, when it is at `angle` (0: never).
struct Drive {
  double angle = 0.0;
  int period = 20;
  double true_angle(int k) const { return k % period == period - 1 ? angle : 0.0; }
};

struct Found {
  double mean = 0.0, squares = 0.0;  ///< of errors of the scale at the end; these relative to their variances
};

/// `encoder_at`: when on the interval the encoder is read, as a share; 1: at the node.
template <class Filter, class Moments>
Found find(const Drive& drive, double encoder_at, Filter make, Moments moments) {
  Found found;
  for (unsigned seed = 1; seed <= drives; ++seed) {
    std::mt19937_64 random(seed);
    std::normal_distribution<double> normal;
    const double scale = of_scale * normal(random);
    auto filter = make();
    for (int k = 1; k <= samples; ++k) {
      const double before = drive.true_angle(k - 1), now = drive.true_angle(k);
      const double rate = (now - before) / step + of_rate * normal(random);
      const double at = before + encoder_at * (now - before);
      const double read = (1.0 + scale) * at + fine * normal(random), seconds = encoder_at * step;
      const double node[] = {now + rough * normal(random), encoder_at == 1.0 ? read : unmeasured},
                   between[] = {unmeasured, read};
      MeasuredInterval interval{step, &rate};
      if (encoder_at < 1.0) {
        interval.between = 1;
        interval.times = &seconds;
        interval.outputs = between;
      }
      filter.predict(interval);
      filter.update(node);
    }
    const auto [mean, variance] = moments(filter);
    found.mean += (mean - scale) / drives;
    found.squares += (mean - scale) * (mean - scale) / variance / drives;
  }
  return found;
}

struct Predicting {
  KalmanFilter filter;
  void predict(const MeasuredInterval& interval) noexcept { filter.predict(interval, interval.inputs, nullptr); }
  void update(const double* y) noexcept { filter.update(y); }
};

Found find_by_filter(const Drive& drive, double encoder_at) {
  return find(
      drive, encoder_at,
      [] {
        Predicting made{KalmanFilter(joint(),
                                     {.output_variances = {rough * rough, fine * fine},
                                      .input_variances = {of_rate * of_rate},
                                      .parameter_lower = {},
                                      .parameter_upper = {},
                                      .scaled_outputs = {{1, 1}}},
                                     1, 1)};
        made.filter.mean.setZero();
        made.filter.covariance = start();
        return made;
      },
      [](const Predicting& made) {
        return std::pair{made.filter.mean[1], made.filter.covariance(1, 1)};
      });
}

Found find_by_bank(const Drive& drive, double encoder_at) {
  return find(
      drive, encoder_at,
      [] {
        PriorBank::Setup setup;
        setup.members = {PriorCombination{}};
        setup.output_variances = {rough * rough, fine * fine};
        setup.input_variances = {of_rate * of_rate};
        setup.most_between = 1;
        setup.scaled_outputs = {{1, 1}};
        PriorBank bank(joint(), setup);
        bank.reset(Eigen::VectorXd::Zero(2), start());
        return bank;
      },
      [](PriorBank& bank) {
        Eigen::VectorXd mean;
        Eigen::MatrixXd covariance;
        bank.moments(mean, covariance);
        return std::pair{mean[1], covariance(1, 1)};
      });
}

/// At 0 the encoder reads 0 whatever its scale is; what the measured rate says of the angle is noise. The scale stays
/// as it was, and what is stated of it.
TEST(ScaleSlope, NoiseTellsNothingOfAScale) {
  for (const double encoder_at : {1.0, 0.5}) {
    for (const auto& found : {find_by_filter({}, encoder_at), find_by_bank({}, encoder_at)}) {
      EXPECT_NEAR(found.mean, 0.0, 0.4 * of_scale) << encoder_at;
      EXPECT_LT(found.squares, 1.7) << encoder_at;
    }
  }
}

/// Where the angle is far from 0, it is learnt.
TEST(ScaleSlope, MotionTellsOfAScale) {
  for (const double encoder_at : {1.0, 0.5}) {
    for (const auto& found : {find_by_filter({.angle = 1.0}, encoder_at), find_by_bank({.angle = 1.0}, encoder_at)}) {
      EXPECT_NEAR(found.mean, 0.0, 0.2 * of_scale) << encoder_at;
      EXPECT_LT(found.squares, 1.7) << encoder_at;
    }
  }
}

TEST(ScaleSlope, IsTheAngleAfterTheMeasurementBeyondItsNoise) {
  const double scale = 1.25, h = 0.6, variance = 0.04, noise = 0.01;
  const auto gradient = [&](int c) { return c == 0 ? scale : h; };
  const auto covariance = [&](int r, int c) { return r == 0 && c == 0 ? variance : r == c ? 0.0025 : 0.001; };
  const double after = variance * noise / (scale * scale * variance + noise);
  const double gain = scale * variance / (scale * scale * variance + noise);
  EXPECT_NEAR(scale_slope(2, 1, scale, 0.1, noise, gradient, covariance), h + gain * 0.1 - 3.0 * std::sqrt(after),
              1e-12);
  EXPECT_NEAR(scale_slope(2, 1, scale, -0.1, noise, gradient, covariance), h - gain * 0.1 - 3.0 * std::sqrt(after),
              1e-12);
  EXPECT_EQ(scale_slope(2, 1, scale, -0.8, noise, gradient, covariance), 0.0) << "the angle is 0 within its noise";
  EXPECT_LT(scale_slope(2, 1, scale, 1e9, noise, gradient, covariance), 2.0 * h) << "an outlier";
  EXPECT_EQ(scale_slope(2, 1, scale, unmeasured, noise, gradient, covariance), 0.0);
}

}  // namespace scale_slope_test
}  // namespace rhec
