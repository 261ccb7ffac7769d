#pragma once

#include <cmath>
#include <numbers>

#include "rhec/core/model/model.hpp"

namespace rhec::sim {

inline constexpr double wheelbase = 1.4, antenna = 0.4, steering_limit = 35.0 * std::numbers::pi / 180.0;

// The bicycle of the method with slip, by hand: what the truth vehicle and the sensors ask of a model, and no more.
class Bicycle final : public Model {
 public:
  Bicycle() {
    description_.name = "bicycle";
    description_.states = {{"x", "m", ""}, {"y", "m", ""}, {"beta", "rad", ""}, {"delta", "rad", ""}};
    description_.states[3].lower = -steering_limit;
    description_.states[3].upper = steering_limit;
    description_.inputs = {{"u1", "m/s", ""}, {"u2", "rad/s", ""}};
    description_.parameters = {{"kappa", "1", ""}, {"mu", "1", ""}};
    description_.outputs = {{"x", "m", ""}, {"y", "m", ""}, {"delta", "rad", ""}};
    description_.roles = {.position_x = 0, .position_y = 1, .heading = 2, .speed = 0, .speed_factor = 0};
  }
  ModelDescription& mutable_description() { return description_; }
  const ModelDescription& description() const noexcept override { return description_; }
  void integrate(const Intervals&) const noexcept override {}
  void observe(const Nodes& request) const noexcept override {
    const double* x = request.states;
    request.outputs[0] = x[0] - antenna * std::cos(x[2]);
    request.outputs[1] = x[1] - antenna * std::sin(x[2]);
    request.outputs[2] = x[3];
  }
  void rates(const double* x, const double* u, const double* p, double* dxdt) const noexcept override {
    const double speed = p[0] * u[0];
    dxdt[0] = speed * std::cos(x[2]);
    dxdt[1] = speed * std::sin(x[2]);
    dxdt[2] = speed / wheelbase * std::tan(p[1] * x[3]);
    dxdt[3] = u[1];
  }
  bool has_second_derivatives() const noexcept override { return false; }

 private:
  ModelDescription description_;
};

}  // namespace rhec::sim
