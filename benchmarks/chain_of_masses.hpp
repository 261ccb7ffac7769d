#pragma once

#include <cmath>

/// Masses that hang on springs between a fixed end and one that is moved, in three dimensions:
///
///     p_i' = v_i,   v_i' = (F_{i+1} - F_i) / m - g,   F_i = D (1 - L / |p_i - p_{i-1}|) (p_i - p_{i-1}),   p_0 = 0
///     p_{M+1}' = u
///
/// with the state [p_1, ..., p_M, p_{M+1}, v_1, ..., v_M] (Wirsching, Bock and Diehl, Fast NMPC of a chain of masses
/// connected by springs, IEEE Conference on Control Applications 2006, with their m, D and L).
template <int masses, class Scalar>
struct ChainOfMasses {
  static constexpr int state_count = 6 * masses + 3, input_count = 3, parameter_count = 0, output_count = 3;
  static constexpr int end = 3 * masses;  ///< where the position of the moved end stands
  static constexpr int speeds = end + 3;  ///< where velocities begin
  static constexpr double mass = 0.03, stiffness = 1.0, length = 0.033, gravity = 9.81;

  void dynamics(const Scalar* x, const Scalar* u, const Scalar* /*p*/, Scalar* dxdt) const {
    using std::sqrt;
    Scalar force[speeds];
    for (int i = 0; i <= masses; ++i) {
      Scalar stretch[3];
      for (int k = 0; k < 3; ++k) stretch[k] = i == 0 ? x[k] : x[3 * i + k] - x[3 * i - 3 + k];
      const Scalar distance = sqrt(stretch[0] * stretch[0] + stretch[1] * stretch[1] + stretch[2] * stretch[2]);
      const Scalar tension = stiffness * (1.0 - length / distance);
      for (int k = 0; k < 3; ++k) force[3 * i + k] = tension * stretch[k];
    }
    for (int j = 0; j < end; ++j) {
      dxdt[j] = x[speeds + j];
      dxdt[speeds + j] = (force[j + 3] - force[j]) / mass - (j % 3 == 2 ? gravity : 0.0);
    }
    for (int k = 0; k < 3; ++k) dxdt[end + k] = u[k];
  }
  void outputs(const Scalar* x, Scalar* y) const {
    for (int k = 0; k < 3; ++k) y[k] = x[end + k];
  }
};

template <class Scalar>
struct Chain15 : ChainOfMasses<2, Scalar> {};
template <class Scalar>
struct Chain21 : ChainOfMasses<3, Scalar> {};
template <class Scalar>
struct Chain27 : ChainOfMasses<4, Scalar> {};
