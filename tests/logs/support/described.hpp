#pragma once

#include "rhec/core/model/model.hpp"

namespace rhec::logs {

/// Outputs and inputs of a vehicle that nobody here has seen.
inline ModelDescription described() {
  ModelDescription about;
  about.outputs = {{.name = "x_gps", .unit = "m", .meaning = "antenna, x"},
                   {.name = "y_gps", .unit = "m", .meaning = "antenna, y"},
                   {.name = "psi_m", .unit = "rad", .meaning = "measured heading", .is_angle = true},
                   {.name = "delta", .unit = "rad", .meaning = "steering angle", .is_angle = true}};
  about.inputs = {{.name = "v", .unit = "m/s", .meaning = "wheel speed"},
                  {.name = "delta_rate", .unit = "rad/s", .meaning = "steering rate"}};
  return about;
}

}  // namespace rhec::logs
