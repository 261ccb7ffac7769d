#pragma once

// A car that is steered by one of its inputs, and measures what it has steered: one of the two is wrong.

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include "support/sensor_faults.hpp"

namespace rhec::testing {

/// A car that is steered by its input, and measures what it has steered.
inline Robot contradicted_car(const std::string& estimator) {
  return {host(), RobotOptions::table().parse(parse_yaml(R"(
step: 0.1
model:
  equations:
    states:
      x: {unit: m, typical: 10, role: position_x}
      y: {unit: m, typical: 10, role: position_y}
      psi: {unit: rad, angle: true, role: heading}
    inputs: {v: {unit: m/s, typical: 2}, delta: {unit: rad, typical: 0.3, bounds: [-0.6, 0.6]}}
    parameters: {grip: {nominal: 0.9, typical: 0.3, bounds: [0.2, 1.2]}}
    outputs: {x_gps: {unit: m, typical: 10}, y_gps: {unit: m, typical: 10}, steering: {unit: rad, typical: 0.3}}
    equations: |
      x' = v * cos(psi)
      y' = v * sin(psi)
      psi' = grip * v * tan(delta) / 1.1
      x_gps = x
      y_gps = y
      steering = delta
    straight_motion: |
      v = ground_speed
      delta = 0
noise: {outputs: {x_gps: 0.03, y_gps: 0.03, steering: 0.015}, inputs: {v: 0.05, delta: 0.03}}
estimator:
  name: )" + estimator + R"(
  horizon: 3 s
  initial: {sigma: {x: 0.05, y: 0.05, psi: 0.05}}
)",
                                                         "robot"),
                                              "robot")};
}

/// What is measured of the steering.
struct SteeringMessage {
  double since = 0.0;  ///< since the fault began [s]
  double steering = 0.0;
  double input = 0.0;  ///< measured steering
};

struct ContradictedRide {
  double most = 0.0;  ///< [m]
  std::vector<std::string> words;
  std::string last;
  long allocations = 0;  ///< by the estimator, since something is wrong
  double turned = 0.0;   ///< by how much the estimate of the heading is off at the end [rad]

  bool says(const std::string& what) const {
    return std::ranges::any_of(words, [&](const std::string& each) { return each.find(what) != std::string::npos; });
  }
};

/// A kind of fault, of one ride.
using Spoil = std::function<void(SteeringMessage&)>;
inline Spoil stuck(double SteeringMessage::*what) {
  return [what, held = 0.0, is_held = false](SteeringMessage& each) mutable {
    if (!is_held) held = each.*what;
    is_held = true;
    each.*what = held;
  };
}

/// It goes straight for 30 s, then along bends, and 5 s before these begin something is wrong for so long [s].
inline ContradictedRide drive_contradicted(const Robot& robot, std::uint64_t seed, double length, const Spoil& spoil,
                                           const std::function<long()>& allocations = {}) {
  constexpr double step = 0.1, begin = 25.0, bends = 30.0, end = 70.0, speed = 2.0, ground = 1.1, grip = 0.85;
  std::mt19937_64 random(seed);
  std::normal_distribution<double> noise;
  double x = 0.0, y = 0.0, psi = 0.0;
  Eigen::VectorXd first = Eigen::VectorXd::Zero(robot.model()->state_count());
  const auto estimator = robot.make_estimator(first);
  ContradictedRide ride;
  double steered = 0.0;
  for (int k = 0; k * step < end; ++k) {
    const double time = k * step;
    const bool has_position = k % 2 == 0;
    const double nothing = std::nan("");
    const double wanted = time < begin   ? 0.3 * std::sin(0.4 * time)
                          : time < bends ? 0.0
                                         : 0.35 * std::sin(0.5 * (time - bends));
    SteeringMessage message{
        .since = time - begin, .steering = steered + 0.015 * noise(random), .input = wanted + 0.01 * noise(random)};
    if (time >= begin && time < begin + length) spoil(message);
    const double outputs[] = {has_position ? x + 0.03 * noise(random) : nothing,
                              has_position ? y + 0.03 * noise(random) : nothing, message.steering};
    const long before = allocations ? allocations() : 0;
    estimator->push_measurement(time, outputs);
    const Estimate& estimate = estimator->estimate(time, Clock::time_point::max());
    const double inputs[] = {speed + 0.02 * noise(random), message.input};
    estimator->push_input(time, inputs);
    if (allocations && time >= begin) ride.allocations += allocations() - before;
    if (time >= begin) {
      ride.most = std::max(ride.most, std::hypot(estimate.state[0] - x, estimate.state[1] - y));
      ride.words.push_back(estimator->watch()->in_words(estimate.health));
      ride.last = ride.words.back();
    }
    ride.turned = std::abs(std::remainder(estimate.state[2] - psi, 2.0 * std::numbers::pi));
    constexpr int parts = 20;
    steered = wanted;
    for (int part = 0; part < parts; ++part) {
      x += speed * std::cos(psi) * step / parts;
      y += speed * std::sin(psi) * step / parts;
      psi += grip * speed * std::tan(steered) / ground * step / parts;
    }
  }
  return ride;
}

}  // namespace rhec::testing
