#include "rhec/plugins/robot/integration.hpp"

#include <vector>

#include <fmt/format.h>

#include "rhec/core/model/step_requirement.hpp"

namespace rhec {

int substeps_of(std::optional<int> given, const Settings& section, const RobotContext& context,
                std::span<const double> parameters, std::optional<double> ground_speed) {
  const std::vector<OperatingPoint> points = operating_points(*context.model, context.about, parameters, ground_speed);
  const StepRequirement needed = step_requirement(*context.model, points, context.step);
  const int stable = needed.stable_substeps, exact = ground_speed ? needed.substeps : needed.mode_substeps;
  if (given ? stable > 0 && *given >= stable : exact > 0) return given.value_or(exact);

  const Settings* const written = section.find("substeps");
  const std::string state = context.about.states[needed.state].name;
  const std::string cause =
      fmt::format("the model '{}' has a time constant of {:.3g} s, in the state '{}', and an interval is {:g} s (step)",
                  context.about.name, needed.time_constant, state, context.step);
  const std::string remedy = fmt::format(
      "shorten `step`, or leave out of the model what settles so fast: '{}' then has its steady value", state);
  if (given && stable > 0)
    throw(written ? *written : section)
        .error(fmt::format("found {}, with which the integration is unstable: {}; expected at least {}, or auto",
                           *given, cause, exact > 0 ? exact : stable));
  throw(written ? *written : section)
      .error(fmt::format("{}: {} Runge-Kutta steps are not enough; {}", cause, StepRequirement::most_substeps, remedy));
}

}  // namespace rhec
