#include "rhec/sim/check/formula_trace.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include <fmt/format.h>

#include "findings_json.hpp"
#include "model_checks.hpp"
#include "node_labels.hpp"
#include "rhec/core/formula/derivatives.hpp"
#include "rhec/core/model/formula_copy.hpp"

namespace rhec::sim {
namespace {

/// What a user reads of an operation whose operands are finite and whose value is not.
struct Reason {
  std::string why, advice;
};

Reason reason_of(const Graph& graph, int node, double a, double b) {
  const Graph::Node& of = graph[node];
  const bool of_root = operand_count(of.operation) > 0 && graph[of.a].operation == Operation::square_root;
  switch (of.operation) {
    case Operation::input:
    case Operation::constant:
      return {"its value is not finite", "give it another one"};
    case Operation::reciprocal:
      if (a != 0.0) break;
      if (of_root)
        return {"it divides by a square root that is 0; the slope of a square root is infinite there",
                "write sqrt(a + w^2) with a small width w, or smooth_abs(x, w) for sqrt(x^2)"};
      return {"it divides by 0", "keep the divisor from 0, e.g. smooth_abs(v, w) instead of v, with a small width w"};
    case Operation::square_root:
      return {fmt::format("the square root of a negative number, {:.6g}", a),
              "keep it above 0, e.g. sqrt(smooth_max(a, 0, w)), or bound the variables"};
    case Operation::logarithm:
      return {a == 0.0 ? "the logarithm of 0" : fmt::format("the logarithm of a negative number, {:.6g}", a),
              "keep it above 0; a power x^a of an a that is no integer is exp(a log(x)), too"};
    case Operation::arc_sine:
    case Operation::arc_cosine:
      return {fmt::format("{} of {:.6g}, which is not within [-1, 1]", name_of(of.operation), a),
              "atan2(y, x) has a value for all y and x but 0 and 0"};
    case Operation::multiply:
    case Operation::add:
    case Operation::subtract:
      return {fmt::format("{:.6g} {} {:.6g} is too large for a number", a, name_of(of.operation), b), ""};
    default:
      break;
  }
  return {fmt::format("{} of {:.6g} is too large for a number", name_of(of.operation), a), ""};
}

class Tracer {
 public:
  Tracer(const VehicleGraph& vehicle, const ModelDescription& about, const FormulaPoint& at)
      : vehicle_(formula_copy(vehicle)), labels_(vehicle_, about), about_(about) {
    const auto set = [&](const std::vector<int>& nodes, const std::vector<double>& values) {
      for (std::size_t k = 0; k < nodes.size(); ++k) add_input(nodes[k], values[k]);
    };
    for (const Tape::Known& option : vehicle_.options) add_input(option.node, option.value);
    set(vehicle_.states, at.states);
    set(vehicle_.inputs, at.inputs);
    set(vehicle_.parameters, at.parameters);
    z_ = joined(vehicle_.states, vehicle_.parameters, vehicle_.inputs);
  }

  TracedPart values() {
    std::vector<Result> results;
    for (std::size_t j = 0; j < vehicle_.rates.size(); ++j)
      results.push_back({vehicle_.rates[j], about_.states[j].name + "'"});
    for (std::size_t j = 0; j < vehicle_.outputs.size(); ++j)
      results.push_back({vehicle_.outputs[j], about_.outputs[j].name});
    return part("values", results, inputs_);
  }
  TracedPart jacobian() {
    std::vector<Result> results;
    add_slopes(results, vehicle_.rates, about_.states, "'", z_);
    // A vehicle's outputs depend on its state alone; the rows of a term, which has no rates, on all variables.
    add_slopes(results, vehicle_.outputs, about_.outputs, "", vehicle_.rates.empty() ? z_ : vehicle_.states);
    return part("jacobian", results, {});
  }
  TracedPart hessian() {
    const std::vector<int> targets = joined(vehicle_.rates, vehicle_.outputs);
    std::vector<int> weights;
    for (std::size_t k = 0; k < targets.size(); ++k) {
      weights.push_back(graph().input("weight"));
      add_input(weights.back(), 1.0);
      seen_.push_back(weights.back());
    }
    const NodeMatrix bends = weighted_hessian(graph(), targets, weights, z_);
    std::vector<Result> results;
    for (int r = 0; r < bends.rows; ++r)
      for (int c = 0; c <= r; ++c)
        results.push_back({bends.at(r, c), fmt::format("d2 / d {} d {}", labels_.word(z_[r]), labels_.word(z_[c]))});
    return part("hessian", results, {});
  }

 private:
  struct Result {
    int node;
    std::string name;
  };

  Graph& graph() { return *vehicle_.graph; }
  template <class... Lists>
  static std::vector<int> joined(const Lists&... lists) {
    std::vector<int> all;
    (all.insert(all.end(), lists.begin(), lists.end()), ...);
    return all;
  }
  void add_input(int node, double value) {
    inputs_.push_back(node);
    input_values_.push_back(value);
  }
  void add_slopes(std::vector<Result>& results, const std::vector<int>& targets, const std::vector<Variable>& of,
                  const char* mark, const std::vector<int>& variables) {
    const NodeMatrix slopes = rhec::jacobian(graph(), targets, variables);
    for (int r = 0; r < slopes.rows; ++r)
      for (int c = 0; c < slopes.columns; ++c)
        results.push_back(
            {slopes.at(r, c), fmt::format("d {}{} / d {}", of[r].name, mark, labels_.word(variables[c]))});
  }

