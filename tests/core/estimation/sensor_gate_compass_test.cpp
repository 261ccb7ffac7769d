// A compass that is off for some time or for good, on a vehicle whose slip could turn it as well.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <random>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "rhec/core/base/angle.hpp"
#include "rhec/core/estimation/sensor_watch.hpp"
#include "support/sensor_faults.hpp"

namespace rhec {
namespace sensor_gate_compass_test {

using namespace rhec::testing;

constexpr double fault_begins = 20.0, fault_ends = 30.0, for_good = 1e9;
constexpr double jump = 0.17;  // [rad]

struct Seen {
  double honest = 0.0;       ///< share of samples since the fault began with the heading within 3 sigma, or not ok
  double again_after = 1e9;  ///< the fault's end it is ok for two seconds [s]
  double offset = 0.0;       ///< that is said of the compass at the end [rad]
  double error = 0.0;        ///< of the heading at the end [rad]
  bool was_off = false;      ///< is said of the compass before the fault
};

/// A rover with positions at 5 Hz, a compass and wheels at 10 Hz, for 50 s; its slip changes all the time.
Seen drive(const std::string& estimator_name, std::uint64_t seed, double until) {
  const Robot vehicle(host(), RobotOptions::table().parse(parse_yaml(R"(
step: 0.1
model: {name: skid_steer, wheel_radius: 0.14, track_width: 0.6, outputs: [x_gps, y_gps, heading]}
noise: {outputs: {x_gps: 0.03, y_gps: 0.03, heading: 0.02}, inputs: {omega_left: 0.15, omega_right: 0.15}}
estimator:
  name: )" + estimator_name + R"(
  horizon: 3 s
  initial:
    parameters: {lambda_left: 0.15, lambda_right: 0.15, icr_offset: 0.05}
    sigma: {x: 0.1, y: 0.1, psi: 0.1, lambda_left: 0.2, lambda_right: 0.2, icr_offset: 0.2}
)",
                                                                     "robot"),
                                                          "robot"));
  constexpr double tick = 0.01, radius = 0.14, track = 0.6;
  std::mt19937_64 random(seed);
  std::normal_distribution<double> noise;
  const double phase = 6.0 * std::uniform_real_distribution<double>()(random);
  Eigen::Vector3d truth = Eigen::Vector3d::Zero();
  const auto estimator = vehicle.make_estimator(truth);
  Seen seen;
  int counted = 0, honest = 0;
  double ok_since = 1e9;
  for (int i = 0; i < 5000; ++i) {
    const double time = tick * i, turn = 0.35 * std::sin(0.2 * time + phase), speed = 1.0;
    const double left = (speed - 0.5 * turn * track) / radius / 0.85,
                 right = (speed + 0.5 * turn * track) / radius / 0.85;
    const bool is_off = time >= fault_begins && time < until;
    if (i % 10 == 0) {
      estimator->push_input(time,
                            std::vector<double>{left + 0.05 * noise(random), right + 0.05 * noise(random)}.data());
      const double compass = truth[2] + (is_off ? jump : 0.0) + 0.02 * noise(random);
      estimator->push_measurement(time, std::vector<double>{nan, nan, compass}.data());
    }
    if (i % 20 == 3)
      estimator->push_measurement(
          time, std::vector<double>{truth[0] + 0.03 * noise(random), truth[1] + 0.03 * noise(random), nan}.data());
    if (i % 10 == 9) {
      const Estimate& now = estimator->estimate(time);
      const bool is_ok = now.health.level == HealthLevel::ok;
      const double error = angle_difference(now.state[2], truth[2]);
      if (time < fault_begins) seen.was_off = seen.was_off || now.health.sensors[1].reasons != 0;
      if (time >= fault_begins) {
        ++counted;
        honest += !is_ok || std::abs(error) < 3.0 * std::sqrt(now.covariance(2, 2));
      }
      ok_since = is_ok ? std::min(ok_since, time) : 1e9;
      if (time > until && time - ok_since > 2.0)
        seen.again_after = std::min(seen.again_after, std::max(0.0, ok_since - until));
      seen.offset = now.health.sensors[1].offset;
      seen.error = error;
    }
    const double slip_left = 0.15 + 0.07 * std::sin(0.12 * time + phase),
                 slip_right = 0.15 + 0.07 * std::sin(0.1 * time);
    const double v_left = radius * left * (1.0 - slip_left), v_right = radius * right * (1.0 - slip_right);
    const double v = 0.5 * (v_left + v_right), rate = (v_right - v_left) / track, aside = -0.05 * rate;
    truth += tick * Eigen::Vector3d(v * std::cos(truth[2]) - aside * std::sin(truth[2]),
                                    v * std::sin(truth[2]) + aside * std::cos(truth[2]), rate);
  }
  seen.honest = static_cast<double>(honest) / counted;
  return seen;
}

class Compass : public ::testing::TestWithParam<const char*> {};
INSTANTIATE_TEST_SUITE_P(All, Compass, ::testing::Values("ekf", "bank", "rhe"), name_of_estimator);

constexpr int drives = 6;

/// A filter knows its heading badly without a compass, and may come to believe a wrong one: in one drive of six.
TEST_P(Compass, ThatJumpsIsNotTakenForSlip) {
  double honest = 0.0;
  int believed = 0, right = 0;
  for (int seed = 1; seed <= drives; ++seed) {
    const Seen seen = drive(GetParam(), static_cast<std::uint64_t>(seed), fault_ends);
    EXPECT_FALSE(seen.was_off) << seed;
    honest += seen.honest / drives;
    believed += seen.again_after < 5.0;
    right += std::abs(seen.error) < 0.1;
  }
  EXPECT_GE(honest, 0.95);
  EXPECT_GE(believed, drives - 1) << "one that is right again is believed again";
  EXPECT_EQ(right, drives);
}

TEST_P(Compass, ThatIsOffForGoodIsUsedWithoutItsOffset) {
  double honest = 0.0;
  int found = 0, right = 0;
  for (int seed = 1; seed <= drives; ++seed) {
    const Seen seen = drive(GetParam(), static_cast<std::uint64_t>(seed), for_good);
    honest += seen.honest / drives;
    found += std::abs(seen.offset - jump) < 0.06;
    right += std::abs(seen.error) < 0.1;
  }
  EXPECT_GE(honest, 0.9);
  EXPECT_GE(found, drives - 1);
  EXPECT_GE(right, drives - 1);
}

}  // namespace sensor_gate_compass_test
}  // namespace rhec
