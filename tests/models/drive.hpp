#pragma once

// Vehicles through their plugins: where they go with inputs held, and what their sensors see there.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "rhec/core/model/model.hpp"
#include "rhec/plugins/host/host.hpp"
#include "rhec/plugins/yaml/yaml.hpp"

namespace rhec::testing {

using Numbers = std::vector<double>;

inline std::shared_ptr<Model> vehicle(const std::string& name, const std::string& options = "{}") {
  static const Host host;
  return host.make_model(name, parse_yaml(options, "test"));
}

/// By Runge-Kutta steps so short that their error is rounding.
inline Numbers drive(const Model& model, const Numbers& state, const Numbers& inputs, const Numbers& parameters,
                     double seconds) {
  Numbers end(state.size());
  model.integrate({.count = 1,
                   .states = state.data(),
                   .inputs = inputs.data(),
                   .parameters = parameters.data(),
                   .durations = &seconds,
                   .substeps = 2000,
                   .next_states = end.data()});
  return end;
}

inline Numbers rates(const Model& model, const Numbers& state, const Numbers& inputs, const Numbers& parameters) {
  Numbers result(state.size());
  model.rates(state.data(), inputs.data(), parameters.data(), result.data());
  return result;
}

inline Numbers seen(const Model& model, const Numbers& state) {
  Numbers outputs(model.output_count());
  model.observe({.count = 1, .states = state.data(), .outputs = outputs.data()});
  return outputs;
}

/// State and inputs that go straight on at a speed over ground.
struct Motion {
  Numbers state, inputs;
};
inline Motion straight(const Model& model, double ground_speed, const Numbers& parameters) {
  Motion motion{Numbers(model.state_count(), 0.0), Numbers(model.input_count(), 0.0)};
  model.straight_motion(ground_speed, parameters.data(), motion.state.data(), motion.inputs.data());
  return motion;
}

inline void expect_near(const Numbers& found, const Numbers& expected, double tolerance = 1e-10) {
  EXPECT_THAT(found, ::testing::Pointwise(::testing::DoubleNear(tolerance), expected));
}

/// Along a circle at a speed and a yaw rate, from a place and a direction of travel.
inline Numbers along_circle(double x, double y, double direction, double speed, double yaw_rate, double seconds) {
  const double radius = speed / yaw_rate, end = direction + yaw_rate * seconds;
  return {x + radius * (std::sin(end) - std::sin(direction)), y - radius * (std::cos(end) - std::cos(direction)), end};
}

}  // namespace rhec::testing
