#pragma once

#include <span>
#include <vector>

#include "rhec/core/base/export.hpp"
#include "rhec/core/formula/graph.hpp"

namespace rhec {

/// A matrix of nodes; what is zero by structure is the node of the constant 0.
struct RHEC_EXPORT NodeMatrix {
  int rows = 0, columns = 0;
  std::vector<int> nodes;  ///< row by row

  int& at(int row, int column) { return nodes[static_cast<std::size_t>(row) * columns + column]; }
  int at(int row, int column) const { return nodes[static_cast<std::size_t>(row) * columns + column]; }
};

/// How a Jacobian is accumulated (Griewank and Walther, Evaluating Derivatives, 2008): along each variable through the
/// graph, or from each target back. By count, both are made, and what takes fewer operations is returned.
enum class Accumulation { forward, reverse, by_count };

/// d targets_r / d variables_c. Variables need not be inputs: what they are computed from is not looked at, so the
/// derivatives are partial ones. Nodes that are no variable count as constant.
RHEC_EXPORT NodeMatrix jacobian(Graph& graph, std::span<const int> targets, std::span<const int> variables,
                                Accumulation accumulation = Accumulation::by_count);

/// d (sum_r weights_r targets_r) / d variables, by one pass back through the graph (adjoints).
RHEC_EXPORT std::vector<int> weighted_gradient(Graph& graph, std::span<const int> targets, std::span<const int> weights,
                                               std::span<const int> variables);

/// d2 (sum_r weights_r targets_r) / d variables2, symmetric: the Jacobian of the weighted gradient. Weights that depend
/// on the variables count as constant, where no variable lies before them.
RHEC_EXPORT NodeMatrix weighted_hessian(Graph& graph, std::span<const int> targets, std::span<const int> weights,
                                        std::span<const int> variables);

}  // namespace rhec
