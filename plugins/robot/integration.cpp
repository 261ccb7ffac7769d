#include "rhec/plugins/robot/integration.hpp"

#include <memory>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "rhec/core/base/error.hpp"
#include "rhec/core/model/implicit_model.hpp"
#include "rhec/core/model/step_requirement.hpp"

namespace rhec {
namespace {

const Settings& place_of(const char* key, const Settings& section) {
  const Settings* const written = section.find(key);
  return written ? *written : section;
}

std::shared_ptr<const RobotContext> implicit(const RobotContext& context, const Settings& section) {
  RobotContext changed = context;
  try {
    changed.model = std::make_shared<const ImplicitModel>(context.model);
  } catch (const Error& mistake) {
    throw place_of("integrator", section).error(mistake.what());
  }
  return std::make_shared<const RobotContext>(std::move(changed));
}

/// Of the model as it is.
int substeps_of(std::optional<int> given, const Settings& section, const RobotContext& context,
                const StepRequirement& needed, int exact) {
  const int stable = needed.stable_substeps;
  if (given ? stable > 0 && *given >= stable : exact > 0) return given.value_or(exact);

  const std::string state = context.about.states[needed.state].name;
  const std::string cause =
      fmt::format("the model '{}' has a time constant of {:.3g} s, in the state '{}', and an interval is {:g} s (step)",
                  context.about.name, needed.time_constant, state, context.step);
  const bool has_implicit = !is_implicit(*context.model) && context.model->graph();
  const Settings& place = place_of("substeps", section);
  if (given && stable > 0)
    throw place.error(fmt::format(
        "found {}, with which the integration is unstable: {}; expected at least {}, or auto{}", *given, cause,
        exact > 0 ? exact : stable, has_implicit ? ", or integrator: implicit, which has no such limit" : ""));
  throw place.error(fmt::format(
      "{}: {} {} steps are not enough; {}shorten `step`, or leave out of the model what settles so fast: '{}' then has "
      "its steady value",
      cause, StepRequirement::most_substeps, is_implicit(*context.model) ? "implicit" : "Runge-Kutta",
      has_implicit ? "take integrator: implicit, whose steps need not be short against it, " : "", state));
}

}  // namespace

std::vector<std::pair<std::string, Integrator>> integrator_choices() {
  return {{"explicit", Integrator::runge_kutta}, {"implicit", Integrator::radau}, {"auto", Integrator::automatic}};
}

Integration integration_of(Integrator integrator, std::optional<int> given, const Settings& section,
                           std::shared_ptr<const RobotContext> context, std::span<const double> parameters,
                           std::optional<double> ground_speed) {
  const auto exact_of = [&](const StepRequirement& needed) {
    return ground_speed ? needed.substeps : needed.mode_substeps;
  };
  const auto requirement = [&] {
    return step_requirement(*context->model,
                            operating_points(*context->model, context->about, parameters, ground_speed), context->step);
  };
  if (integrator == Integrator::radau) context = implicit(*context, section);
  StepRequirement needed = requirement();
  if (integrator == Integrator::automatic && context->model->graph()) {
    const int exact = exact_of(needed);
    if (exact == 0 || exact > most_explicit_substeps) {
      context = implicit(*context, section);
      needed = requirement();
    }
  }
  const int substeps = substeps_of(given, section, *context, needed, exact_of(needed));
  return {std::move(context), substeps};
}

}  // namespace rhec
