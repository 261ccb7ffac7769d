#pragma once

#include <memory>
#include <string>
#include <vector>

#include "rhec/core/base/export.hpp"
#include "rhec/core/formula/expression.hpp"
#include "rhec/core/formula/graph.hpp"
#include "rhec/core/formula/tape.hpp"

namespace rhec {

/// A vehicle's formula as nodes of a graph: dx/dt = f(x, u, p) and y = h(x).
struct RHEC_EXPORT VehicleGraph {
  std::shared_ptr<Graph> graph = std::make_shared<Graph>();
  std::vector<int> states, inputs, parameters;  ///< independent variables
  std::vector<Tape::Known> options;             ///< independent variables whose values are known, e.g. lengths
  std::vector<int> rates, outputs;              ///< f and h
};

/// The nodes of results that a formula ("dynamics" or "outputs") has written; throws Error if it left one out.
RHEC_EXPORT std::vector<int> written_nodes(Graph& graph, const std::vector<Expression>& results, const char* function);
/// `count` new independent variables x0, x1, ...
RHEC_EXPORT std::vector<Expression> new_variables(Graph& graph, const char* letter, int count);

/// Records a formula (see FormulaModel) by calling it once with Expression for its number type.
template <class Formula>
VehicleGraph trace(const Formula& formula) {
  VehicleGraph made;
  Graph& graph = *made.graph;
  const auto nodes = [&](const std::vector<Expression>& variables) { return written_nodes(graph, variables, ""); };
  const std::vector<Expression> x = new_variables(graph, "x", Formula::state_count),
                                u = new_variables(graph, "u", Formula::input_count),
                                p = new_variables(graph, "p", Formula::parameter_count);
  std::vector<Expression> rates(Formula::state_count), outputs(Formula::output_count);
  formula.dynamics(x.data(), u.data(), p.data(), rates.data());
  formula.outputs(x.data(), outputs.data());
  made.states = nodes(x);
  made.inputs = nodes(u);
  made.parameters = nodes(p);
  made.rates = written_nodes(graph, rates, "dynamics");
  made.outputs = written_nodes(graph, outputs, "outputs");
  return made;
}

}  // namespace rhec
