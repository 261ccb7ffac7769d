#pragma once

#include <memory>

#include "rhec/core/base/export.hpp"
#include "rhec/plugins/robot/robot_context.hpp"

namespace rhec {

/// The context for estimation: where `noise.states` gives process noise, the model is a StateNoiseModel, whose noises
/// are inputs of known standard deviation; else the context itself.
RHEC_EXPORT std::shared_ptr<const RobotContext> with_state_noise(std::shared_ptr<const RobotContext> context);

}  // namespace rhec
