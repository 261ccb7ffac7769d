#include "rhec/sim/check/formula_size.hpp"

#include <algorithm>
#include <cstddef>
#include <map>

#include <fmt/format.h>

#include "node_labels.hpp"
#include "rhec/core/formula/derivatives.hpp"
#include "rhec/core/model/formula_copy.hpp"
#include "rhec/core/model/step_graph.hpp"
#include "rhec/sim/files/json.hpp"

namespace rhec::sim {
namespace {

using PatternEntry = DerivativePattern::Entry;

template <class... Lists>
std::vector<int> joined(const Lists&... lists) {
  std::vector<int> all;
  (all.insert(all.end(), lists.begin(), lists.end()), ...);
  return all;
}

/// Operations above each node, up to the variables.
int depth_of(const Graph& graph, const std::vector<int>& targets) {
  std::map<int, int> depths;
  int deepest = 0;
  for (const int node : graph.reach(targets)) {
    const Graph::Node& of = graph[node];
    const int operands = operand_count(of.operation);
    int depth = 0;
    if (operands > 0) depth = depths.at(of.a) + 1;
    if (operands > 1) depth = std::max(depth, depths.at(of.b) + 1);
    depths.emplace(node, depth);
    deepest = std::max(deepest, depth);
  }
  return deepest;
}

std::vector<std::pair<std::string, int>> kinds_of(const Graph& graph, const std::vector<int>& targets) {
  std::map<std::string, int> counts;
  for (const int node : graph.reach(targets))
    if (operand_count(graph[node].operation) > 0) ++counts[std::string(name_of(graph[node].operation))];
  std::vector<std::pair<std::string, int>> sorted(counts.begin(), counts.end());
  std::stable_sort(sorted.begin(), sorted.end(), [](const auto& a, const auto& b) { return a.second > b.second; });
  return sorted;
}

/// Constant is what no variable is needed for; options are numbers by then.
PatternEntry entry_of(const Graph& graph, int node, const std::vector<int>& variables) {
  if (graph.is_constant(node, 0.0)) return PatternEntry::zero;
  for (const int reached : graph.reach({&node, 1}))
    if (std::find(variables.begin(), variables.end(), reached) != variables.end()) return PatternEntry::varies;
  return PatternEntry::constant;
}

DerivativePattern pattern_of(const Graph& graph, const NodeMatrix& matrix, std::vector<std::string> rows,
                             std::vector<std::string> columns, const std::vector<int>& variables, bool is_lower) {
  DerivativePattern pattern{std::move(rows), std::move(columns), {}};
  for (int r = 0; r < matrix.rows; ++r)
    for (int c = 0; c < matrix.columns; ++c)
      pattern.entries.push_back(is_lower && c > r ? PatternEntry::zero : entry_of(graph, matrix.at(r, c), variables));
  return pattern;
}

std::vector<std::string> with_mark(std::vector<std::string> names, const char* mark) {
  for (std::string& name : names) name += mark;
  return names;
}

Json json_of(const DerivativePattern& pattern) {
  Json json;
  json["rows"] = pattern.rows;
  json["columns"] = pattern.columns;
  json["lines"] = Json::array();
  for (std::size_t r = 0; r < pattern.rows.size(); ++r) {
    std::string line;
    for (std::size_t c = 0; c < pattern.columns.size(); ++c) line += ".cx"[static_cast<int>(pattern.at(r, c))];
    json["lines"].push_back(line);
  }
  return json;
}

}  // namespace

int DerivativePattern::count() const {
  return static_cast<int>(
      std::count_if(entries.begin(), entries.end(), [](PatternEntry e) { return e != PatternEntry::zero; }));
}

std::vector<std::string> DerivativePattern::lines() const {
  std::size_t widest = 0;
  for (const std::string& row : rows) widest = std::max(widest, row.size());
  // Names of columns stand above them, top to bottom.
  std::size_t height = 0;
  for (const std::string& column : columns) height = std::max(height, column.size());
  std::vector<std::string> made;
  for (std::size_t k = 0; k < height; ++k) {
    std::string line(widest + 1, ' ');
    for (const std::string& column : columns) {
      const std::size_t above = height - column.size();
      line += {' ', k < above ? ' ' : column[k - above]};
    }
    made.push_back(line.substr(0, line.find_last_not_of(' ') + 1));
  }
  for (std::size_t r = 0; r < rows.size(); ++r) {
    std::string line = fmt::format("{:>{}} ", rows[r], widest);
    for (std::size_t c = 0; c < columns.size(); ++c) line += {' ', ".cx"[static_cast<int>(at(r, c))]};
    made.push_back(line);
  }
  return made;
}

FormulaSize size_of_formula(const VehicleGraph& vehicle, const ModelDescription& about) {
  const VehicleGraph copy = formula_copy(vehicle);
  Graph& graph = *copy.graph;
  const std::vector<int> z = joined(copy.states, copy.parameters, copy.inputs);
  const std::vector<int> values = joined(copy.rates, copy.outputs);
  FormulaSize size;
  size.model = about.name;
  size.depth = depth_of(graph, values);
  size.kinds = kinds_of(graph, values);

  const NodeMatrix slopes = jacobian(graph, copy.rates, z), output_slopes = jacobian(graph, copy.outputs, copy.states);
  std::vector<int> weights;
  for (std::size_t k = 0; k < copy.rates.size(); ++k) weights.push_back(graph.input("weight"));
  const NodeMatrix bends = weighted_hessian(graph, copy.rates, weights, z);
  std::vector<std::string> names = names_of(about.states);
  for (const auto* more : {&about.parameters, &about.inputs})
    for (const Variable& variable : *more) names.push_back(variable.name);
  size.rates = pattern_of(graph, slopes, with_mark(names_of(about.states), "'"), names, z, false);
  size.outputs = pattern_of(graph, output_slopes, names_of(about.outputs), names_of(about.states), z, false);
  // Weights vary, too, but are no variables: a constant curvature is one.
  size.hessian = pattern_of(graph, bends, names, names, z, true);

  const auto count = [&](const char* what, const std::vector<int>& targets) {
    size.counts.emplace_back(what, graph.count_operations(targets));
  };
  count("f", copy.rates);
  count("f, df/dz", joined(copy.rates, slopes.nodes));
  count("f, df/dz, Hessian", joined(copy.rates, slopes.nodes, bends.nodes));
  count("h", copy.outputs);
  count("h, dh/dx", joined(copy.outputs, output_slopes.nodes));
  const StepGraph step = StepGraph::make(copy, false);
  count("step F", step.next);
  count("step F, dF/dz", joined(step.next, step.jacobian.nodes));
  count("step F, dF/dz, Hessian", joined(step.next, step.jacobian.nodes, step.hessian.nodes));
  return size;
}

std::string size_json(const FormulaSize& size) {
  Json json;
  json["model"] = size.model;
  json["depth"] = size.depth;
  json["kinds"] = Json::object();
  for (const auto& [kind, count] : size.kinds) json["kinds"][kind] = count;
  json["operations"] = Json::object();
  for (const auto& [what, count] : size.counts) json["operations"][what] = count;
  json["rates"] = json_of(size.rates);
  json["outputs"] = json_of(size.outputs);
  json["hessian"] = json_of(size.hessian);
  return json.dump(2);
}

}  // namespace rhec::sim
