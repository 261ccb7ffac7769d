// The bicycle with side-slip angles as a plugin: names, units and bounds of the variables in bicycle_sideslip.hpp.
#include "bicycle_sideslip.hpp"

#include <numbers>

#include "rhec/core/model/formula_model.hpp"
#include "rhec/plugins/kit/sdk.hpp"

namespace rhec {

ModelKernelSets bicycle_sideslip_kernels();  // defined by rhec_add_model

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
  };
  model.roles = {.position_x = 0, .position_y = 1, .heading = 2, .speed = 0};
  return model;
}

struct BicycleSideslipOptions : BicycleSideslip {
  static const OptionTable<BicycleSideslipOptions>& table() {
    using Options = BicycleSideslipOptions;
    static const auto options =
        OptionTable<Options>()
            .number("wheelbase", &Options::wheelbase, "distance of the axles [m]", greater_than(0.0))
            .number("antenna_x", &Options::antenna_x,
                    "how far the GPS antenna is before the rear axle [m]; negative: behind it")
            .number("antenna_y", &Options::antenna_y, "how far it is to the left [m]; negative: to the right");
    return options;
  }
};

class BicycleSideslipModel : public FormulaModel<BicycleSideslip> {
 public:
  using Options = BicycleSideslipOptions;
  explicit BicycleSideslipModel(const Options& options)
      : FormulaModel(static_cast<const BicycleSideslip&>(options), describe(), bicycle_sideslip_kernels()) {}
};

}  // namespace
}  // namespace rhec

RHEC_PLUGIN(rhec::PluginKind::model, rhec::BicycleSideslipModel,
            {.name = "bicycle_sideslip",
             .version = "1.0.0",
             .licence = "BSD-2-Clause",
             .source = rhec::kSource,
             .capabilities = "kinematic bicycle with side-slip angles front and rear; first and second derivatives"});
