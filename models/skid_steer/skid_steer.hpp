#pragma once

#include <cmath>

#include "rhec/core/config/option_values.hpp"

namespace rhec {

/// A skid-steered vehicle (Yi et al. 2009). The wheels of each side turn together, and each side has its own
/// longitudinal slip ratio. To turn, the vehicle slides sideways; its centre of rotation is s ahead of its centre:
///
///     v_l  = r omega_l (1 - lambda_l)      v   = (v_l + v_r) / 2           x' = v cos(psi) + s psi' sin(psi)
///     v_r  = r omega_r (1 - lambda_r)      psi' = (v_r - v_l) / W          y' = v sin(psi) - s psi' cos(psi)
///
/// with state [x, y, psi], u = [omega_l, omega_r], p = [lambda_l, lambda_r, s]. Outputs: the position of an antenna
/// with lever arm (a_x, a_y) from the centre, psi, psi', v.
template <class Scalar>
struct SkidSteer {
  static constexpr int state_count = 3, input_count = 2, parameter_count = 3, output_count = 5;

  Scalar wheel_radius{0.14};  ///< r [m]
  Scalar track_width{0.6};    ///< W: between the left and right wheels [m]
  Scalar antenna_x{0.0};      ///< a_x: distance of the GPS antenna ahead of the centre [m]
  Scalar antenna_y{0.0};      ///< a_y: its distance to the left [m]

  template <class Visitor>
  void options(Visitor&& option) {
    option("wheel_radius", wheel_radius, "of the wheels [m]", between(1e-3, 1e3));
    option("track_width", track_width, "between the wheels of both sides [m]", between(1e-3, 1e3));
    option("antenna_x", antenna_x, "how far the GPS antenna is before the centre [m]; negative: behind it",
           between(-1e3, 1e3));
    option("antenna_y", antenna_y, "how far it is to the left [m]; negative: to the right", between(-1e3, 1e3));
  }

  void dynamics(const Scalar* x, const Scalar* u, const Scalar* p, Scalar* dxdt) const {
    using std::cos, std::sin;
    const Scalar left = wheel_radius * u[0] * (1.0 - p[0]), right = wheel_radius * u[1] * (1.0 - p[1]);
    const Scalar speed = 0.5 * (left + right), yaw_rate = (right - left) / track_width;
    const Scalar slide = p[2] * yaw_rate;
    const Scalar cosine = cos(x[2]), sine = sin(x[2]);
    dxdt[0] = speed * cosine + slide * sine;
    dxdt[1] = speed * sine - slide * cosine;
    dxdt[2] = yaw_rate;
  }

  void outputs(const Scalar* x, const Scalar* u, const Scalar* p, Scalar* y) const {
    using std::cos, std::sin;
    const Scalar cosine = cos(x[2]), sine = sin(x[2]);
    y[0] = x[0] + antenna_x * cosine - antenna_y * sine;
    y[1] = x[1] + antenna_x * sine + antenna_y * cosine;
    y[2] = x[2];
    const Scalar left = wheel_radius * u[0] * (1.0 - p[0]), right = wheel_radius * u[1] * (1.0 - p[1]);
    y[3] = (right - left) / track_width;
    y[4] = 0.5 * (left + right);
  }

  // No single input is the speed: each side has its own wheel speed and slip.
  void straight_motion(const Scalar& ground_speed, const Scalar* p, Scalar*, Scalar* u) const {
    for (int side = 0; side < 2; ++side) u[side] = ground_speed / (wheel_radius * (1.0 - p[side]));
  }
};

}  // namespace rhec
