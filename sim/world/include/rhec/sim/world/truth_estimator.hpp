#pragma once

#include "rhec/plugins/robot/estimator_makers.hpp"
#include "rhec/sim/world/truth.hpp"

namespace rhec::sim {

/// The estimators that a scenario can name: those of every robot, and `truth`, which returns the true state and
/// parameters of `vehicle`. The vehicle must outlive the estimators; without one, as in log replay, constructing
/// `truth` throws Error.
RHEC_EXPORT EstimatorMakers scenario_estimators(const TruthVehicle* vehicle = nullptr);

}  // namespace rhec::sim
