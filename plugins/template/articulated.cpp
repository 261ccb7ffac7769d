// A model: names, units, bounds and scales of the variables of the formula in articulated.hpp, and the line that makes
// it a plugin. Try it with: rhec plugins articulated
#include "articulated.hpp"

#include "rhec/core/model/formula_model.hpp"
#include "rhec/plugins/kit/sdk.hpp"

namespace rhec {
const StraightCode& articulated_kernels();  // rhec_add_model(articulated ...) in CMakeLists.txt defines it
}

namespace {

// One entry for each variable of the formula, in the same order. `scale` is a typical magnitude; `lower` and `upper`
// are bounds that a configuration can change; `is_angle`: differences are taken modulo 2 pi. The names are keys of the
// configuration.
rhec::ModelDescription describe() {
  rhec::ModelDescription model;
  model.name = "articulated";
  model.source = "Corke & Ridley, Steering kinematics for a center-articulated mobile robot, 2001";
  model.states = {
      {.name = "x", .unit = "m", .meaning = "front axle, x", .scale = 10.0},
      {.name = "y", .unit = "m", .meaning = "front axle, y", .scale = 10.0},
      {.name = "theta", .unit = "rad", .meaning = "heading of the front unit", .is_angle = true},
      {.name = "gamma", .unit = "rad", .meaning = "articulation angle", .lower = -0.7, .upper = 0.7, .scale = 0.3}};
  model.inputs = {
      {.name = "v", .unit = "m/s", .meaning = "wheel speed", .scale = 2.0},
      {.name = "w", .unit = "rad/s", .meaning = "articulation rate", .lower = -0.4, .upper = 0.4, .scale = 0.2}};
  model.parameters = {
      {.name = "kappa", .unit = "1", .meaning = "ground speed / wheel speed", .lower = 0.0, .upper = 1.2},
      {.name = "mu", .unit = "1", .meaning = "effective / actual articulation angle", .lower = 0.0, .upper = 1.2},
      {.name = "nu", .unit = "1", .meaning = "turning by articulation / without slip", .lower = 0.0, .upper = 1.2}};
  model.outputs = {
      {.name = "x_gps", .unit = "m", .meaning = "GPS antenna, x", .scale = 10.0},
      {.name = "y_gps", .unit = "m", .meaning = "GPS antenna, y", .scale = 10.0},
      {.name = "gamma", .unit = "rad", .meaning = "measured articulation angle", .scale = 0.3, .is_angle = true}};
  // What a path follower needs: the indices of three states, of an input, and of a parameter.
  model.roles = {.position_x = 0, .position_y = 1, .heading = 2, .speed = 0, .speed_factor = 0};
  return model;
}

// The formula's options are those of the plugin: `model: {name: articulated, front: 1.5}`.
class ArticulatedModel : public rhec::FormulaModel<Articulated> {
 public:
  explicit ArticulatedModel(const Options& options) : FormulaModel(options, describe(), rhec::articulated_kernels()) {}
};

}  // namespace

RHEC_PLUGIN(rhec::PluginKind::model, ArticulatedModel,
            {.name = "articulated",
             .version = "1.0.0",
             .licence = "BSD-2-Clause",
             .source = "Corke & Ridley 2001",
             .capabilities = "centre-articulated vehicle with three slips"});
