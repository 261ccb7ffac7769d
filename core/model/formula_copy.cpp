#include "rhec/core/model/formula_copy.hpp"

#include <cstddef>
#include <numeric>
#include <utility>
#include <vector>

#include "rhec/core/formula/graph_copy.hpp"

namespace rhec {
namespace {

/// A new graph with the variables and options of a vehicle, and copies of nodes of it.
class Copies {
 public:
  explicit Copies(const VehicleGraph& vehicle) : from_(*vehicle.graph) {
    for (const Tape::Known& option : vehicle.options) made.options.push_back({input(option.node), option.value});
    for (const int node : vehicle.states) made.states.push_back(input(node));
    for (const int node : vehicle.inputs) made.inputs.push_back(input(node));
    for (const int node : vehicle.parameters) made.parameters.push_back(input(node));
  }
  int input(int node) {
    known_.push_back(node);
    known_there_.push_back(made.graph->input(from_.name_of(node)));
    return known_there_.back();
  }
  std::vector<int> of(const std::vector<int>& nodes) const {
    return copy_nodes(from_, nodes, *made.graph, known_, known_there_);
  }

  VehicleGraph made;

 private:
  const Graph& from_;
  std::vector<int> known_, known_there_;
};

}  // namespace

VehicleGraph formula_copy(const VehicleGraph& vehicle) {
  std::vector<int> all(vehicle.outputs.size());
  std::iota(all.begin(), all.end(), 0);
  return formula_copy(vehicle, all);
}

VehicleGraph formula_copy(const VehicleGraph& vehicle, std::span<const int> chosen_outputs) {
  Copies copies(vehicle);
  std::vector<int> results = vehicle.rates;
  for (const int output : chosen_outputs) results.push_back(vehicle.outputs[output]);
  const std::vector<int> copied = copies.of(results);
  const auto outputs = copied.begin() + static_cast<std::ptrdiff_t>(vehicle.rates.size());
  copies.made.rates.assign(copied.begin(), outputs);
  copies.made.outputs.assign(outputs, copied.end());
  return std::move(copies.made);
}

VehicleGraph motion_copy(const VehicleGraph& vehicle) {
  Copies copies(vehicle);
  const StraightMotion& from = vehicle.straight.value();
  StraightMotion motion{.ground_speed = copies.input(from.ground_speed), .states = {}, .inputs = {}};
  std::vector<int> results = from.inputs;
  for (const int node : from.states)
    if (node >= 0) results.push_back(node);
  const std::vector<int> copied = copies.of(results);
  auto next = copied.begin() + static_cast<std::ptrdiff_t>(from.inputs.size());
  motion.inputs.assign(copied.begin(), next);
  for (const int node : from.states) motion.states.push_back(node >= 0 ? *next++ : -1);
  copies.made.straight = std::move(motion);
  return std::move(copies.made);
}

}  // namespace rhec
