#pragma once

#include <cmath>

#include "rhec/core/config/option_values.hpp"

namespace rhec {

/// Kinematic bicycle with additive side-slip angles (Lenain et al. 2006), in earth coordinates:
///
///     x' = v cos(psi + beta_rear)      psi'   = v cos(beta_rear) (tan(delta + beta_front) - tan(beta_rear)) / L
///     y' = v sin(psi + beta_rear)      delta' = delta_rate
///
/// with state [x, y, psi, delta], u = [v, delta_rate], p = [beta_front, beta_rear]. v is the speed of the rear axle's
/// centre; each axle's velocity points beta_front or beta_rear to the left of its wheels. The source gives the same
/// model in path coordinates. Outputs: the position of an antenna with lever arm (a_x, a_y), delta, psi, psi', v.
template <class Scalar>
struct BicycleSideslip {
  static constexpr int state_count = 4, input_count = 2, parameter_count = 2, output_count = 6;

  Scalar wheelbase{2.8};  ///< L [m]
  Scalar antenna_x{0.0};  ///< a_x: distance of the GPS antenna ahead of the rear axle [m]
  Scalar antenna_y{0.0};  ///< a_y: its distance to the left [m]

  template <class Visitor>
  void options(Visitor&& option) {
    option("wheelbase", wheelbase, "distance of the axles [m]", between(1e-3, 1e3));
    option("antenna_x", antenna_x, "how far the GPS antenna is before the rear axle [m]; negative: behind it",
           between(-1e3, 1e3));
    option("antenna_y", antenna_y, "how far it is to the left [m]; negative: to the right", between(-1e3, 1e3));
  }

  void dynamics(const Scalar* x, const Scalar* u, const Scalar* p, Scalar* dxdt) const {
    using std::cos, std::sin, std::tan;
    const Scalar &psi = x[2], &delta = x[3], &v = u[0], &front = p[0], &rear = p[1];
    dxdt[0] = v * cos(psi + rear);
    dxdt[1] = v * sin(psi + rear);
    dxdt[2] = v * cos(rear) * (tan(delta + front) - tan(rear)) / wheelbase;
    dxdt[3] = u[1];
  }

  void outputs(const Scalar* x, const Scalar* u, const Scalar* p, Scalar* y) const {
    using std::cos, std::sin, std::tan;
    const Scalar cosine = cos(x[2]), sine = sin(x[2]);
    y[0] = x[0] + antenna_x * cosine - antenna_y * sine;
    y[1] = x[1] + antenna_x * sine + antenna_y * cosine;
    y[2] = x[3];
    y[3] = x[2];
    y[4] = u[0] * cos(p[1]) * (tan(x[3] + p[0]) - tan(p[1])) / wheelbase;
    y[5] = u[0];
  }
};

}  // namespace rhec
