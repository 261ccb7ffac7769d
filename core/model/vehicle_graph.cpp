#include "rhec/core/model/vehicle_graph.hpp"

#include <fmt/format.h>

#include "rhec/core/base/error.hpp"

namespace rhec {

std::vector<int> written_nodes(Graph& graph, const std::vector<Expression>& results, const char* function) {
  std::vector<int> nodes;
  nodes.reserve(results.size());
  for (const Expression& result : results) {
    if (!result.is_set())
      throw Error(fmt::format("the formula's {} leaves out number {}; let it write all {}, from 0 on", function,
                              nodes.size(), results.size()));
    nodes.push_back(result.node_in(graph));
  }
  return nodes;
}

std::vector<Expression> new_variables(Graph& graph, const char* letter, int count) {
  std::vector<Expression> variables;
  variables.reserve(static_cast<std::size_t>(count));
  for (int k = 0; k < count; ++k) variables.push_back(Expression::input(graph, fmt::format("{}{}", letter, k)));
  return variables;
}

}  // namespace rhec
