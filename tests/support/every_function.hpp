#pragma once

#include <cmath>

namespace rhec {

/// Not a vehicle, but every operation and function that a formula may use, with constants of every kind on either side.
template <class Scalar>
struct EveryFunction {
  static constexpr int state_count = 3, input_count = 1, parameter_count = 2, output_count = 11;

  void dynamics(const Scalar* x, const Scalar* u, const Scalar* p, Scalar* dxdt) const {
    using std::sqrt, std::exp, std::log, std::sin, std::cos, std::tan, std::tanh, std::asin, std::acos, std::atan,
        std::atan2;
    const Scalar two = 2.0;
    const Scalar positive = 1.5 + sin(x[0]) * 0.5;
    const Scalar small = tanh(x[1] + p[0]) / two;
    dxdt[0] = sqrt(positive) * exp(-small) + log(positive) / (3 + small) - 1 + u[0];
    dxdt[1] = tan(small) + asin(small) - acos(small * 0.9) * 0.25 + cos(p[1] * x[2]);
    dxdt[2] = atan2(x[1], positive) - atan2(-positive, 1.0 - x[0]) + 1.0 / positive - atan(x[2]) - two;
    dxdt[2] += p[1];
    dxdt[2] -= 0.5;
    dxdt[2] *= positive;
  }

  void outputs(const Scalar* x, Scalar* y) const {
    using std::sqrt, std::exp, std::log, std::sin, std::cos, std::tan, std::tanh, std::asin, std::acos, std::atan,
        std::atan2;
    y[0] = sqrt(x[0] * x[0] + 0.1);
    y[1] = exp(x[1]);
    y[2] = log(x[0] * x[0] + 0.1);
    y[3] = sin(x[0]);
    y[4] = cos(10 * x[0]);
    y[5] = tan(x[1]);
    y[6] = tanh(4.0 * x[1]);
    y[7] = asin(0.9 * sin(x[2]));
    y[8] = acos(0.9 * sin(x[2]));
    y[9] = atan(5.0 * x[2]);
    y[10] = atan2(x[1] - 0.2, x[2]);
  }
};

}  // namespace rhec
