#pragma once

#include <optional>
#include <span>

#include "rhec/core/base/export.hpp"
#include "rhec/core/config/settings.hpp"
#include "rhec/plugins/robot/robot_context.hpp"

namespace rhec {

/// The Runge-Kutta steps in which the model is integrated over `context.step`: `given`, or without it the fewest that
/// are stable and follow the modes at the points that a vehicle with these parameters is likely to pass
/// (`operating_points`); if the `ground_speed` [m/s] is known, those that follow the motion as well. Throws Error at
/// the key `substeps` of `section`, with the state and its time constant, if the steps given are unstable, or if no
/// number of steps will do.
RHEC_EXPORT int substeps_of(std::optional<int> given, const Settings& section, const RobotContext& context,
                            std::span<const double> parameters, std::optional<double> ground_speed = {});

}  // namespace rhec
