#include "rhec/core/formula/derivatives.hpp"

#include <algorithm>
#include <utility>

namespace rhec {
namespace {

/// Nodes by the numbers of others; 0-derivatives are not kept.
class SparseNodes {
 public:
  explicit SparseNodes(int size) : nodes_(static_cast<std::size_t>(size), -1) {}
  bool has(int of) const { return nodes_[static_cast<std::size_t>(of)] >= 0; }
  int of(int node) const { return nodes_[static_cast<std::size_t>(node)]; }
  void set(int of, int node) { nodes_[static_cast<std::size_t>(of)] = node; }
  void add(Graph& graph, int of, int node) { set(of, has(of) ? graph.add(this->of(of), node) : node); }

 private:
  std::vector<int> nodes_;
};

/// The partial derivatives of an operation by its operands; -1 for an operand that it does not have.
struct Partials {
  int a = -1, b = -1;
};

Partials partials_of(Graph& g, int node) {
  const Graph::Node of = g[node];
  const auto one_plus_square = [&](int a) { return g.add(g.constant(1.0), g.multiply(a, a)); };
  const auto one_minus_square = [&](int a) { return g.subtract(g.constant(1.0), g.multiply(a, a)); };
  switch (of.operation) {
    case Operation::constant:
    case Operation::input:
      return {};
    case Operation::add:
      return {g.constant(1.0), g.constant(1.0)};
    case Operation::subtract:
      return {g.constant(1.0), g.constant(-1.0)};
    case Operation::multiply:
      return {of.b, of.a};
    case Operation::negate:
      return {g.constant(-1.0)};
    case Operation::reciprocal:
      return {g.negate(g.multiply(node, node))};
    case Operation::power:
      return {g.multiply(g.constant(of.b), g.power(of.a, of.b - 1))};
    case Operation::square_root:
      return {g.multiply(g.constant(0.5), g.reciprocal(node))};
    case Operation::exponential:
      return {node};
    case Operation::logarithm:
      return {g.reciprocal(of.a)};
    case Operation::sine:
      return {g.function(Operation::cosine, of.a)};
    case Operation::cosine:
      return {g.negate(g.function(Operation::sine, of.a))};
    case Operation::tangent:
      return {one_plus_square(node)};
    case Operation::arc_sine:
    case Operation::arc_cosine: {
      // (1 - a)(1 + a) keeps its digits near 1, which 1 - a^2 does not.
      const int one = g.constant(1.0);
      const int square = g.multiply(g.subtract(one, of.a), g.add(one, of.a));
      const int slope = g.reciprocal(g.function(Operation::square_root, square));
      return {of.operation == Operation::arc_sine ? slope : g.negate(slope)};
    }
    case Operation::arc_tangent:
      return {g.reciprocal(one_plus_square(of.a))};
    case Operation::arc_tangent_2: {
      const int scale = g.reciprocal(g.add(g.multiply(of.a, of.a), g.multiply(of.b, of.b)));
      return {g.multiply(of.b, scale), g.negate(g.multiply(of.a, scale))};
    }
    case Operation::hyperbolic_tangent:
      return {one_minus_square(node)};
  }
  return {};
}

/// What both accumulations go over: the nodes between variables and targets, and their partial derivatives, made once.
class Differentiation {
 public:
  Differentiation(Graph& graph, std::span<const int> targets, std::span<const int> variables)
      : graph_(graph), nodes_(graph.reach(targets, variables)) {
    const std::size_t size = nodes_.empty() ? 0 : static_cast<std::size_t>(nodes_.back()) + 1;
    size_ = static_cast<int>(size);
    is_variable_.assign(size, 0);
    depends_.assign(size, 0);
    for (const int variable : variables)
      if (variable < size_) is_variable_[variable] = 1;
    partials_.resize(size);
    for (const int node : nodes_) {
      const Graph::Node& of = graph_[node];
      const int operands = operand_count(of.operation);
      depends_[node] = is_variable_[node] || (operands > 0 && depends_[of.a]) || (operands > 1 && depends_[of.b]);
      if (depends_[node] && !is_variable_[node]) partials_[node] = partials_of(graph_, node);
    }
  }

  /// d targets / d variable.
  std::vector<int> along(int variable, std::span<const int> targets) const {
    SparseNodes slopes(size_);
    if (variable < size_) slopes.set(variable, graph_.constant(1.0));
    for (const int node : nodes_) {
      if (is_variable_[node] || !depends_[node]) continue;
      const Graph::Node of = graph_[node];
      const auto add = [&](int operand, int partial) {
        if (partial >= 0 && slopes.has(operand)) slopes.add(graph_, node, graph_.multiply(partial, slopes.of(operand)));
      };
      if (operand_count(of.operation) > 0) add(of.a, partials_[node].a);
      if (operand_count(of.operation) > 1) add(of.b, partials_[node].b);
    }
    return picked(slopes, targets);
  }

