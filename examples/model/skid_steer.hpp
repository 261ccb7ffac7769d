#pragma once

#include <cmath>

/// A skid-steered vehicle, with the GPS antenna d before its centre:
///
///     x' = kappa v cos(beta)      beta' = mu w
///     y' = kappa v sin(beta)      h(x)  = [x + d cos(beta), y + d sin(beta)]
///
/// with x = [x, y, beta], u = [v, w], p = [kappa, mu].
struct SkidSteer {
  static constexpr int state_count = 3, input_count = 2, parameter_count = 2, output_count = 2;

  double antenna = 0.3;  ///< d [m]

  template <class Scalar>
  void dynamics(const Scalar* x, const Scalar* u, const Scalar* p, Scalar* dxdt) const {
    using std::cos, std::sin;
    dxdt[0] = p[0] * u[0] * cos(x[2]);
    dxdt[1] = p[0] * u[0] * sin(x[2]);
    dxdt[2] = p[1] * u[1];
  }

  template <class Scalar>
  void outputs(const Scalar* x, Scalar* y) const {
    using std::cos, std::sin;
    y[0] = x[0] + antenna * cos(x[2]);
    y[1] = x[1] + antenna * sin(x[2]);
  }
};
