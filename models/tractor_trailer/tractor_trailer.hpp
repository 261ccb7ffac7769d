#pragma once

#include <cmath>

#include "rhec/core/config/option_values.hpp"

namespace rhec {

/// A tractor with a passive trailer and three slip factors (Kayacan et al. 2014). The hitch is l behind the tractor's
/// rear axle (ahead of it if l is negative); beta = psi_t - psi_i is the articulation angle:
///
///     psi_t' = mu v tan(kappa delta) / L_t
///     psi_i' = mu v / L_i (sin(eta beta) - l / L_t tan(kappa delta) cos(eta beta))
///     delta' = delta_rate
///
/// The tractor's rear axle moves at mu v along psi_t. The position that follows the path is that of the trailer's axle,
///
///     x_i = x_t - l cos(psi_t) - L_i cos(psi_i),      y_i = y_t - l sin(psi_t) - L_i sin(psi_i)
///
/// x_i and y_i are states, and their rates are the derivative of that geometry. Without slip the axle then rolls
/// exactly along psi_i; with slip it drifts according to the factors. The published model moves it along psi_i at the
/// tractor's speed, which holds for small beta only.
///
/// With state [x_i, y_i, psi_i, psi_t, delta], u = [v, delta_rate], p = [mu, kappa, eta]. Outputs: the positions of
/// antennas on the trailer and on the tractor (each with a lever arm from its axle), delta, beta, both headings, both
/// rates of turn, and the tractor's speed mu v.
template <class Scalar>
struct TractorTrailer {
  static constexpr int state_count = 5, input_count = 2, parameter_count = 3, output_count = 11;

  Scalar wheelbase{1.4};          ///< L_t [m]
  Scalar trailer_length{1.3};     ///< L_i: distance from the hitch to the trailer's axle [m]
  Scalar hitch{1.1};              ///< l: distance of the hitch behind the tractor's rear axle [m]
  Scalar tractor_antenna_x{0.0};  ///< distance of the antenna ahead of the tractor's rear axle [m]
  Scalar tractor_antenna_y{0.0};  ///< its distance to the left [m]
  Scalar trailer_antenna_x{0.0};  ///< distance of the antenna ahead of the trailer's axle [m]
  Scalar trailer_antenna_y{0.0};  ///< its distance to the left [m]

  template <class Visitor>
  void options(Visitor&& option) {
    option("wheelbase", wheelbase, "distance of the tractor's axles [m]", between(1e-3, 1e3));
    option("trailer_length", trailer_length, "from the hitch to the trailer's axle [m]", between(1e-3, 1e3));
    option("hitch", hitch, "how far the hitch is behind the tractor's rear axle [m]; negative: before it",
           between(-1e3, 1e3));
    option("tractor_antenna_x", tractor_antenna_x, "how far the tractor's antenna is before its rear axle [m]",
           between(-1e3, 1e3));
    option("tractor_antenna_y", tractor_antenna_y, "how far it is to the left [m]", between(-1e3, 1e3));
    option("trailer_antenna_x", trailer_antenna_x, "how far the trailer's antenna is before its axle [m]",
           between(-1e3, 1e3));
    option("trailer_antenna_y", trailer_antenna_y, "how far it is to the left [m]", between(-1e3, 1e3));
  }

  void dynamics(const Scalar* x, const Scalar* u, const Scalar* p, Scalar* dxdt) const {
    using std::cos, std::sin, std::tan;
    const Scalar &psi_i = x[2], &psi_t = x[3], &delta = x[4], &mu = p[0], &kappa = p[1], &eta = p[2];
    const Scalar speed = mu * u[0], slipping = eta * (psi_t - psi_i);
    const Scalar rate_t = speed * tan(kappa * delta) / wheelbase;
    const Scalar rate_i = (speed * sin(slipping) - hitch * rate_t * cos(slipping)) / trailer_length;
    const Scalar sine_t = sin(psi_t), cosine_t = cos(psi_t);
    dxdt[0] = speed * cosine_t + hitch * rate_t * sine_t + trailer_length * rate_i * sin(psi_i);
    dxdt[1] = speed * sine_t - hitch * rate_t * cosine_t - trailer_length * rate_i * cos(psi_i);
    dxdt[2] = rate_i;
    dxdt[3] = rate_t;
    dxdt[4] = u[1];
  }

  void outputs(const Scalar* x, const Scalar* u, const Scalar* p, Scalar* y) const {
    using std::cos, std::sin, std::tan;
    const Scalar &psi_i = x[2], &psi_t = x[3];
    const Scalar sine_i = sin(psi_i), cosine_i = cos(psi_i), sine_t = sin(psi_t), cosine_t = cos(psi_t);
    const Scalar tractor_x = hitch + tractor_antenna_x;
    y[0] = x[0] + trailer_antenna_x * cosine_i - trailer_antenna_y * sine_i;
    y[1] = x[1] + trailer_antenna_x * sine_i + trailer_antenna_y * cosine_i;
    y[2] = x[0] + trailer_length * cosine_i + tractor_x * cosine_t - tractor_antenna_y * sine_t;
    y[3] = x[1] + trailer_length * sine_i + tractor_x * sine_t + tractor_antenna_y * cosine_t;
    y[4] = x[4];
    y[5] = psi_t - psi_i;
    y[6] = psi_i;
    y[7] = psi_t;
    const Scalar speed = p[0] * u[0], slipping = p[2] * (psi_t - psi_i);
    const Scalar rate_t = speed * tan(p[1] * x[4]) / wheelbase;
    y[8] = rate_t;
    y[9] = (speed * sin(slipping) - hitch * rate_t * cos(slipping)) / trailer_length;
    y[10] = speed;
  }
};

}  // namespace rhec
