// What the Runge-Kutta method needs to follow a model over an interval.
#include <cmath>

#include <fmt/format.h>

#include "model_checks.hpp"
#include "rhec/core/model/implicit_model.hpp"

namespace rhec::sim {

StepRequirement required_steps(const CheckedModel& checked) {
  std::vector<double> parameters;
  for (const Variable& parameter : checked.about.parameters) parameters.push_back(middle_value(parameter));
  const auto points = operating_points(checked.model, checked.about, parameters, checked.options.speed);
  return step_requirement(checked.model, points, checked.options.interval);
}

std::vector<Finding> check_integration(const CheckedModel& checked, const StepRequirement& needed) {
  FindingList findings("integration");
  const double interval = checked.options.interval;
  const std::string state = needed.state >= 0 ? checked.about.states[needed.state].name : "";
  const FindingList::Numbers numbers = {{"substeps", needed.substeps},
                                        {"stable_substeps", needed.stable_substeps},
                                        {"time_constant", needed.time_constant}};
  const std::string cause =
      std::isfinite(needed.time_constant)
          ? fmt::format("; its shortest time constant is {:.3g} s, in the state '{}'", needed.time_constant, state)
          : "";
  const bool implicit = is_implicit(checked.model);
  const char* const kind = implicit ? "implicit" : "Runge-Kutta";
  const std::string remedy =
      implicit || !checked.model.graph() ? "" : "give integrator: implicit, whose steps need not be short against it, ";
  if (needed.substeps == 0)
    findings.fail(
        state,
        fmt::format("{} {} steps do not follow an interval of {:g} s{}", StepRequirement::most_substeps, kind, interval,
                    cause),
        remedy + "shorten the interval, or leave out of the model what settles so fast: it then has its steady value",
        numbers);
  else if (checked.options.substeps && *checked.options.substeps < needed.substeps)
    findings.warn(state,
                  fmt::format("{} {} steps in an interval of {:g} s are inexact{}", *checked.options.substeps, kind,
                              interval, cause),
                  fmt::format("give substeps: {}, or auto", needed.substeps), numbers);
  else if (needed.substeps > costly_substeps)
    findings.warn(
        state, fmt::format("an interval of {:g} s takes {} {} steps{}", interval, needed.substeps, kind, cause),
        std::string("what settles within a small part of an interval costs most of the time and tells little: ") +
            remedy + "consider a shorter interval, or a model in which it has its steady value",
        numbers);
  else
    findings.pass(fmt::format("an interval of {:g} s takes {} {} step{}{}", interval, needed.substeps, kind,
                              needed.substeps == 1 ? "" : "s", cause),
                  numbers, state);
  return findings.take();
}

}  // namespace rhec::sim
