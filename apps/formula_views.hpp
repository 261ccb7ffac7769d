#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "rhec/core/model/model.hpp"
#include "rhec/core/model/vehicle_graph.hpp"
#include "rhec/sim/check/formula_trace.hpp"

// What commands show of a model's formula.
namespace rhec::apps {

/// `--graph` or `--graph FILE.svg`, where it is given.
using GraphFile = std::optional<std::string>;

/// Sets variables of a point: "v=0.5". Throws Error for what is no variable of the model or no number.
void apply_values(const std::vector<std::string>& assignments, const ModelDescription& about, sim::FormulaPoint& point);

/// Prints every node of the formula at a point, and what is not finite. Returns an exit code. Throws Error if the model
/// has no graph.
int show_trace(const Model& model, const sim::FormulaPoint& point, bool json);
/// The same of any formula; `what` says what its results are ("f and h").
int show_trace(const VehicleGraph& formula, const ModelDescription& about, const sim::FormulaPoint& point,
               std::string_view what, bool json);

/// Prints operations, depth and sparsity; writes the drawing if a file is named. Throws Error if the model has no graph
/// or the file does not end in .svg.
int show_graph(const Model& model, const std::string& file, bool json);

}  // namespace rhec::apps