  /// sum_r weights_r d targets_r / d variables.
  std::vector<int> back_from(std::span<const int> targets, std::span<const int> weights,
                             std::span<const int> variables) const {
    SparseNodes adjoints(size_);
    for (std::size_t r = 0; r < targets.size(); ++r) adjoints.add(graph_, targets[r], weights[r]);
    for (std::size_t k = nodes_.size(); k-- > 0;) {
      const int node = nodes_[k];
      if (is_variable_[node] || !depends_[node] || !adjoints.has(node)) continue;
      const Graph::Node of = graph_[node];
      const auto add = [&](int operand, int partial) {
        if (depends_[operand]) adjoints.add(graph_, operand, graph_.multiply(adjoints.of(node), partial));
      };
      if (operand_count(of.operation) > 0) add(of.a, partials_[node].a);
      if (operand_count(of.operation) > 1) add(of.b, partials_[node].b);
    }
    return picked(adjoints, variables);
  }

 private:
  std::vector<int> picked(const SparseNodes& from, std::span<const int> wanted) const {
    std::vector<int> found;
    found.reserve(wanted.size());
    for (const int node : wanted)
      found.push_back(node < size_ && from.has(node) ? from.of(node) : graph_.constant(0.0));
    return found;
  }

  Graph& graph_;
  std::vector<int> nodes_;
  int size_ = 0;
  std::vector<char> is_variable_, depends_;
  std::vector<Partials> partials_;
};

NodeMatrix forward(Graph& graph, const Differentiation& of, std::span<const int> targets,
                   std::span<const int> variables) {
  NodeMatrix matrix{static_cast<int>(targets.size()), static_cast<int>(variables.size()), {}};
  matrix.nodes.assign(targets.size() * variables.size(), graph.constant(0.0));
  for (int c = 0; c < matrix.columns; ++c) {
    const std::vector<int> column = of.along(variables[c], targets);
    for (int r = 0; r < matrix.rows; ++r) matrix.at(r, c) = column[r];
  }
  return matrix;
}

NodeMatrix backward(Graph& graph, const Differentiation& of, std::span<const int> targets,
                    std::span<const int> variables) {
  NodeMatrix matrix{static_cast<int>(targets.size()), static_cast<int>(variables.size()), {}};
  const int one = graph.constant(1.0);
  for (const int target : targets) {
    const std::vector<int> row = of.back_from({&target, 1}, {&one, 1}, variables);
    matrix.nodes.insert(matrix.nodes.end(), row.begin(), row.end());
  }
  return matrix;
}

/// A symmetric matrix from its lower triangle.
void mirror_lower(NodeMatrix& matrix) {
  for (int r = 0; r < matrix.rows; ++r)
    for (int c = r + 1; c < matrix.columns; ++c) matrix.at(r, c) = matrix.at(c, r);
}

}  // namespace

NodeMatrix jacobian(Graph& graph, std::span<const int> targets, std::span<const int> variables,
                    Accumulation accumulation) {
  const Differentiation of(graph, targets, variables);
  if (accumulation == Accumulation::forward) return forward(graph, of, targets, variables);
  if (accumulation == Accumulation::reverse) return backward(graph, of, targets, variables);
  NodeMatrix along = forward(graph, of, targets, variables), back = backward(graph, of, targets, variables);
  return graph.count_operations(back.nodes) < graph.count_operations(along.nodes) ? back : along;
}

std::vector<int> weighted_gradient(Graph& graph, std::span<const int> targets, std::span<const int> weights,
                                   std::span<const int> variables) {
  return Differentiation(graph, targets, variables).back_from(targets, weights, variables);
}

NodeMatrix weighted_hessian(Graph& graph, std::span<const int> targets, std::span<const int> weights,
                            std::span<const int> variables) {
  const std::vector<int> gradient = weighted_gradient(graph, targets, weights, variables);
  const Differentiation of(graph, gradient, variables);
  NodeMatrix along = forward(graph, of, gradient, variables), back = backward(graph, of, gradient, variables);
  mirror_lower(along);
  mirror_lower(back);
  return graph.count_operations(back.nodes) < graph.count_operations(along.nodes) ? back : along;
}

}  // namespace rhec
