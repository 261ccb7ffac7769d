#pragma once

#include <optional>
#include <string>
#include <vector>

#include "rhec/core/base/export.hpp"
#include "rhec/core/model/model.hpp"
#include "rhec/core/model/vehicle_graph.hpp"

/// A formula node by node at a point, to find where a number stops being finite.
namespace rhec::sim {

struct FormulaPoint {
  std::vector<double> states, inputs, parameters;
};

/// Straight motion at a ground speed [m/s], by default one at which the inputs have their typical magnitude: the
/// vehicle in line at the origin, nothing slips, all else 0 or as close to 0 as the bounds of `within` allow.
RHEC_EXPORT FormulaPoint straight_point(Model& model, const ModelDescription& within, std::optional<double> speed = {});

/// One node: a variable, a constant, or an operation.
struct TracedNode {
  int node = -1;       ///< its number; operands have smaller ones
  std::string name;    ///< e.g. "kappa", "speed", "beta'", "d beta' / d delta"; empty if it has none
  std::string term;    ///< "state", "constant", "kappa * u1", "sqrt(n4)"
  double value = 0.0;  ///< at the point
};

/// The first node that is not finite, whose operands are.
struct NotFinite {
  TracedNode node;
  std::vector<TracedNode> operands;
  std::string why;                   ///< e.g. "the square root of a negative number"
  std::string advice;                ///< what to do; may be empty
  std::vector<std::string> results;  ///< which results are not finite because of it or of others: "beta'"
};

/// A part of what is computed: the values, the Jacobian or the Hessian. Only nodes that no earlier part has.
struct TracedPart {
  std::string name;  ///< "values", "jacobian", "hessian"
  std::vector<TracedNode> nodes;
  int results = 0;  ///< how many there are that are not always zero
  std::optional<NotFinite> first;
};

struct RHEC_EXPORT FormulaTrace {
  std::string model;
  std::vector<TracedPart> parts;
  bool is_finite() const;
};

/// All nodes of f and h, of their Jacobian by [x; p; u], and of the Hessian of their sum, at a point. `about` describes
/// the same variables. Without rates, as of a term, the outputs may depend on all of [x; p; u].
RHEC_EXPORT FormulaTrace trace_formula(const VehicleGraph& vehicle, const ModelDescription& about,
                                       const FormulaPoint& at);

/// As a JSON object, with the point; numbers that are not finite become null, and "finite" is false there.
RHEC_EXPORT std::string trace_json(const FormulaTrace& trace, const ModelDescription& about, const FormulaPoint& at);

}  // namespace rhec::sim
