#pragma once

#include <memory>
#include <optional>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "rhec/core/base/export.hpp"
#include "rhec/core/formula/expression.hpp"
#include "rhec/core/formula/graph.hpp"
#include "rhec/core/formula/tape.hpp"
#include "rhec/core/model/formula_options.hpp"

namespace rhec {

/// Straight motion as nodes of a vehicle's graph: functions of `ground_speed` [m/s] and the parameters.
struct StraightMotion {
  int ground_speed = -1;
  std::vector<int> states;  ///< by state: what it becomes; -1 if it stays as it is
  std::vector<int> inputs;  ///< by input
};

/// A vehicle's formula as nodes of a graph: dx/dt = f(x, u, p) and y = h(x, u, p).
struct RHEC_EXPORT VehicleGraph {
  std::shared_ptr<Graph> graph = std::make_shared<Graph>();
  std::vector<int> states, inputs, parameters;  ///< independent variables
  std::vector<Tape::Known> options;             ///< independent variables whose values are known, e.g. lengths
  std::vector<int> rates, outputs;              ///< f and h
  std::optional<StraightMotion> straight;       ///< where a vehicle says itself what drives it straight ahead
};

/// Numbers of variables of a formula.
struct FormulaCounts {
  int states, inputs, parameters, outputs;
};
/// Those of a formula whose options decide them (`FormulaCounts counts() const`), or its constants.
template <class Formula>
FormulaCounts counts_of(const Formula& formula) {
  if constexpr (requires { formula.counts(); })
    return formula.counts();
  else
    return {.states = Formula::state_count,
            .inputs = Formula::input_count,
            .parameters = Formula::parameter_count,
            .outputs = Formula::output_count};
}

/// Room for results of a formula, with more behind them, so that one that writes too many is found out.
RHEC_EXPORT std::vector<Expression> room_for_results(int count);
/// The nodes of the `count` results that a formula ("dynamics" or "outputs") has written; throws Error if it left one
/// out, or wrote one too many.
RHEC_EXPORT std::vector<int> written_nodes(Graph& graph, const std::vector<Expression>& results, int count,
                                           const char* function);
/// The nodes of straight motion; a state may be left out. Throws Error as `written_nodes` does, of "straight_motion".
RHEC_EXPORT StraightMotion written_motion(Graph& graph, const Expression& ground_speed,
                                          const std::vector<Expression>& states, int state_count,
                                          const std::vector<Expression>& inputs, int input_count);
/// `count` new independent variables with these names, or x0, x1, ... where there are not so many names.
RHEC_EXPORT std::vector<Expression> new_variables(Graph& graph, const char* letter, int count,
                                                  const std::vector<std::string>& names);
/// What the independent variables of a formula are called in messages and drawings.
struct VariableNames {
  std::vector<std::string> states, inputs, parameters;
};

/// Records a formula (FormulaModel says what that is) by calling it once with Expression for its number type. Its
/// options become inputs of the graph; what they are, and the structure, is taken from `values`. Throws Error if it
/// leaves out a result, or has members that are not among its options.
template <template <class> class Formula>
VehicleGraph trace(const Formula<double>& values = {}, const VariableNames& names = {}) {
  VehicleGraph made;
  Graph& graph = *made.graph;
  const FormulaCounts n = counts_of(values);
  const std::vector<Expression> x = new_variables(graph, "x", n.states, names.states),
                                u = new_variables(graph, "u", n.inputs, names.inputs),
                                p = new_variables(graph, "p", n.parameters, names.parameters);
  Formula<Expression> formula;
  made.options = trace_options(graph, values, formula);
  std::vector<Expression> rates = room_for_results(n.states), outputs = room_for_results(n.outputs);
  std::as_const(formula).dynamics(x.data(), u.data(), p.data(), rates.data());
  if constexpr (requires { std::as_const(formula).outputs(x.data(), u.data(), p.data(), outputs.data()); })
    std::as_const(formula).outputs(x.data(), u.data(), p.data(), outputs.data());
  else
    std::as_const(formula).outputs(x.data(), outputs.data());
  made.states = written_nodes(graph, x, n.states, "");
  made.inputs = written_nodes(graph, u, n.inputs, "");
  made.parameters = written_nodes(graph, p, n.parameters, "");
  made.rates = written_nodes(graph, rates, n.states, "dynamics");
  made.outputs = written_nodes(graph, outputs, n.outputs, "outputs");
  if constexpr (requires(Expression * written) {
                  std::as_const(formula).straight_motion(*written, p.data(), written, written);
                }) {
    const Expression speed = Expression::input(graph, "ground_speed");
    std::vector<Expression> states = room_for_results(n.states), inputs = room_for_results(n.inputs);
    std::as_const(formula).straight_motion(speed, p.data(), states.data(), inputs.data());
    made.straight = written_motion(graph, speed, states, n.states, inputs, n.inputs);
  }
  return made;
}

}  // namespace rhec
