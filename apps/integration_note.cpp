#include "integration_note.hpp"

#include <cstddef>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "rhec/core/model/motion_outputs.hpp"

namespace rhec::apps {
namespace {

/// Of a state of the estimator: of the vehicle, an error of a sensor, or what a sensor of motion sees.
std::string state_name(const Robot& robot, int state) {
  if (state < 0) return {};
  auto at = static_cast<std::size_t>(state);
  const std::vector<Variable>& states = robot.estimated_description().states;
  if (at < states.size()) return states[at].name;
  at -= states.size();
  const std::vector<int> of_motion = outputs_of_motion(*robot.model());
  if (at >= of_motion.size()) return {};
  return robot.model()->description().outputs[static_cast<std::size_t>(of_motion[at])].name;
}

}  // namespace

void print_integration(const Estimator::Counts& counts, const Robot& robot, std::string_view prefix) {
  if (counts.coarse == 0) return;
  fmt::print(
      "{}in {} of {} intervals looked at, the integration was too coarse, most in '{}': give estimator.substeps and "
      "controller.substeps a larger number\n",
      prefix, counts.coarse, counts.integrated, state_name(robot, counts.coarse_state));
}

}  // namespace rhec::apps
