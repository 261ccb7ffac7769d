#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "rhec/core/base/export.hpp"
#include "rhec/core/config/settings.hpp"
#include "rhec/plugins/robot/robot_context.hpp"

namespace rhec {

/// The keys `integrator` of the sections `estimator` and `controller`.
enum class Integrator {
  runge_kutta,  ///< explicit: classical Runge-Kutta steps
  radau,        ///< implicit: ImplicitModel
  automatic     ///< implicit where explicit steps would cost more
};
RHEC_EXPORT std::vector<std::pair<std::string, Integrator>> integrator_choices();
inline constexpr const char* integrator_meaning =
    "explicit: classical Runge-Kutta steps; implicit: steps of Radau IIA, for models with time constants far below an "
    "interval; auto: implicit where it takes less time";

/// `auto` takes implicit steps where more explicit ones than that are needed. Measured, one implicit step takes the
/// time of 22 explicit ones without derivatives, of 5 with a Jacobian, and of less than 2 with a Hessian; a solver asks
/// for all of these (docs/method.md, section 1).
inline constexpr int most_explicit_substeps = 8;

/// How a section integrates.
struct Integration {
  std::shared_ptr<const RobotContext> context;  ///< the given one; with implicit steps, its model is an ImplicitModel
  int substeps = 1;
};

/// The steps in which the model is integrated over `context.step`: `given`, or without it the fewest that are stable
/// and follow the modes at the points that a vehicle with these parameters is likely to pass (`operating_points`); if
/// the `ground_speed` [m/s] is known, those that follow the motion as well. Throws Error at the key `substeps` of
/// `section`, with the state and its time constant, if the steps given are unstable, or if no number of steps will do;
/// at the key `integrator` if the model has no implicit steps.
RHEC_EXPORT Integration integration_of(Integrator integrator, std::optional<int> given, const Settings& section,
                                       std::shared_ptr<const RobotContext> context, std::span<const double> parameters,
                                       std::optional<double> ground_speed = {});

}  // namespace rhec
