#pragma once

#include <cmath>

#include "rhec/core/config/option_values.hpp"

namespace rhec {

/// A tracked or differential-drive robot with traction coefficients (Kayacan et al. 2018):
///
///     x' = mu v cos(psi)      psi' = kappa omega
///     y' = mu v sin(psi)      h    = [x + a_x cos(psi) - a_y sin(psi), y + a_x sin(psi) + a_y cos(psi), psi,
///                                   psi', mu v]
///
/// with state [x, y, psi], u = [v, omega], p = [mu, kappa].
template <class Scalar>
struct UnicycleTraction {
  static constexpr int state_count = 3, input_count = 2, parameter_count = 2, output_count = 5;

  Scalar antenna_x{0.0};  ///< a_x: distance of the GPS antenna ahead of the centre [m]
  Scalar antenna_y{0.0};  ///< a_y: its distance to the left [m]

  template <class Visitor>
  void options(Visitor&& option) {
    option("antenna_x", antenna_x, "how far the GPS antenna is before the centre [m]; negative: behind it",
           between(-1e3, 1e3));
    option("antenna_y", antenna_y, "how far it is to the left [m]; negative: to the right", between(-1e3, 1e3));
  }

  void dynamics(const Scalar* x, const Scalar* u, const Scalar* p, Scalar* dxdt) const {
    using std::cos, std::sin;
    const Scalar &psi = x[2], &mu = p[0], &kappa = p[1];
    const Scalar speed = mu * u[0];
    dxdt[0] = speed * cos(psi);
    dxdt[1] = speed * sin(psi);
    dxdt[2] = kappa * u[1];
  }

  void outputs(const Scalar* x, const Scalar* u, const Scalar* p, Scalar* y) const {
    using std::cos, std::sin;
    const Scalar cosine = cos(x[2]), sine = sin(x[2]);
    y[0] = x[0] + antenna_x * cosine - antenna_y * sine;
    y[1] = x[1] + antenna_x * sine + antenna_y * cosine;
    y[2] = x[2];
    y[3] = p[1] * u[1];
    y[4] = p[0] * u[0];
  }
};

}  // namespace rhec