  TracedNode traced(int node, double value) const { return {node, labels_.name(node), labels_.term(node), value}; }

  /// The nodes of `results` that no part before has; `always` are among them even if nothing needs them.
  TracedPart part(std::string name, const std::vector<Result>& results, const std::vector<int>& always) {
    TracedPart made{std::move(name), {}, 0, {}};
    std::vector<int> targets = always;
    for (const Result& result : results) {
      targets.push_back(result.node);
      if (graph().is_constant(result.node, 0.0)) continue;
      ++made.results;
      if (!graph().is_constant(result.node)) labels_.add(result.node, result.name);
    }
    const std::vector<int> reached = graph().reach(targets);
    const std::vector<double> values = graph().evaluate(reached, inputs_, input_values_);
    const auto value_of = [&](int node) {
      return values[std::lower_bound(reached.begin(), reached.end(), node) - reached.begin()];
    };
    for (std::size_t k = 0; k < reached.size(); ++k) {
      const int node = reached[k];
      if (std::binary_search(seen_.begin(), seen_.end(), node)) continue;
      made.nodes.push_back(traced(node, values[k]));
      if (!made.first && !std::isfinite(values[k])) made.first = blame(node, value_of);
    }
    if (made.first)
      for (const Result& result : results)
        if (!std::isfinite(value_of(result.node))) made.first->results.push_back(result.name);
    seen_.insert(seen_.end(), reached.begin(), reached.end());
    std::sort(seen_.begin(), seen_.end());
    return made;
  }

  template <class ValueOf>
  NotFinite blame(int node, ValueOf value_of) const {
    NotFinite found{traced(node, value_of(node)), {}, {}, {}, {}};
    const Graph::Node& of = (*vehicle_.graph)[node];
    const int operands = operand_count(of.operation);
    bool is_first = true;  // of all parts
    for (int k = 0; k < operands; ++k) {
      const int operand = k == 0 ? of.a : of.b;
      found.operands.push_back(traced(operand, value_of(operand)));
      is_first = is_first && std::isfinite(found.operands.back().value);
    }
    if (!is_first) {
      found.why = "it is computed of what is not finite";
      return found;
    }
    const Reason reason = reason_of(*vehicle_.graph, node, operands > 0 ? found.operands[0].value : found.node.value,
                                    operands > 1 ? found.operands[1].value : 0.0);
    found.why = reason.why;
    found.advice = reason.advice;
    return found;
  }

  VehicleGraph vehicle_;
  NodeLabels labels_;
  const ModelDescription& about_;
  std::vector<int> inputs_, z_;
  std::vector<double> input_values_;
  std::vector<int> seen_;  ///< nodes of parts before, ascending
};

Json json_of(const TracedNode& node) {
  Json json;
  json["node"] = node.node;
  json["name"] = node.name;
  json["term"] = node.term;
  json["value"] = number_or_null(node.value);
  json["finite"] = std::isfinite(node.value);
  return json;
}

}  // namespace

FormulaPoint straight_point(Model& model, const ModelDescription& within, std::optional<double> speed) {
  const ModelCheckOptions options;
  const CheckedModel checked{model, within, options, {}, {}};
  FormulaPoint point{state_in_line(checked, 0.0), std::vector<double>(within.inputs.size(), 0.0), {}};
  for (const Variable& p : within.parameters) point.parameters.push_back(std::clamp(p.nominal, p.lower, p.upper));
  model.straight_motion(speed.value_or(typical_speed(checked).value_or(1.0)), point.parameters.data(),
                        point.states.data(), point.inputs.data());
  return point;
}

bool FormulaTrace::is_finite() const {
  return std::none_of(parts.begin(), parts.end(), [](const TracedPart& part) { return part.first.has_value(); });
}

FormulaTrace trace_formula(const VehicleGraph& vehicle, const ModelDescription& about, const FormulaPoint& at) {
  Tracer tracer(vehicle, about, at);
  FormulaTrace trace{about.name, {}};
  trace.parts.push_back(tracer.values());
  trace.parts.push_back(tracer.jacobian());
  trace.parts.push_back(tracer.hessian());
  return trace;
}

std::string trace_json(const FormulaTrace& trace, const ModelDescription& about, const FormulaPoint& at) {
  Json json;
  json["model"] = trace.model;
  json["at"] = Json::object();
  const auto add = [&](const std::vector<Variable>& variables, const std::vector<double>& values) {
    for (std::size_t k = 0; k < variables.size(); ++k) json["at"][variables[k].name] = number_or_null(values[k]);
  };
  add(about.states, at.states);
  add(about.inputs, at.inputs);
  add(about.parameters, at.parameters);
  json["finite"] = trace.is_finite();
  for (const TracedPart& part : trace.parts) {
    Json& made = json[part.name];
    made["results"] = part.results;
    made["first_not_finite"] = nullptr;
    if (part.first) {
      Json first = json_of(part.first->node);
      first["why"] = part.first->why;
      first["advice"] = part.first->advice;
      first["operands"] = Json::array();
      for (const TracedNode& operand : part.first->operands) first["operands"].push_back(json_of(operand));
      first["spoiled"] = part.first->results;
      made["first_not_finite"] = std::move(first);
    }
    made["nodes"] = Json::array();
    for (const TracedNode& node : part.nodes) made["nodes"].push_back(json_of(node));
  }
  return json.dump(2);
}

}  // namespace rhec::sim
