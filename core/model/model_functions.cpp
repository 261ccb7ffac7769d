#include "rhec/core/model/model_functions.hpp"

#include <algorithm>
#include <bit>
#include <cstddef>
#include <map>
#include <utility>

#include <fmt/format.h>

#include "rhec/core/formula/straight_code.hpp"
#include "rhec/core/model/formula_copy.hpp"

namespace rhec {
namespace {

constexpr std::string_view names[] = {"step",    "step_jacobian",   "step_hessian",
                                      "ramp",    "ramp_jacobian",   "ramp_hessian",
                                      "outputs", "output_jacobian", "output_hessian"};

std::vector<int> joined(std::vector<int> first, const std::vector<int>& second) {
  first.insert(first.end(), second.begin(), second.end());
  return first;
}

bool is_ramp(ModelFunction function) {
  return function >= ModelFunction::ramp && function <= ModelFunction::ramp_hessian;
}

std::vector<int> option_nodes(const VehicleGraph& vehicle) {
  std::vector<int> nodes;
  nodes.reserve(vehicle.options.size());
  for (const auto& [node, value] : vehicle.options) nodes.push_back(node);
  return nodes;
}

/// 64-bit FNV-1a (Fowler, Noll and Vo).
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

}  // namespace

std::string_view name_of(ModelFunction function) noexcept { return names[static_cast<std::size_t>(function)]; }

const StepGraph& ModelFunctions::step(bool ramp) {
  std::optional<StepGraph>& of = ramp ? ramped_ : steady_;
  if (!of) of = StepGraph::make(vehicle_, ramp);
  return *of;
}

const ModelFunctions::Outputs& ModelFunctions::outputs() {
  if (outputs_) return *outputs_;
  Graph& graph = *vehicle_.graph;
  Outputs made;
  made.jacobian = jacobian(graph, vehicle_.outputs, vehicle_.states);
  for (std::size_t j = 0; j < vehicle_.outputs.size(); ++j) made.weights.push_back(graph.input("weight"));
  made.hessian = weighted_hessian(graph, vehicle_.outputs, made.weights, vehicle_.states);
  const int zero = graph.constant(0.0);
  for (int r = 0; r < made.hessian.rows; ++r)
    for (int c = r + 1; c < made.hessian.columns; ++c) made.hessian.at(r, c) = zero;
  return outputs_.emplace(std::move(made));
}

std::vector<int> ModelFunctions::inputs(ModelFunction function) {
  switch (function) {
    case ModelFunction::outputs:
    case ModelFunction::output_jacobian:
      return vehicle_.states;
    case ModelFunction::output_hessian:
      return joined(vehicle_.states, outputs().weights);
    default:
      return step(is_ramp(function)).arguments();
  }
}

std::vector<int> ModelFunctions::results(ModelFunction function) {
  switch (function) {
    case ModelFunction::outputs:
      return vehicle_.outputs;
    case ModelFunction::output_jacobian:
      return joined(vehicle_.outputs, outputs().jacobian.nodes);
    case ModelFunction::output_hessian:
      return outputs().hessian.nodes;
    default:
      break;
  }
  const StepGraph& of = step(is_ramp(function));
  if (function == ModelFunction::step || function == ModelFunction::ramp) return of.next;
  std::vector<int> first = joined(of.next, of.jacobian.nodes);
  if (function == ModelFunction::step_jacobian || function == ModelFunction::ramp_jacobian) return first;
  return joined(std::move(first), of.hessian.nodes);
}

std::uint64_t fingerprint_of(const VehicleGraph& vehicle) {
  const Graph& graph = *vehicle.graph;
  Hash hash;
  std::map<int, int> numbers;
  // Independent variables first, in the order that they have for a model.
  for (const auto* list : {&vehicle.states, &vehicle.parameters, &vehicle.inputs}) {
    hash.add(static_cast<int>(list->size()));
    for (const int node : *list) numbers.emplace(node, static_cast<int>(numbers.size()));
  }
  hash.add(static_cast<int>(vehicle.options.size()));
  for (const auto& [node, value] : vehicle.options) numbers.emplace(node, static_cast<int>(numbers.size()));
  const std::vector<int> results = joined(vehicle.rates, vehicle.outputs);
  for (const int node : graph.reach(results)) {
    if (numbers.contains(node)) continue;
    const Graph::Node& of = graph[node];
    const int operands = operand_count(of.operation);
    hash.add(static_cast<int>(of.operation));
    if (of.operation == Operation::constant) hash.add(std::bit_cast<std::uint64_t>(of.value));
    if (operands > 0) hash.add(numbers.at(of.a));
    if (operands > 1) hash.add(numbers.at(of.b));
    if (of.operation == Operation::power) hash.add(of.b);
    numbers.emplace(node, static_cast<int>(numbers.size()));
  }
  hash.add(static_cast<int>(vehicle.rates.size()));
  for (const int node : results) hash.add(numbers.at(node));
  return hash.value();
}

ModelCode write_model_code(const VehicleGraph& given, const std::string& prefix, const std::string& formula,
                           const std::vector<std::string>& sets, int most) {
  const VehicleGraph vehicle = formula_copy(given);  // as a model has it, so that the same is made of it
  ModelFunctions functions(vehicle);
  StraightWriter writer(*vehicle.graph, option_nodes(vehicle), most);
  for (int k = 0; k < static_cast<int>(ModelFunction::count); ++k) {
    const auto function = static_cast<ModelFunction>(k);
    // Without parameters there is nothing that could run along an interval.
    if (is_ramp(function) && vehicle.parameters.empty())
      writer.skip();
    else
      writer.add(std::string(name_of(function)), functions.inputs(function), functions.results(function));
  }
  const std::string about =
      fmt::format("The formula {} and its derivatives as straight code, written by rhec; changes are lost.", formula);
  return {writer.kernels(prefix, about), writer.table(prefix, about, fingerprint_of(vehicle), sets)};
}

}  // namespace rhec
