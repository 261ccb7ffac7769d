#pragma once

#include <cstdint>
#include <span>
#include <unordered_map>
#include <vector>

#include "rhec/core/base/export.hpp"
#include "rhec/core/formula/graph.hpp"

namespace rhec {

/// 64-bit FNV-1a (Fowler, Noll and Vo) of numbers.
class Hash {
 public:
  void add(std::uint64_t word) {
    for (int byte = 0; byte < 8; ++byte, word >>= 8) value_ = (value_ ^ (word & 0xff)) * 0x100000001b3u;
  }
  void add(int number) { add(static_cast<std::uint64_t>(static_cast<std::uint32_t>(number))); }
  std::uint64_t value() const { return value_; }

 private:
  std::uint64_t value_ = 0xcbf29ce484222325u;
};

/// What nodes compute, by node, as numbers that are the same in every graph in which they compute the same of `inputs`:
/// neither their own numbers count nor the order of a sum's or product's operands, which compilers evaluate from the
/// left or from the right. An input means its place among `inputs`; one that is not there, its name.
RHEC_EXPORT std::unordered_map<int, std::uint64_t> meanings_of(const Graph& graph, std::span<const int> nodes,
                                                               std::span<const int> inputs);

/// Copies nodes, and what they are computed of, to another graph, with their names. Returns where they are there.
/// Inputs that are copied for the first time become new inputs; `known` of `from` are `known_there` of `to` already.
/// The copies' order follows from what they mean: two graphs of the same formula have the same copy, node by node, and
/// so the same derivatives with sums in the same order.
RHEC_EXPORT std::vector<int> copy_nodes(const Graph& from, std::span<const int> nodes, Graph& to,
                                        std::span<const int> known = {}, std::span<const int> known_there = {});

}  // namespace rhec
