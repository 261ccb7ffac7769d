#include "rhec/core/model/vehicle_graph.hpp"

#include <fmt/format.h>

#include "rhec/core/base/error.hpp"

namespace rhec {
namespace {
constexpr int guard = 8;  ///< results behind the last one
}

std::vector<Expression> room_for_results(int count) {
  return std::vector<Expression>(static_cast<std::size_t>(count + guard));
}

std::vector<int> written_nodes(Graph& graph, const std::vector<Expression>& results, int count, const char* function) {
  std::vector<int> nodes;
  nodes.reserve(results.size());
  for (const Expression& result : results) {
    const auto at = static_cast<int>(nodes.size());
    if (at == count) break;
    if (!result.is_set())
      throw Error(
          fmt::format("the formula's {} leaves out number {}; let it write all {}, from 0 on", function, at, count));
    nodes.push_back(result.node_in(graph));
  }
  for (std::size_t k = nodes.size(); k < results.size(); ++k)
    if (results[k].is_set())
      throw Error(fmt::format("the formula's {} writes number {}, and it has but {}, counted from 0; mend its counts",
                              function, k, count));
  return nodes;
}

StraightMotion written_motion(Graph& graph, const Expression& ground_speed, const std::vector<Expression>& states,
                              int state_count, const std::vector<Expression>& inputs, int input_count) {
  StraightMotion made;
  made.ground_speed = ground_speed.node_in(graph);
  // What is left out is a state that stays as it is; written_nodes looks at those behind the last one.
  std::vector<Expression> all = states;
  for (int j = 0; j < state_count; ++j) {
    made.states.push_back(all[j].is_set() ? all[j].node_in(graph) : -1);
    if (!all[j].is_set()) all[j] = 0.0;
  }
  written_nodes(graph, all, state_count, "straight_motion");
  made.inputs = written_nodes(graph, inputs, input_count, "straight_motion");
  return made;
}

std::vector<Expression> new_variables(Graph& graph, const char* letter, int count,
                                      const std::vector<std::string>& names) {
  std::vector<Expression> variables;
  variables.reserve(static_cast<std::size_t>(count));
  for (std::size_t k = 0; k < static_cast<std::size_t>(count); ++k)
    variables.push_back(Expression::input(graph, k < names.size() ? names[k] : fmt::format("{}{}", letter, k)));
  return variables;
}

void formula_options::check_shown(std::size_t size, std::size_t shown, std::size_t alignment) {
  if (shown + alignment <= size)
    throw Error(
        fmt::format("a formula has {} bytes of members, and its options show {}; show each member to the visitor, or "
                    "make it static constexpr: a member that is not shown would keep its default",
                    size, shown));
}

}  // namespace rhec
