// The bicycle with slip as a plugin: names, units and bounds of the variables in bicycle_slip.hpp.
#include "bicycle_slip.hpp"

#include <numbers>

#include "rhec/core/model/formula_model.hpp"
#include "rhec/plugins/kit/sdk.hpp"

namespace rhec {

const StraightCode& bicycle_slip_kernels();  // defined by rhec_add_model

namespace {

constexpr double kSteeringLimit = 35.0 * std::numbers::pi / 180.0;  // of the angle [rad] and of its rate [rad/s]
constexpr const char* kSource =
    "Kraus et al., Moving horizon estimation and nonlinear model predictive control for autonomous agricultural "
    "vehicles, 2013; Wallace et al., Receding horizon estimation and control with structured noise blocking for mobile "
    "robot slip compensation";

ModelDescription describe() {
  ModelDescription model;
  model.name = "bicycle_slip";
  model.source = kSource;
  model.states = {
      {.name = "x_pos", .unit = "m", .meaning = "rear axle centre, x", .scale = 10.0},
      {.name = "y_pos", .unit = "m", .meaning = "rear axle centre, y", .scale = 10.0},
      {.name = "beta", .unit = "rad", .meaning = "heading", .is_angle = true},
      {.name = "delta",
       .unit = "rad",
       .meaning = "steering angle",
       .lower = -kSteeringLimit,
       .upper = kSteeringLimit,
       .scale = 0.3},
  };
  model.inputs = {
      {.name = "u1", .unit = "m/s", .meaning = "wheel speed", .scale = 5.0},
      {.name = "u2",
       .unit = "rad/s",
       .meaning = "steering rate",
       .lower = -kSteeringLimit,
       .upper = kSteeringLimit,
       .scale = 0.3},
  };
  model.parameters = {
      {.name = "kappa",
       .unit = "1",
       .meaning = "longitudinal slip: ground speed / wheel speed",
       .lower = 0.0,
       .upper = 1.0,
       .scale = 0.5},
      {.name = "mu",
       .unit = "1",
       .meaning = "side slip: effective / actual steering angle",
       .lower = 0.0,
       .upper = 1.0,
       .scale = 0.5},
  };
  model.outputs = {
      {.name = "x_gps", .unit = "m", .meaning = "GPS antenna, x", .scale = 10.0},
      {.name = "y_gps", .unit = "m", .meaning = "GPS antenna, y", .scale = 10.0},
      {.name = "delta", .unit = "rad", .meaning = "measured steering angle", .scale = 0.3, .is_angle = true},
      {.name = "heading", .unit = "rad", .meaning = "measured heading", .is_angle = true, .usual = false},
      {.name = "yaw_rate", .unit = "rad/s", .meaning = "rate of turn, of a gyro", .scale = 0.5, .usual = false},
      {.name = "ground_speed",
       .unit = "m/s",
       .meaning = "speed over ground, of a radar or of GPS",
       .scale = 5.0,
       .usual = false},
  };
  model.roles = {.position_x = 0, .position_y = 1, .heading = 2, .speed = 0, .speed_factor = 0};
  return model;
}

class BicycleSlipModel : public FormulaModel<BicycleSlip> {
 public:
  explicit BicycleSlipModel(const Options& options) : FormulaModel(options, describe(), bicycle_slip_kernels()) {}
};

}  // namespace
}  // namespace rhec

RHEC_PLUGIN(rhec::PluginKind::model, rhec::BicycleSlipModel,
            {.name = "bicycle_slip",
             .version = "1.0.0",
             .licence = "BSD-2-Clause",
             .source = rhec::kSource,
             .capabilities = "kinematic bicycle with longitudinal and side slip; first and second derivatives"});
