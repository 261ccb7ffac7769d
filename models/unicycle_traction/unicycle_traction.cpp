// The unicycle with traction coefficients as a plugin: names, units and bounds of the variables in
// unicycle_traction.hpp.
#include "unicycle_traction.hpp"

#include "rhec/core/model/formula_model.hpp"
#include "rhec/plugins/kit/sdk.hpp"

namespace rhec {

const StraightCode& unicycle_traction_kernels();  // defined by rhec_add_model

namespace {

constexpr const char* kSource =
    "Kayacan, Young, Peschel, Chowdhary, High-precision control of tracked field robots in the presence of unknown "
    "traction coefficients, Journal of Field Robotics 35(7), 2018";

ModelDescription describe() {
  ModelDescription model;
  model.name = "unicycle_traction";
  model.source = kSource;
  model.states = {
      {.name = "x", .unit = "m", .meaning = "centre, x", .scale = 2.0},
      {.name = "y", .unit = "m", .meaning = "centre, y", .scale = 2.0},
      {.name = "psi", .unit = "rad", .meaning = "heading", .is_angle = true},
  };
  model.inputs = {
      {.name = "v", .unit = "m/s", .meaning = "speed of the tracks", .scale = 0.5},
      {.name = "omega", .unit = "rad/s", .meaning = "yaw rate by the tracks", .lower = -1.5, .upper = 1.5},
  };
  model.parameters = {
      {.name = "mu",
       .unit = "1",
       .meaning = "traction: ground speed / speed of the tracks",
       .lower = 0.0,
       .upper = 1.0,
       .scale = 0.5},
      {.name = "kappa",
       .unit = "1",
       .meaning = "traction: yaw rate / that of the tracks",
       .lower = 0.0,
       .upper = 1.0,
       .scale = 0.5},
  };
  model.outputs = {
      {.name = "x_gps", .unit = "m", .meaning = "GPS antenna, x", .scale = 2.0},
      {.name = "y_gps", .unit = "m", .meaning = "GPS antenna, y", .scale = 2.0},
      {.name = "heading", .unit = "rad", .meaning = "measured heading", .is_angle = true, .usual = false},
      {.name = "yaw_rate", .unit = "rad/s", .meaning = "rate of turn, of a gyro", .scale = 0.5, .usual = false},
      {.name = "ground_speed",
       .unit = "m/s",
       .meaning = "speed over ground, of a radar or of GPS",
       .scale = 0.5,
       .usual = false},
  };
  model.roles = {.position_x = 0, .position_y = 1, .heading = 2, .speed = 0, .speed_factor = 0};
  return model;
}

class UnicycleTractionModel : public FormulaModel<UnicycleTraction> {
 public:
  explicit UnicycleTractionModel(const Options& options)
      : FormulaModel(options, describe(), unicycle_traction_kernels()) {}
};

}  // namespace
}  // namespace rhec

RHEC_PLUGIN(rhec::PluginKind::model, rhec::UnicycleTractionModel,
            {.name = "unicycle_traction",
             .version = "1.0.0",
             .licence = "BSD-2-Clause",
             .source = rhec::kSource,
             .capabilities = "tracked robot with traction coefficients of speed and yaw rate; first and second "
                             "derivatives"});
