#pragma once

#include "rhec/plugins/robot/estimator_makers.hpp"
#include "rhec/sim/world/truth.hpp"

namespace rhec::sim {

/// The estimators that a scenario can name: those of every robot, and `truth`, which knows what `vehicle` is and does.
/// The vehicle must outlive what is made; without one, as in the replay of a log, the making of `truth` throws Error.
RHEC_EXPORT EstimatorMakers scenario_estimators(const TruthVehicle* vehicle = nullptr);

}  // namespace rhec::sim
