// The tractor with a trailer as a plugin: names, units and bounds of the variables in tractor_trailer.hpp.
#include "tractor_trailer.hpp"

#include <numbers>

#include "rhec/core/model/formula_model.hpp"
#include "rhec/plugins/kit/sdk.hpp"

namespace rhec {

const StraightCode& tractor_trailer_kernels();  // defined by rhec_add_model

namespace {

constexpr double kSteeringLimit = 35.0 * std::numbers::pi / 180.0;  // of the angle [rad] and of its rate [rad/s]
constexpr const char* kSource =
    "Kayacan, Kayacan, Ramon, Saeys, Learning in centralized nonlinear model predictive control: application to an "
    "autonomous tractor-trailer system, IEEE Transactions on Control Systems Technology 23(1), 2015; the same, "
    "Distributed nonlinear model predictive control of an autonomous tractor-trailer system, Mechatronics 24(8), 2014";

ModelDescription describe() {
  ModelDescription model;
  model.name = "tractor_trailer";
  model.source = kSource;
  model.states = {
      {.name = "x_trailer", .unit = "m", .meaning = "trailer's axle, x", .scale = 10.0},
      {.name = "y_trailer", .unit = "m", .meaning = "trailer's axle, y", .scale = 10.0},
      {.name = "psi_trailer", .unit = "rad", .meaning = "heading of the trailer", .is_angle = true},
      {.name = "psi_tractor", .unit = "rad", .meaning = "heading of the tractor", .is_angle = true},
      {.name = "delta",
       .unit = "rad",
       .meaning = "steering angle",
       .lower = -kSteeringLimit,
       .upper = kSteeringLimit,
       .scale = 0.3},
  };
  model.inputs = {
      {.name = "v", .unit = "m/s", .meaning = "speed of the tractor's rear wheels", .scale = 2.0},
      {.name = "delta_rate",
       .unit = "rad/s",
       .meaning = "steering rate",
       .lower = -kSteeringLimit,
       .upper = kSteeringLimit,
       .scale = 0.3},
  };
  const auto factor = [](const char* name, const char* meaning) {
    return Variable{.name = name, .unit = "1", .meaning = meaning, .lower = 0.25, .upper = 1.0, .scale = 0.5};
  };
  model.parameters = {
      factor("mu", "longitudinal slip: ground speed / wheel speed"),
      factor("kappa", "side slip of the tractor: effective / actual steering angle"),
      factor("eta", "side slip of the trailer: effective / actual articulation"),
  };
  model.outputs = {
      {.name = "x_trailer_gps", .unit = "m", .meaning = "antenna on the trailer, x", .scale = 10.0},
      {.name = "y_trailer_gps", .unit = "m", .meaning = "antenna on the trailer, y", .scale = 10.0},
      {.name = "x_tractor_gps", .unit = "m", .meaning = "antenna on the tractor, x", .scale = 10.0},
      {.name = "y_tractor_gps", .unit = "m", .meaning = "antenna on the tractor, y", .scale = 10.0},
      {.name = "delta", .unit = "rad", .meaning = "measured steering angle", .scale = 0.3, .is_angle = true},
      {.name = "articulation", .unit = "rad", .meaning = "measured articulation", .scale = 0.3, .is_angle = true},
      {.name = "trailer_heading",
       .unit = "rad",
       .meaning = "measured heading of the trailer",
       .is_angle = true,
       .usual = false},
      {.name = "tractor_heading",
       .unit = "rad",
       .meaning = "measured heading of the tractor",
       .is_angle = true,
       .usual = false},
      {.name = "tractor_yaw_rate",
       .unit = "rad/s",
       .meaning = "rate of turn of the tractor, of a gyro",
       .scale = 0.5,
       .usual = false},
      {.name = "trailer_yaw_rate",
       .unit = "rad/s",
       .meaning = "rate of turn of the trailer, of a gyro",
       .scale = 0.5,
       .usual = false},
      {.name = "ground_speed",
       .unit = "m/s",
       .meaning = "speed over ground, of a radar or of GPS",
       .scale = 5.0,
       .usual = false},
  };
  model.roles = {.position_x = 0, .position_y = 1, .heading = 2, .speed = 0, .speed_factor = 0, .other_headings = {3}};
  return model;
}

class TractorTrailerModel : public FormulaModel<TractorTrailer> {
 public:
  explicit TractorTrailerModel(const Options& options) : FormulaModel(options, describe(), tractor_trailer_kernels()) {}
};

}  // namespace
}  // namespace rhec

RHEC_PLUGIN(rhec::PluginKind::model, rhec::TractorTrailerModel,
            {.name = "tractor_trailer",
             .version = "1.0.0",
             .licence = "BSD-2-Clause",
             .source = rhec::kSource,
             .capabilities = "tractor with a passive trailer, slip of both; the trailer follows the path; first and "
                             "second derivatives"});
