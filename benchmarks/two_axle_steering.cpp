// A model for the benchmark of other vehicles: it measures a step with sizes for which no kernels are compiled.
#include "two_axle_steering.hpp"

#include "rhec/core/model/formula_model.hpp"
#include "rhec/plugins/kit/sdk.hpp"

namespace rhec {
const StraightCode& two_axle_steering_kernels();  // defined by rhec_add_model_kernels
}

namespace {

rhec::ModelDescription describe() {
  rhec::ModelDescription model;
  model.name = "two_axle_steering";
  model.states = {{.name = "x", .unit = "m", .meaning = "rear axle, x", .scale = 10.0},
                  {.name = "y", .unit = "m", .meaning = "rear axle, y", .scale = 10.0},
                  {.name = "theta", .unit = "rad", .meaning = "heading", .is_angle = true},
                  {.name = "front", .unit = "rad", .meaning = "front steering angle", .lower = -0.5, .upper = 0.5},
                  {.name = "rear", .unit = "rad", .meaning = "rear steering angle", .lower = -0.5, .upper = 0.5}};
  model.inputs = {{.name = "v", .unit = "m/s", .meaning = "wheel speed", .scale = 2.0},
                  {.name = "front_rate", .unit = "rad/s", .meaning = "its rate", .lower = -0.4, .upper = 0.4},
                  {.name = "rear_rate", .unit = "rad/s", .meaning = "its rate", .lower = -0.4, .upper = 0.4}};
  model.parameters = {
      {.name = "kappa", .unit = "1", .meaning = "ground speed / wheel speed", .lower = 0.0, .upper = 1.2},
      {.name = "mu", .unit = "1", .meaning = "effective / actual steering angles", .lower = 0.0, .upper = 1.2}};
  model.outputs = {{.name = "x_gps", .unit = "m", .meaning = "x", .scale = 10.0},
                   {.name = "y_gps", .unit = "m", .meaning = "y", .scale = 10.0},
                   {.name = "front", .unit = "rad", .meaning = "measured front angle", .is_angle = true},
                   {.name = "rear", .unit = "rad", .meaning = "measured rear angle", .is_angle = true}};
  model.roles = {.position_x = 0, .position_y = 1, .heading = 2, .speed = 0, .speed_factor = 0};
  return model;
}

class TwoAxleSteeringModel : public rhec::FormulaModel<TwoAxleSteering> {
 public:
  explicit TwoAxleSteeringModel(const Options& options)
      : FormulaModel(options, describe(), rhec::two_axle_steering_kernels()) {}
};

}  // namespace

RHEC_PLUGIN(rhec::PluginKind::model, TwoAxleSteeringModel,
            {.name = "two_axle_steering",
             .version = "1.0.0",
             .licence = "BSD-2-Clause",
             .source = "kinematics of two steered axles",
             .capabilities = "vehicle with three inputs, for benchmarks"});
