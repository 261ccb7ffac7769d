#include "rhec/core/model/model_functions.hpp"

#include <algorithm>
#include <cstddef>
#include <unordered_map>
#include <utility>

#include <fmt/format.h>

#include "rhec/core/formula/graph_copy.hpp"
#include "rhec/core/formula/straight_code.hpp"
#include "rhec/core/model/formula_copy.hpp"
#include "rhec/core/model/motion_outputs.hpp"
#include "staged_steps.hpp"

namespace rhec {
namespace {

constexpr std::string_view names[] = {"step",           "step_jacobian", "step_hessian",   "ramp",
                                      "ramp_jacobian",  "ramp_hessian",  "outputs",        "output_jacobian",
                                      "output_hessian", "rates",         "rates_jacobian", "rates_hessian"};

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

/// Whether a step that takes so many operations by its stages need not be made to see that it is too long as a whole:
/// that takes no less than half of them.
bool is_far_too_long(long staged_operations) { return staged_operations > 2L * ModelFunctions::longest_step; }

/// The part above the diagonal becomes zero.
void keep_lower(Graph& graph, NodeMatrix& matrix) {
  const int zero = graph.constant(0.0);
  for (int r = 0; r < matrix.rows; ++r)
    for (int c = r + 1; c < matrix.columns; ++c) matrix.at(r, c) = zero;
}

/// Outputs of motion are evaluated elsewhere (MotionOutputs): they are 0 here.
std::vector<int> outputs_of_state(const VehicleGraph& vehicle) {
  std::vector<int> outputs = vehicle.outputs;
  for (const int j : outputs_of_motion(vehicle)) outputs[static_cast<std::size_t>(j)] = vehicle.graph->constant(0.0);
  return outputs;
}

std::vector<int> arguments_of(const VehicleGraph& vehicle) {
  return joined(joined(vehicle.states, vehicle.parameters), vehicle.inputs);
}

}  // namespace

std::string_view name_of(ModelFunction function) noexcept { return names[static_cast<std::size_t>(function)]; }

const StepGraph& ModelFunctions::step(bool ramp) {
  std::optional<StepGraph>& of = ramp ? ramped_ : steady_;
  if (of) return *of;
  const Operations& staged = staged_operations(ramp);
  const StepCurvature curvature = is_far_too_long(staged[1])   ? StepCurvature::no_derivatives
                                  : is_far_too_long(staged[2]) ? StepCurvature::no_hessian
                                                               : StepCurvature::by_count;
  return of.emplace(StepGraph::make(vehicle_, ramp, curvature));
}

const ModelFunctions::Outputs& ModelFunctions::outputs() {
  if (outputs_) return *outputs_;
  Graph& graph = *vehicle_.graph;
  Outputs made;
  made.values = outputs_of_state(vehicle_);
  made.jacobian = jacobian(graph, made.values, vehicle_.states);
  for (std::size_t j = 0; j < vehicle_.outputs.size(); ++j) made.weights.push_back(graph.input("weight"));
  made.hessian = weighted_hessian(graph, made.values, made.weights, vehicle_.states);
  keep_lower(graph, made.hessian);
  return outputs_.emplace(std::move(made));
}

const ModelFunctions::Rates& ModelFunctions::rates() {
  if (rates_) return *rates_;
  Graph& graph = *vehicle_.graph;
  const std::vector<int> arguments = arguments_of(vehicle_);
  Rates made;
  made.jacobian = jacobian(graph, vehicle_.rates, arguments);
  for (std::size_t r = 0; r < vehicle_.rates.size(); ++r) made.weights.push_back(graph.input("weight"));
  made.hessian = weighted_hessian(graph, vehicle_.rates, made.weights, arguments);
  keep_lower(graph, made.hessian);
  return rates_.emplace(std::move(made));
}

/// What the chain rule over the stages takes. Of a copy: nodes of another order would change a step that is whole.
const ModelFunctions::Operations& ModelFunctions::staged_operations(bool ramp) {
  std::optional<Operations>& of = ramp ? staged_ramp_ : staged_;
  if (of) return *of;
  const VehicleGraph copy = formula_copy(vehicle_);
  ModelFunctions functions(copy);
  const auto tape = [&](ModelFunction function) {
    return Tape(*copy.graph, functions.inputs(function), functions.results(function), copy.options);
  };
  const auto tapes = std::make_shared<const RatesTapes>(RatesTapes{.rates = tape(ModelFunction::rates),
                                                                   .slopes = tape(ModelFunction::rates_jacobian),
                                                                   .bends = tape(ModelFunction::rates_hessian)});
  const auto count = [](const std::vector<int>& list) { return static_cast<int>(list.size()); };
  const StagedSteps staged(tapes, count(copy.states), count(copy.parameters), count(copy.inputs), ramp);
  return of.emplace(
      Operations{staged.operations(false, false), staged.operations(true, false), staged.operations(true, true)});
}

bool ModelFunctions::is_whole(ModelFunction function) {
  if (function > ModelFunction::ramp_hessian) return true;
  const auto [found, is_new] = is_whole_.emplace(function, false);
  if (!is_new) return found->second;
  const bool ramp = is_ramp(function);
  const int which = static_cast<int>(function) - static_cast<int>(ramp ? ModelFunction::ramp : ModelFunction::step);
  if (which > 0 && !is_whole(static_cast<ModelFunction>(static_cast<int>(function) - 1))) return false;
  if (is_far_too_long(staged_operations(ramp)[static_cast<std::size_t>(which)])) return false;
  const std::vector<int> made = results(function);
  const bool is_short =
      vehicle_.graph->count_operations(made) <= longest_step ||
      Tape(*vehicle_.graph, inputs(function), made, vehicle_.options).instruction_count() <= longest_step;
  return is_whole_[function] = is_short;
}

std::vector<int> ModelFunctions::inputs(ModelFunction function) {
  switch (function) {
    case ModelFunction::outputs:
    case ModelFunction::output_jacobian:
      return vehicle_.states;
    case ModelFunction::output_hessian:
      return joined(vehicle_.states, outputs().weights);
    case ModelFunction::rates:
    case ModelFunction::rates_jacobian:
      return arguments_of(vehicle_);
    case ModelFunction::rates_hessian:
      return joined(arguments_of(vehicle_), rates().weights);
    default:
      return step(is_ramp(function)).arguments();
  }
}

std::vector<int> ModelFunctions::results(ModelFunction function) {
  switch (function) {
    case ModelFunction::outputs:
      return outputs().values;
    case ModelFunction::output_jacobian:
      return joined(outputs().values, outputs().jacobian.nodes);
    case ModelFunction::output_hessian:
      return outputs().hessian.nodes;
    case ModelFunction::rates:
      return vehicle_.rates;
    case ModelFunction::rates_jacobian:
      return joined(vehicle_.rates, rates().jacobian.nodes);
    case ModelFunction::rates_hessian:
      return rates().hessian.nodes;
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
  Hash all;
  std::vector<int> variables = option_nodes(vehicle);
  all.add(static_cast<int>(variables.size()));
  for (const auto* list : {&vehicle.states, &vehicle.parameters, &vehicle.inputs}) {
    all.add(static_cast<int>(list->size()));
    variables.insert(variables.end(), list->begin(), list->end());
  }
  const std::vector<int> results = joined(vehicle.rates, vehicle.outputs);
  const std::unordered_map<int, std::uint64_t> meanings = meanings_of(*vehicle.graph, results, variables);
  all.add(static_cast<int>(vehicle.rates.size()));
  for (const int node : results) all.add(meanings.at(node));
  return all.value();
}

ModelCode write_model_code(const VehicleGraph& given, const std::string& prefix, const std::string& formula,
                           const std::vector<std::string>& sets, int most) {
  const VehicleGraph vehicle = formula_copy(given);  // as a model has it, so that the same is made of it
  ModelFunctions functions(vehicle);
  StraightWriter writer(*vehicle.graph, option_nodes(vehicle), most);
  bool is_any_staged = false;
  for (int k = 0; k < static_cast<int>(ModelFunction::count); ++k) {
    const auto function = static_cast<ModelFunction>(k);
    if (function >= ModelFunction::rates && !is_any_staged) break;
    // Without parameters there is nothing that could run along an interval.
    const bool is_needed = !is_ramp(function) || !vehicle.parameters.empty();
    const bool is_staged = is_needed && !functions.is_whole(function);
    is_any_staged |= is_staged;
    if (!is_needed || is_staged)
      writer.skip();
    else
      writer.add(std::string(name_of(function)), functions.inputs(function), functions.results(function));
  }
  const std::string about =
      fmt::format("The formula {} and its derivatives as straight code, written by rhec; changes are lost.", formula);
  return {writer.kernels(prefix, about), writer.table(prefix, about, fingerprint_of(vehicle), sets)};
}

}  // namespace rhec
