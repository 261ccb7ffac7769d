#pragma once

#include <span>

#include "rhec/core/base/export.hpp"
#include "rhec/core/model/vehicle_graph.hpp"

namespace rhec {

/// The formula alone in a graph of its own, without the derivatives that may have been made of it: variables and
/// options in their order, and what rates and outputs are computed of.
RHEC_EXPORT VehicleGraph formula_copy(const VehicleGraph& vehicle);

/// The same with some of its outputs.
RHEC_EXPORT VehicleGraph formula_copy(const VehicleGraph& vehicle, std::span<const int> chosen_outputs);

/// Its straight motion alone, with the same variables and options. `vehicle.straight` has to be set.
RHEC_EXPORT VehicleGraph motion_copy(const VehicleGraph& vehicle);

}  // namespace rhec
