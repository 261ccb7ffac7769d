// Sensors with a state for their bias, which is what they are off by for good.
#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "rhec/core/estimation/sensor_watch.hpp"
#include "support/sensor_faults.hpp"

namespace rhec {
namespace sensor_gate_biases_test {

using namespace rhec::testing;

constexpr double bias = 0.02;  // [rad/s]

struct Seen {
  double bias = 0.0, sigma = 0.0;  ///< at the end [rad/s]
  double error = 0.0;              ///< of the position at the end [m]
  double ok = 0.0;                 ///< share of the samples of the last twenty seconds
  bool has_moved = false;          ///< was said of the gyro
};

/// A gyro at 50 Hz and positions at 5 Hz, for 80 s. From 30 s on the gyro is off by `jump` [rad/s]; for ten seconds
/// from then on wheels are measured with the other sign, if they are `reversed`.
Seen drive(const std::string& estimator_name, bool has_bias, double jump, bool reversed) {
  Settings settings = watched_settings(estimator_name, "");
  apply_assignment(settings, "model.outputs=[x_gps, y_gps, delta, yaw_rate]");
  apply_assignment(settings, "noise.outputs.yaw_rate=0.005");
  if (has_bias) apply_assignment(settings, "noise.biases={yaw_rate: {sigma: 0.05, drift: 0.0003}}");
  const Robot vehicle(host(), RobotOptions::table().parse(settings, "robot"));
  constexpr double speed = 2.0, wheelbase = 1.4, antenna = 0.4, tick = 0.01;
  const auto estimator = vehicle.make_estimator();
  std::mt19937_64 random(7);
  std::normal_distribution<double> noise;
  Eigen::Vector4d truth(0.0, 0.0, 0.0, 0.0);
  Seen seen;
  int samples = 0, ok = 0;
  for (int i = 0; i < 8000; ++i) {
    const double time = tick * i, rate = 0.2 * std::cos(0.5 * time),
                 turning = 0.9 * speed / wheelbase * std::tan(0.9 * truth[3]);
    const bool is_wrong = time >= 30.0;
    if (i % 10 == 0) {
      const double told = reversed && is_wrong && time < 40.0 ? -speed : speed;
      estimator->push_input(time, std::vector<double>{told, rate}.data());
    }
    if (i % 2 == 1) {
      const double gyro = turning + bias + (is_wrong ? jump : 0.0) + 0.005 * noise(random);
      estimator->push_measurement(time, std::vector<double>{nan, nan, nan, gyro}.data());
    }
    if (i % 20 == 16)
      estimator->push_measurement(time,
                                  std::vector<double>{truth[0] - antenna * std::cos(truth[2]) + 0.03 * noise(random),
                                                      truth[1] - antenna * std::sin(truth[2]) + 0.03 * noise(random),
                                                      truth[3] + 0.01745 * noise(random), nan}
                                      .data());
    if (i % 20 == 19) {
      const Estimate& now = estimator->estimate(time);
      const std::string words = estimator->watch()->in_words(now.health);
      seen.has_moved = seen.has_moved || words.find("moved") != std::string::npos;
      if (time > 60.0) {
        ++samples;
        ok += now.health.level == HealthLevel::ok;
      }
      seen.error = (now.state.head<2>() - truth.head<2>()).norm();
      if (has_bias) {
        seen.bias = now.state[4];
        seen.sigma = std::sqrt(now.covariance(4, 4));
      }
    }
    truth += tick * Eigen::Vector4d(0.9 * speed * std::cos(truth[2]), 0.9 * speed * std::sin(truth[2]), turning, rate);
  }
  seen.ok = static_cast<double>(ok) / samples;
  return seen;
}

class Biases : public ::testing::TestWithParam<const char*> {};
INSTANTIATE_TEST_SUITE_P(All, Biases, ::testing::Values("ekf", "bank", "rhe"), name_of_estimator);

TEST_P(Biases, AreWhatASensorIsOffByForGood) {
  for (const double jump : {0.0, 0.02, 0.1, -0.5}) {
    SCOPED_TRACE(jump);
    const Seen seen = drive(GetParam(), true, jump, false);
    EXPECT_LT(std::abs(seen.bias - bias - jump), 4.0 * seen.sigma);
    EXPECT_LT(seen.sigma, 0.005);
    EXPECT_LT(seen.error, 0.2);
    EXPECT_GE(seen.ok, 0.99);
    if (std::abs(jump) > 0.05) {
      EXPECT_TRUE(seen.has_moved);
    }
  }
}

/// Of sensors without one it is said that they are off, or they are rejected, for as long as they are.
TEST_P(Biases, AreNotInventedForOthers) {
  const Seen seen = drive(GetParam(), false, 0.1, false);
  EXPECT_EQ(seen.ok, 0.0);
  EXPECT_FALSE(seen.has_moved);
  EXPECT_LT(seen.error, 0.2);
}

/// The state and the offset that seems to explain what the wheels did would else cancel each other for ever.
TEST_P(Biases, AreTheSameAfterAFaultOfOthers) {
  const Seen seen = drive(GetParam(), true, 0.0, true);
  EXPECT_LT(std::abs(seen.bias - bias), 4.0 * seen.sigma);
  EXPECT_LT(seen.sigma, 0.005);
  EXPECT_LT(seen.error, 0.2);
  EXPECT_GE(seen.ok, 0.99);
}

}  // namespace sensor_gate_biases_test
}  // namespace rhec
