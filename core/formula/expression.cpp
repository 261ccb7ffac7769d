#include "rhec/core/formula/expression.hpp"

#include "rhec/core/base/error.hpp"

namespace rhec {

int Expression::node_in(Graph& graph) const {
  if (!is_set_)
    throw Error("a formula uses a number that it has not set; let it write each variable before it is read");
  if (!graph_) return graph.constant(value_);
  if (graph_ != &graph) throw Error("a formula mixes numbers of two graphs; let it use its arguments alone");
  return node_;
}

Graph* Expression::common(const Expression& a, const Expression& b) { return a.graph_ ? a.graph_ : b.graph_; }

Expression Expression::of(Operation operation, const Expression& a, const Expression& b) {
  Graph constants;  // of two constants
  Graph* const graph = common(a, b);
  Graph& in = graph ? *graph : constants;
  const int first = a.node_in(in);
  const int made = in.apply(operation, first, operand_count(operation) > 1 ? b.node_in(in) : -1);
  return graph ? Expression(*graph, made) : Expression(constants[made].value);
}

Expression Expression::power(const Expression& base, int exponent) {
  if (base.graph_) return {*base.graph_, base.graph_->power(base.node_, exponent)};
  Graph constants;
  return constants[constants.power(base.node_in(constants), exponent)].value;
}

Expression Expression::quotient(const Expression& a, const Expression& b) {
  if (Graph* const graph = common(a, b)) {
    const int numerator = a.node_in(*graph);
    return {*graph, graph->divide(numerator, b.node_in(*graph))};
  }
  Graph constants;  // checks that both are set
  const int numerator = a.node_in(constants);
  return constants[constants.divide(numerator, b.node_in(constants))].value;
}

void Expression::give_name(const char* name) const {
  if (graph_) graph_->name(node_, name);
}

Expression named(const Expression& expression, const char* name) {
  expression.give_name(name);
  return expression;
}

}  // namespace rhec
