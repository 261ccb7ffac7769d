#pragma once

// A turntable whose rate of turn is that of its drive times a traction that nobody knows. A gyro sees the product, an
// encoder of the drive one factor.

#include <memory>
#include <vector>

#include "rhec/core/model/formula_model.hpp"
#include "rhec/core/model/sensor_model.hpp"

namespace rhec::testing {

template <class Scalar>
struct Turntable {
  static constexpr int state_count = 1, input_count = 1, parameter_count = 1, output_count = 2;
  void dynamics(const Scalar*, const Scalar* u, const Scalar* p, Scalar* dxdt) const { dxdt[0] = p[0] * u[0]; }
  void outputs(const Scalar* x, const Scalar* u, const Scalar* p, Scalar* y) const {
    y[0] = x[0];
    y[1] = p[0] * u[0];
  }
};

/// States: psi, the gyro's scale error if it has one, and its value at the node. `traction`: its bounds.
inline std::shared_ptr<const Model> turntable(bool has_scale_error = false, const Variable& traction = {}) {
  ModelDescription about;
  about.states.resize(1);
  about.inputs.resize(1);
  about.parameters.resize(1);
  about.outputs.resize(2);
  about.states[0].name = "psi";
  about.inputs[0].name = "omega";
  about.parameters[0] = traction;
  about.parameters[0].name = "kappa";
  about.outputs[0].name = "angle";
  about.outputs[1].name = "gyro";
  return std::make_shared<SensorModel>(
      std::make_shared<FormulaModel<Turntable>>(Turntable<double>{}, about),
      SensorModel::Errors{.biased = {}, .scaled = has_scale_error ? std::vector{1} : std::vector<int>{}});
}

/// Standard deviations.
struct TurntableNoise {
  double angle = 1.0, gyro = 0.002, omega = 0.05, kappa = 0.1;
};

}  // namespace rhec::testing
