#pragma once

#include <string>

#include "rhec/core/base/export.hpp"
#include "rhec/core/model/model.hpp"
#include "rhec/core/model/vehicle_graph.hpp"
#include "rhec/sim/check/formula_size.hpp"

namespace rhec::sim {

/// A formula as a drawing, an SVG document: variables on the left, operations in columns, rates and outputs on the
/// right; below it which derivatives are not always zero. Throws Error if it has more than `most_drawn` operations.
RHEC_EXPORT std::string formula_drawing(const VehicleGraph& vehicle, const ModelDescription& about,
                                        const FormulaSize& size);
inline constexpr int most_drawn = 1500;

}  // namespace rhec::sim
