#pragma once

#include <cmath>

#include "rhec/core/config/option_values.hpp"

/// A vehicle that steers both axles; its position is that of the rear axle:
///
///     x' = kappa v cos(theta + mu rear),   theta' = kappa v sin(mu (front - rear)) / (length cos(mu front))
///     y' = kappa v sin(theta + mu rear),   front' = front_rate,   rear' = rear_rate
///
/// with the state [x, y, theta, front, rear], the input [v, front_rate, rear_rate] and the slip [kappa, mu]. With three
/// inputs, no kernel of the recursion is compiled for its sizes.
template <class Scalar>
struct TwoAxleSteering {
  static constexpr int state_count = 5, input_count = 3, parameter_count = 2, output_count = 4;

  Scalar length{2.0};  ///< distance between the axles [m]

  template <class Visitor>
  void options(Visitor&& option) {
    option("length", length, "between the axles [m]", rhec::greater_than(0.0));
  }

  void dynamics(const Scalar* x, const Scalar* u, const Scalar* p, Scalar* dxdt) const {
    using std::cos, std::sin;
    const Scalar speed = p[0] * u[0], front = p[1] * x[3], rear = p[1] * x[4];
    dxdt[0] = speed * cos(x[2] + rear);
    dxdt[1] = speed * sin(x[2] + rear);
    dxdt[2] = speed * sin(front - rear) / (length * cos(front));
    dxdt[3] = u[1];
    dxdt[4] = u[2];
  }

  void outputs(const Scalar* x, Scalar* y) const {
    y[0] = x[0];
    y[1] = x[1];
    y[2] = x[3];
    y[3] = x[4];
  }
};
