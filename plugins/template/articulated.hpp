#pragma once

#include <cmath>

#include "rhec/core/config/option_values.hpp"

/// A centre-articulated vehicle, such as a wheel loader: a front and a rear unit joined by a hinge.
///
///     x'     = kappa v cos(theta)
///     y'     = kappa v sin(theta)
///     theta' = (kappa v sin(mu gamma) + nu rear gamma') / (front cos(mu gamma) + rear)
///     gamma' = w
///     h      = [x + antenna cos(theta), y + antenna sin(theta), gamma]
///
/// with the state [x, y, theta, gamma] (centre of the front axle, heading of the front unit, articulation angle: the
/// front unit's heading minus the rear unit's), the input [v, w] (wheel speed, articulation rate) and the slip [kappa,
/// mu, nu]. Without slip all three are 1, and this is the model of Corke & Ridley, Steering kinematics for a
/// center-articulated mobile robot, IEEE Transactions on Robotics and Automation 17(2), 2001.
///
/// For another vehicle, change the four counts, the options, and the two functions. `Scalar` behaves like double, but
/// its value is not known when the formula is recorded and differentiated; so no `if` on values, and no `std::` before
/// sin.
template <class Scalar>
struct Articulated {
  static constexpr int state_count = 4, input_count = 2, parameter_count = 3, output_count = 3;

  Scalar front{1.2};    ///< distance from the hinge to the front axle [m]
  Scalar rear{1.2};     ///< distance from the hinge to the rear axle [m]
  Scalar antenna{0.3};  ///< distance of the GPS antenna ahead of the front axle [m]

  template <class Visitor>
  void options(Visitor&& option) {
    option("front", front, "from the hinge to the front axle [m]", rhec::greater_than(0.0));
    option("rear", rear, "from the hinge to the rear axle [m]", rhec::greater_than(0.0));
    option("antenna", antenna, "how far the GPS antenna is before the front axle [m]");
  }

  void dynamics(const Scalar* x, const Scalar* u, const Scalar* p, Scalar* dxdt) const {
    using std::cos, std::sin;
    const Scalar speed = p[0] * u[0], bend = p[1] * x[3];
    dxdt[0] = speed * cos(x[2]);
    dxdt[1] = speed * sin(x[2]);
    dxdt[2] = (speed * sin(bend) + p[2] * rear * u[1]) / (front * cos(bend) + rear);
    dxdt[3] = u[1];
  }

  void outputs(const Scalar* x, Scalar* y) const {
    using std::cos, std::sin;
    y[0] = x[0] + antenna * cos(x[2]);
    y[1] = x[1] + antenna * sin(x[2]);
    y[2] = x[3];
  }
};
