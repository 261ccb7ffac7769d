#include "skid_steer.hpp"

#include "rhec/core/formula_model.hpp"
#include "rhec/plugins/sdk.hpp"

namespace rhec {
WideKernels skid_steer_wide_kernels();  // defined by rhec_add_model
}

namespace {

struct SkidSteerOptions {
  double antenna = 0.3;

  static const rhec::OptionTable<SkidSteerOptions>& table() {
    static const auto rows = rhec::OptionTable<SkidSteerOptions>().number(
        "antenna", &SkidSteerOptions::antenna, "how far the GPS antenna is before the centre [m]");
    return rows;
  }
};

rhec::ModelDescription describe() {
  rhec::ModelDescription model;
  model.name = "skid_steer";
  model.states = {{.name = "x", .unit = "m", .meaning = "centre, x", .scale = 10.0},
                  {.name = "y", .unit = "m", .meaning = "centre, y", .scale = 10.0},
                  {.name = "beta", .unit = "rad", .meaning = "heading", .is_angle = true}};
  model.inputs = {{.name = "v", .unit = "m/s", .meaning = "speed of the wheels"},
                  {.name = "w", .unit = "rad/s", .meaning = "yaw rate of the wheels", .lower = -1.0, .upper = 1.0}};
  model.parameters = {
      {.name = "kappa", .unit = "1", .meaning = "ground speed / wheel speed", .lower = 0.0, .upper = 1.2},
      {.name = "mu", .unit = "1", .meaning = "yaw rate / that of the wheels", .lower = 0.0, .upper = 1.2}};
  model.outputs = {{.name = "x_gps", .unit = "m", .meaning = "antenna, x", .scale = 10.0},
                   {.name = "y_gps", .unit = "m", .meaning = "antenna, y", .scale = 10.0}};
  model.roles = {.position_x = 0, .position_y = 1, .heading = 2, .speed = 0, .speed_factor = 0};
  return model;
}

class SkidSteerModel : public rhec::FormulaModel<SkidSteer> {
 public:
  using Options = SkidSteerOptions;
  explicit SkidSteerModel(const Options& options)
      : FormulaModel({.antenna = options.antenna}, describe(), rhec::skid_steer_wide_kernels()) {}
};

}  // namespace

RHEC_PLUGIN(rhec::PluginKind::model, SkidSteerModel,
            {.name = "skid_steer", .version = "1.0.0", .licence = "BSD-2-Clause"});
