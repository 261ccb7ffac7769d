#include "node_labels.hpp"

#include <cstddef>

#include <fmt/format.h>

namespace rhec::sim {

NodeLabels::NodeLabels(const VehicleGraph& vehicle, const ModelDescription& about) : graph_(*vehicle.graph) {
  const auto add_inputs = [&](const std::vector<int>& nodes, const std::vector<Variable>& variables, const char* kind) {
    for (std::size_t k = 0; k < nodes.size(); ++k) {
      names_.emplace(nodes[k], variables[k].name);
      kinds_.emplace(nodes[k], kind);
    }
  };
  add_inputs(vehicle.states, about.states, "state");
  add_inputs(vehicle.inputs, about.inputs, "input");
  add_inputs(vehicle.parameters, about.parameters, "parameter");
  for (const Tape::Known& option : vehicle.options) {
    names_.emplace(option.node, graph_.name_of(option.node));
    kinds_.emplace(option.node, "option");
  }
  // A definition's own name says more than that of the derivative that is the same number.
  const auto add_results = [&](const std::vector<int>& nodes, const std::vector<Variable>& variables,
                               const char* mark) {
    for (std::size_t k = 0; k < nodes.size(); ++k)
      if (!graph_.is_constant(nodes[k]) && graph_.name_of(nodes[k]).empty())
        names_.try_emplace(nodes[k], variables[k].name + mark);
  };
  add_results(vehicle.rates, about.states, "'");
  add_results(vehicle.outputs, about.outputs, "");
}

std::string NodeLabels::name(int node) const {
  if (const auto found = names_.find(node); found != names_.end()) return found->second;
  if (const auto found = added_.find(node); found != added_.end()) return found->second;
  return graph_.name_of(node);
}

void NodeLabels::add(int node, const std::string& name) {
  if (graph_.name_of(node).empty() && !names_.contains(node)) added_.try_emplace(node, name);
}

std::string NodeLabels::kind(int node) const {
  const auto found = kinds_.find(node);
  return found == kinds_.end() ? std::string() : found->second;
}

std::string NodeLabels::word(int node) const {
  if (graph_.is_constant(node)) return fmt::format("{:.6g}", graph_[node].value);
  const std::string own = added_.contains(node) ? std::string() : name(node);
  return own.empty() ? fmt::format("n{}", node) : own;
}

std::string NodeLabels::term(int node) const {
  const Graph::Node& of = graph_[node];
  switch (of.operation) {
    case Operation::constant:
      return "constant";
    case Operation::input:
      return kind(node).empty() ? "variable" : kind(node);
    case Operation::add:
    case Operation::subtract:
    case Operation::multiply:
      return fmt::format("{} {} {}", word(of.a), name_of(of.operation), word(of.b));
    case Operation::negate:
      return "-" + word(of.a);
    case Operation::reciprocal:
      return "1 / " + word(of.a);
    case Operation::power:
      return fmt::format("{}^{}", word(of.a), of.b);
    default:
      return operand_count(of.operation) > 1 ? fmt::format("{}({}, {})", name_of(of.operation), word(of.a), word(of.b))
                                             : fmt::format("{}({})", name_of(of.operation), word(of.a));
  }
}

}  // namespace rhec::sim
