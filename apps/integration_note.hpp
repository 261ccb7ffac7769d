#pragma once

#include <string_view>

#include "rhec/core/estimation/estimator.hpp"
#include "rhec/plugins/robot/robot.hpp"

namespace rhec::apps {

/// Prints a line if Runge-Kutta steps of the robot's estimator were too coarse for what the vehicle did; else nothing.
/// `prefix` says which estimator it is.
void print_integration(const Estimator::Counts& counts, const Robot& robot, std::string_view prefix = "");

}  // namespace rhec::apps
