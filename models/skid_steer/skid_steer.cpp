// The skid-steered vehicle as a plugin: names, units and bounds of the variables in skid_steer.hpp.
#include "skid_steer.hpp"

#include "rhec/core/model/formula_model.hpp"
#include "rhec/plugins/kit/sdk.hpp"

namespace rhec {

const StraightCode& skid_steer_kernels();  // defined by rhec_add_model

namespace {

constexpr const char* kSource =
    "Yi, Wang, Zhang, Song, Jayasuriya, Liu, Kinematic modeling and analysis of skid-steered mobile robots with "
    "applications to low-cost inertial-measurement-unit-based motion estimation, IEEE Transactions on Robotics 25(5), "
    "2009";

ModelDescription describe() {
  ModelDescription model;
  model.name = "skid_steer";
  model.source = kSource;
  model.states = {
      {.name = "x", .unit = "m", .meaning = "centre, x", .scale = 5.0},
      {.name = "y", .unit = "m", .meaning = "centre, y", .scale = 5.0},
      {.name = "psi", .unit = "rad", .meaning = "heading", .is_angle = true},
  };
  model.inputs = {
      {.name = "omega_left", .unit = "rad/s", .meaning = "wheels of the left side", .scale = 10.0},
      {.name = "omega_right", .unit = "rad/s", .meaning = "wheels of the right side", .scale = 10.0},
  };
  const auto slip = [](const char* name, const char* meaning) {
    return Variable{
        .name = name, .unit = "1", .meaning = meaning, .lower = -0.2, .upper = 0.8, .scale = 0.3, .nominal = 0.0};
  };
  model.parameters = {
      slip("lambda_left", "slip ratio of the left side: 1 - ground speed / wheel speed"),
      slip("lambda_right", "slip ratio of the right side"),
      {.name = "icr_offset",
       .unit = "m",
       .meaning = "how far the instantaneous centre of rotation is before the centre",
       .lower = -0.4,
       .upper = 0.4,
       .scale = 0.2,
       .nominal = 0.0},
  };
  model.outputs = {
      {.name = "x_gps", .unit = "m", .meaning = "GPS antenna, x", .scale = 5.0},
      {.name = "y_gps", .unit = "m", .meaning = "GPS antenna, y", .scale = 5.0},
      {.name = "heading", .unit = "rad", .meaning = "measured heading", .is_angle = true},
      {.name = "yaw_rate", .unit = "rad/s", .meaning = "rate of turn, of a gyro", .scale = 1.0, .usual = false},
      {.name = "ground_speed",
       .unit = "m/s",
       .meaning = "speed over ground, of a radar or of GPS",
       .scale = 1.0,
       .usual = false},
  };
  model.roles = {.position_x = 0, .position_y = 1, .heading = 2};
  return model;
}

class SkidSteerModel : public FormulaModel<SkidSteer> {
 public:
  explicit SkidSteerModel(const Options& options) : FormulaModel(options, describe(), skid_steer_kernels()) {}
};

}  // namespace
}  // namespace rhec

RHEC_PLUGIN(
    rhec::PluginKind::model, rhec::SkidSteerModel,
    {.name = "skid_steer",
     .version = "1.0.0",
     .licence = "BSD-2-Clause",
     .source = rhec::kSource,
     .capabilities = "skid-steered vehicle with longitudinal slip of each side and a shifted centre of rotation; "
                     "first and second derivatives"});
