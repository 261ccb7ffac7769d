#pragma once

#include <cmath>

#include "rhec/core/config/option_values.hpp"

namespace rhec {

/// Kinematic bicycle with multiplicative slip (Kraus et al. 2013):
///
///     x_pos' = kappa u1 cos(beta)      beta'  = kappa u1 / l tan(mu delta)
///     y_pos' = kappa u1 sin(beta)      delta' = u2
///     h      = [x_pos - d cos(beta), y_pos - d sin(beta), delta, beta, beta', kappa u1]
///
/// with x = [x_pos, y_pos, beta, delta], u = [u1, u2], p = [kappa, mu].
template <class Scalar>
struct BicycleSlip {
  static constexpr int state_count = 4, input_count = 2, parameter_count = 2, output_count = 6;

  Scalar wheelbase{1.4};   ///< l [m]
  Scalar gps_offset{0.4};  ///< d: distance of the GPS antenna behind the rear axle [m]

  template <class Visitor>
  void options(Visitor&& option) {
    option("wheelbase", wheelbase, "distance of the axles [m]", between(1e-3, 1e3));
    option("gps_offset", gps_offset, "how far the GPS antenna is behind the rear axle [m]; negative: before it",
           between(-1e3, 1e3));
  }

  void dynamics(const Scalar* x, const Scalar* u, const Scalar* p, Scalar* dxdt) const {
    using std::cos, std::sin, std::tan;
    const Scalar &beta = x[2], &delta = x[3], &kappa = p[0], &mu = p[1];
    const Scalar speed = kappa * u[0];
    dxdt[0] = speed * cos(beta);
    dxdt[1] = speed * sin(beta);
    dxdt[2] = speed * tan(mu * delta) / wheelbase;
    dxdt[3] = u[1];
  }

  void outputs(const Scalar* x, const Scalar* u, const Scalar* p, Scalar* y) const {
    using std::cos, std::sin, std::tan;
    const Scalar& beta = x[2];
    y[0] = x[0] - gps_offset * cos(beta);
    y[1] = x[1] - gps_offset * sin(beta);
    y[2] = x[3];
    y[3] = beta;
    y[4] = p[0] * u[0] * tan(p[1] * x[3]) / wheelbase;
    y[5] = p[0] * u[0];
  }
};

}  // namespace rhec
