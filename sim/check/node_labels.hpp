#pragma once

#include <map>
#include <string>
#include <vector>

#include "rhec/core/model/model.hpp"
#include "rhec/core/model/vehicle_graph.hpp"

namespace rhec::sim {

/// What the nodes of a vehicle's formula are called for users.
class NodeLabels {
 public:
  NodeLabels(const VehicleGraph& vehicle, const ModelDescription& about);

  /// A variable's name, an option's, "beta'" or an output's, a definition's; empty if it has none.
  std::string name(int node) const;
  /// What stands for it in a term: its name, unless `add` gave it, a constant's value, or "n12".
  std::string word(int node) const;
  /// How it is computed of its operands: "kappa * u1", "sqrt(n4)"; of an input "state", "option", ...
  std::string term(int node) const;
  /// Gives a node that has no name one, e.g. a derivative.
  void add(int node, const std::string& name);
  /// "state", "input", "parameter", "option"; empty of what is computed.
  std::string kind(int node) const;

 private:
  const Graph& graph_;
  std::map<int, std::string> names_, kinds_, added_;
};

}  // namespace rhec::sim
