// The bicycle with side-slip angles as a plugin: names, units and bounds of the variables in bicycle_sideslip.hpp.
#include "bicycle_sideslip.hpp"

#include <numbers>

#include "rhec/core/model/formula_model.hpp"
#include "rhec/plugins/kit/sdk.hpp"

namespace rhec {

const StraightCode& bicycle_sideslip_kernels();  // defined by rhec_add_model

namespace {

constexpr double kDegree = std::numbers::pi / 180.0;
constexpr double kSteeringLimit = 35.0 * kDegree;  // of the angle [rad] and of its rate [rad/s]
constexpr double kSideslipLimit = 15.0 * kDegree;  // [rad]
constexpr const char* kSource =
    "Lenain, Thuilot, Cariou, Martinet, High accuracy path tracking for vehicles in presence of sliding: application "
    "to farm vehicle automatic guidance for agricultural tasks, Autonomous Robots 21(1), 2006";

ModelDescription describe() {
  ModelDescription model;
  model.name = "bicycle_sideslip";
  model.source = kSource;
  model.states = {
      {.name = "x", .unit = "m", .meaning = "rear axle centre, x", .scale = 10.0},
      {.name = "y", .unit = "m", .meaning = "rear axle centre, y", .scale = 10.0},
      {.name = "psi", .unit = "rad", .meaning = "heading", .is_angle = true},
      {.name = "delta",
       .unit = "rad",
       .meaning = "steering angle",
       .lower = -kSteeringLimit,
       .upper = kSteeringLimit,
       .scale = 0.3},
  };
  model.inputs = {
      {.name = "v", .unit = "m/s", .meaning = "speed of the rear axle", .scale = 5.0},
      {.name = "delta_rate",
       .unit = "rad/s",
       .meaning = "steering rate",
       .lower = -kSteeringLimit,
       .upper = kSteeringLimit,
       .scale = 0.3},
  };
  const auto angle = [](const char* name, const char* meaning) {
    return Variable{.name = name,
                    .unit = "rad",
                    .meaning = meaning,
                    .lower = -kSideslipLimit,
                    .upper = kSideslipLimit,
                    .scale = 0.1,
                    .nominal = 0.0};
  };
  model.parameters = {
      angle("beta_front", "side-slip angle of the front axle"),
      angle("beta_rear", "side-slip angle of the rear axle"),
  };
  model.outputs = {
      {.name = "x_gps", .unit = "m", .meaning = "GPS antenna, x", .scale = 10.0},
      {.name = "y_gps", .unit = "m", .meaning = "GPS antenna, y", .scale = 10.0},
      {.name = "delta", .unit = "rad", .meaning = "measured steering angle", .scale = 0.3, .is_angle = true},
      {.name = "heading", .unit = "rad", .meaning = "measured heading", .is_angle = true},
      {.name = "yaw_rate", .unit = "rad/s", .meaning = "rate of turn, of a gyro", .scale = 0.5, .usual = false},
      {.name = "ground_speed",
       .unit = "m/s",
       .meaning = "speed over ground, of a radar or of GPS",
       .scale = 5.0,
       .usual = false},
  };
  model.roles = {.position_x = 0, .position_y = 1, .heading = 2, .speed = 0};
  return model;
}

class BicycleSideslipModel : public FormulaModel<BicycleSideslip> {
 public:
  explicit BicycleSideslipModel(const Options& options)
      : FormulaModel(options, describe(), bicycle_sideslip_kernels()) {}
};

}  // namespace
}  // namespace rhec

RHEC_PLUGIN(rhec::PluginKind::model, rhec::BicycleSideslipModel,
            {.name = "bicycle_sideslip",
             .version = "1.0.0",
             .licence = "BSD-2-Clause",
             .source = rhec::kSource,
             .capabilities = "kinematic bicycle with side-slip angles front and rear; first and second derivatives"});
