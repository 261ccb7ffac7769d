#pragma once

#include <cmath>
#include <string>

#include "rhec/core/model/model.hpp"

namespace rhec::testing {

/// Any number of states in a row, each bent by its neighbours, the inputs and the parameters: all kinds of second
/// derivatives occur.
template <int states, class Scalar>
struct WideVehicle {
  static constexpr int state_count = states, input_count = 2, parameter_count = 2, output_count = 3;
  void dynamics(const Scalar* x, const Scalar* u, const Scalar* p, Scalar* dxdt) const {
    using std::cos, std::sin, std::tanh;
    for (int i = 0; i < states; ++i) {
      const Scalar before = i > 0 ? x[i - 1] : u[0], behind = i + 1 < states ? x[i + 1] : u[1] * p[1];
      dxdt[i] = p[i % 2] * sin(before) - tanh(x[i] * behind) + u[i % 2] * cos(x[i]);
      if (i % 3 == 0) dxdt[i] += 0.5 * x[(7 * i + 3) % states] * x[(5 * i + 1) % states];
    }
  }
  void outputs(const Scalar* x, Scalar* y) const {
    y[0] = x[0] * x[states - 1];
    y[1] = x[states / 2];
    y[2] = x[1] * x[1] * x[2];
  }
};

template <class Scalar>
struct Wide40 : WideVehicle<40, Scalar> {};
template <class Scalar>
struct Wide100 : WideVehicle<100, Scalar> {};
template <class Scalar>
struct Wide120 : WideVehicle<120, Scalar> {};

inline ModelDescription about_wide_vehicle(int states) {
  const auto variables = [](const char* letter, int count) {
    std::vector<Variable> all;
    for (int k = 0; k < count; ++k)
      all.push_back({.name = letter + std::to_string(k),
                     .unit = "1",
                     .meaning = "any",
                     .lower = -0.8,
                     .upper = 0.8,
                     .scale = 0.5});
    return all;
  };
  ModelDescription about;
  about.name = "wide";
  about.states = variables("x", states);
  about.inputs = variables("u", 2);
  about.parameters = variables("p", 2);
  about.outputs = variables("y", 3);
  return about;
}

}  // namespace rhec::testing
