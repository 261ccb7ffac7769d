#include "rhec/core/formula/graph_copy.hpp"

#include <bit>
#include <cstddef>
#include <utility>

namespace rhec {
namespace {

bool is_commutative(Operation operation) { return operation == Operation::add || operation == Operation::multiply; }

/// Nodes below `targets`, each behind its operands, of which the one with the lesser meaning comes first where their
/// order does not count.
std::vector<int> ordered(const Graph& graph, std::span<const int> targets,
                         const std::unordered_map<int, std::uint64_t>& meanings,
                         const std::unordered_map<int, int>& known) {
  std::vector<char> is_done(static_cast<std::size_t>(graph.size()), 0);
  for (const auto& [node, there] : known) is_done[static_cast<std::size_t>(node)] = 1;
  std::vector<int> order, open;
  for (const int target : targets) {
    open.push_back(target);
    while (!open.empty()) {
      const int node = open.back();
      const Graph::Node& of = graph[node];
      const int operands = is_done[static_cast<std::size_t>(node)] != 0 ? 0 : operand_count(of.operation);
      int first = operands > 0 ? of.a : -1, second = operands > 1 ? of.b : -1;
      if (second >= 0 && is_commutative(of.operation) && meanings.at(second) < meanings.at(first))
        std::swap(first, second);
      const std::size_t before = open.size();
      for (const int operand : {second, first})
        if (operand >= 0 && is_done[static_cast<std::size_t>(operand)] == 0) open.push_back(operand);
      if (open.size() > before) continue;
      open.pop_back();
      if (is_done[static_cast<std::size_t>(node)] == 0) order.push_back(node);
      is_done[static_cast<std::size_t>(node)] = 1;
    }
  }
  return order;
}

}  // namespace

std::unordered_map<int, std::uint64_t> meanings_of(const Graph& graph, std::span<const int> nodes,
                                                   std::span<const int> inputs) {
  std::unordered_map<int, std::uint64_t> meanings;
  for (const int input : inputs) {
    Hash hash;
    hash.add(static_cast<int>(Operation::input));
    hash.add(static_cast<int>(meanings.size()));
    meanings.emplace(input, hash.value());
  }
  for (const int node : graph.reach(nodes, inputs)) {
    if (meanings.contains(node)) continue;
    const Graph::Node& of = graph[node];
    const int operands = operand_count(of.operation);
    std::uint64_t first = operands > 0 ? meanings.at(of.a) : 0, second = operands > 1 ? meanings.at(of.b) : 0;
    if (is_commutative(of.operation) && second < first) std::swap(first, second);
    Hash hash;
    hash.add(static_cast<int>(of.operation));
    if (of.operation == Operation::constant) hash.add(std::bit_cast<std::uint64_t>(of.value));
    if (of.operation == Operation::input)
      for (const char letter : graph.name_of(node)) hash.add(static_cast<int>(letter));
    hash.add(first);
    hash.add(second);
    if (of.operation == Operation::power) hash.add(of.b);
    meanings.emplace(node, hash.value());
  }
  return meanings;
}

std::vector<int> copy_nodes(const Graph& from, std::span<const int> nodes, Graph& to, std::span<const int> known,
                            std::span<const int> known_there) {
  std::unordered_map<int, int> becomes;
  for (std::size_t k = 0; k < known.size(); ++k) becomes.emplace(known[k], known_there[k]);
  for (const int node : ordered(from, nodes, meanings_of(from, nodes, known), becomes)) {
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
