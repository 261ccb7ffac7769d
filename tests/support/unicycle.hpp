#pragma once

#include <cmath>
#include <memory>

#include "rhec/core/model/formula_model.hpp"

namespace rhec::testing {

/// A unicycle: position, heading; wheel speed and curvature; a speed factor.
template <class Scalar>
struct UnicycleFormula {
  static constexpr int state_count = 3, input_count = 2, parameter_count = 1, output_count = 1;
  void dynamics(const Scalar* x, const Scalar* u, const Scalar* p, Scalar* dxdt) const {
    using std::cos;
    using std::sin;
    const Scalar speed = p[0] * u[0];
    dxdt[0] = speed * cos(x[2]);
    dxdt[1] = speed * sin(x[2]);
    dxdt[2] = speed * u[1];
  }
  void outputs(const Scalar* x, Scalar* y) const { y[0] = x[0]; }
};

inline std::shared_ptr<const Model> unicycle() {
  ModelDescription about;
  about.name = "unicycle";
  about.states = {{.name = "x", .unit = "m", .meaning = "position"},
                  {.name = "y", .unit = "m", .meaning = "position"},
                  {.name = "heading", .unit = "rad", .meaning = "heading", .is_angle = true}};
  about.inputs = {{.name = "speed", .unit = "m/s", .meaning = "wheel speed", .lower = 0.0, .upper = 3.0},
                  {.name = "curvature", .unit = "1/m", .meaning = "of the path", .lower = -1.0, .upper = 1.0}};
  about.parameters = {{.name = "factor", .unit = "1", .meaning = "speed factor", .lower = 0.2, .upper = 1.2}};
  about.outputs = {{.name = "x", .unit = "m", .meaning = "position"}};
  about.roles = {.position_x = 0, .position_y = 1, .heading = 2, .speed = 0, .speed_factor = 0};
  return std::make_shared<FormulaModel<UnicycleFormula>>(UnicycleFormula<double>{}, about);
}

}  // namespace rhec::testing
