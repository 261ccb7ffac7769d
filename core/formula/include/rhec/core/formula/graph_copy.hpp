#pragma once

#include <span>
#include <vector>

#include "rhec/core/base/export.hpp"
#include "rhec/core/formula/graph.hpp"

namespace rhec {

/// Copies nodes, and what they are computed of, to another graph, with their names. Returns where they are there.
/// Inputs that are copied for the first time become new inputs; `known` of `from` are `known_there` of `to` already.
RHEC_EXPORT std::vector<int> copy_nodes(const Graph& from, std::span<const int> nodes, Graph& to,
                                        std::span<const int> known = {}, std::span<const int> known_there = {});

}  // namespace rhec
