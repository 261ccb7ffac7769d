#pragma once

#include <memory>
#include <vector>

#include "rhec/core/base/export.hpp"
#include "rhec/core/estimation/scaled_output.hpp"
#include "rhec/plugins/robot/robot_context.hpp"

namespace rhec {

/// The context for estimation: where `noise.biases` or `noise.scales` give errors of sensors, or where outputs depend
/// on the input or on slip, the model is a SensorModel, with the errors' drift as noise of its states; else the context
/// itself. `with_state_noise` comes after it.
RHEC_EXPORT std::shared_ptr<const RobotContext> with_sensors(std::shared_ptr<const RobotContext> context);

/// The states that results have: the vehicle's, biases and scale errors. It is the description of the context before
/// `with_sensors` with these.
RHEC_EXPORT ModelDescription with_sensor_errors(const RobotContext& context);

/// Standard deviations at the start of the states that `with_sensors` has added behind the vehicle's.
RHEC_EXPORT std::vector<double> initial_sensor_sigmas(const RobotContext& vehicle, const RobotContext& with_sensors);

/// Whether a model of `with_sensors`, with or without process noise, has outputs of motion.
RHEC_EXPORT bool senses_motion(const Model& model) noexcept;
/// The outputs of motion of such a model, ascending, by which a filter linearises an interval (KalmanFilter::predict).
RHEC_EXPORT std::vector<int> sensed_motion(const Model& model);
/// The other outputs of such a model that have a scale error, ascending.
RHEC_EXPORT std::vector<ScaledOutput> scaled_outputs(const Model& model);

}  // namespace rhec
