#include "rhec/core/formula/graph_copy.hpp"

#include <cstddef>
#include <unordered_map>

namespace rhec {

std::vector<int> copy_nodes(const Graph& from, std::span<const int> nodes, Graph& to, std::span<const int> known,
                            std::span<const int> known_there) {
  std::unordered_map<int, int> becomes;
  for (std::size_t k = 0; k < known.size(); ++k) becomes.emplace(known[k], known_there[k]);
  for (const int node : from.reach(nodes, known)) {
    if (becomes.contains(node)) continue;
    const Graph::Node& of = from[node];
    const int operands = operand_count(of.operation);
    int made = -1;
    if (of.operation == Operation::constant)
      made = to.constant(of.value);
    else if (of.operation == Operation::input)
      made = to.input(from.name_of(node));
    else
      made = to.apply(of.operation, becomes.at(of.a), operands > 1 ? becomes.at(of.b) : of.b);
    if (operands > 0 && !from.name_of(node).empty()) to.name(made, from.name_of(node));
    becomes.emplace(node, made);
  }
  std::vector<int> copies;
  copies.reserve(nodes.size());
  for (const int node : nodes) copies.push_back(becomes.at(node));
  return copies;
}

}  // namespace rhec
