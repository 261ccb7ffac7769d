#pragma once

// Episodes of a bicycle whose sensors fail, with every estimator that is watched.

#include <gtest/gtest.h>

#include <cstdint>
#include <string>

#include "rhec/plugins/yaml/yaml.hpp"
#include "support/faulty_drive.hpp"
#include "support/linear_case.hpp"

namespace rhec::testing {

inline Settings watched_settings(const std::string& estimator, const std::string& more) {
  return parse_yaml(R"(
step: 0.2
model: {name: bicycle_slip, wheelbase: 1.4, gps_offset: 0.4}
noise: {outputs: {x_gps: 0.03, y_gps: 0.03, delta: 0.01745}, inputs: {u1: 0.1, u2: 0.1}}
bounds: {delta: [-0.61, 0.61], u2: [-0.61, 0.61], kappa: [0, 1], mu: [0, 1]}
estimator:
  name: )" + estimator + R"(
  horizon: 15
  process_noise: {kappa: 0.03, mu: 0.03}
  initial:
    parameters: {kappa: 0.5, mu: 0.5}
    sigma: {x_pos: 0.05, y_pos: 0.05, beta: 0.03, delta: 0.02, kappa: 1, mu: 1}
)" + more,
                    "robot");
}

inline Robot watched_robot(const std::string& estimator, const std::string& more = "") {
  return {host(), RobotOptions::table().parse(watched_settings(estimator, more), "robot")};
}

/// The same with a second receiver, that of outputs 3 and 4, with this noise [m].
inline Robot with_two_receivers(const std::string& estimator, const std::string& noise) {
  Settings settings = watched_settings(estimator, "");
  apply_assignment(settings, "model.outputs=[x_gps, y_gps, delta, {x_rough: x_gps}, {y_rough: y_gps}]");
  for (const char* output : {"x_rough", "y_rough"})
    apply_assignment(settings, std::string("noise.outputs.") + output + "=" + noise);
  return {host(), RobotOptions::table().parse(settings, "robot")};
}

/// A skid-steered robot with a compass, that of output 2.
inline Settings with_compass_settings(const std::string& estimator) {
  return parse_yaml(R"(
step: 0.2
model: {name: skid_steer, wheel_radius: 0.2}
noise: {outputs: {x_gps: 0.03, y_gps: 0.03, heading: 0.02}, inputs: {omega_left: 0.1, omega_right: 0.1}}
estimator:
  name: )" + estimator + R"(
  horizon: 15
  initial: {sigma: {x: 0.05, y: 0.05, psi: 0.03}}
)",
                    "robot");
}

inline Robot with_compass(const std::string& estimator) {
  return {host(), RobotOptions::table().parse(with_compass_settings(estimator), "robot")};
}

/// A farm vehicle whose axles slip sideways, with a compass: nothing of it says that its wheels slip along.
inline Robot with_sideslip(const std::string& estimator) {
  return {host(), RobotOptions::table().parse(parse_yaml(R"(
step: 0.2
model: {name: bicycle_sideslip, outputs: [x_gps, y_gps, delta, heading]}
noise: {outputs: {x_gps: 0.03, y_gps: 0.03, delta: 0.01, heading: 0.01}, inputs: {v: 0.1, delta_rate: 0.05}}
estimator:
  name: )" + estimator + R"(
  horizon: 15
  initial: {sigma: {x: 0.05, y: 0.05, psi: 0.03, delta: 0.02, beta_front: 0.1, beta_rear: 0.1}}
)",
                                                         "robot"),
                                              "robot")};
}

struct SensorFaults : ::testing::TestWithParam<const char*> {
  Robot vehicle = watched_robot(GetParam());
  static constexpr int seeds = 4;
  static constexpr double usual_error = 0.3;  // [m]

  /// Holds what every fault has to keep but for honesty, as of one that is followed to a wrong place for long, and
  /// hands on the episodes.
  template <class Function>
  void expect_each_long(const Fault& fault, const Function& check) {
    for (int seed = 1; seed <= seeds; ++seed) {
      SCOPED_TRACE(seed);
      const Episode episode = drive_with_fault(vehicle, fault, static_cast<std::uint64_t>(seed));
      EXPECT_TRUE(episode.is_finite);
      for (const Episode::Sample& sample : episode.before) EXPECT_EQ(sample.health, HealthLevel::ok) << sample.words;
      EXPECT_LE(episode.samples_to_ok(), 25);
      check(episode);
    }
  }
  /// Holds all of it.
  template <class Function>
  void expect_each(const Fault& fault, const Function& check) {
    expect_each_long(fault, [&](const Episode& episode) {
      EXPECT_GE(episode.honest_share(), 0.95);
      check(episode);
    });
  }
};

inline std::string name_of_estimator(const ::testing::TestParamInfo<const char*>& about) { return about.param; }

}  // namespace rhec::testing
