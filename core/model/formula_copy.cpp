#include "rhec/core/model/formula_copy.hpp"

#include <cstddef>
#include <numeric>
#include <vector>

#include "rhec/core/formula/graph_copy.hpp"

namespace rhec {

VehicleGraph formula_copy(const VehicleGraph& vehicle) {
  std::vector<int> all(vehicle.outputs.size());
  std::iota(all.begin(), all.end(), 0);
  return formula_copy(vehicle, all);
}

VehicleGraph formula_copy(const VehicleGraph& vehicle, std::span<const int> chosen_outputs) {
  VehicleGraph made;
  const Graph& from = *vehicle.graph;
  Graph& to = *made.graph;
  std::vector<int> known, known_there;
  const auto copy_input = [&](int node) {
    known.push_back(node);
    known_there.push_back(to.input(from.name_of(node)));
    return known_there.back();
  };
  for (const Tape::Known& option : vehicle.options) made.options.push_back({copy_input(option.node), option.value});
  for (const int node : vehicle.states) made.states.push_back(copy_input(node));
  for (const int node : vehicle.inputs) made.inputs.push_back(copy_input(node));
  for (const int node : vehicle.parameters) made.parameters.push_back(copy_input(node));
  std::vector<int> results = vehicle.rates;
  for (const int output : chosen_outputs) results.push_back(vehicle.outputs[output]);
  const std::vector<int> copies = copy_nodes(from, results, to, known, known_there);
  const auto outputs = copies.begin() + static_cast<std::ptrdiff_t>(vehicle.rates.size());
  made.rates.assign(copies.begin(), outputs);
  made.outputs.assign(outputs, copies.end());
  if (const auto& straight = vehicle.straight) {
    StraightMotion& motion = made.straight.emplace();
    motion.ground_speed = copy_input(straight->ground_speed);
    const auto copied = [&](int node) { return copy_nodes(from, {&node, 1}, to, known, known_there).front(); };
    for (const int node : straight->states) motion.states.push_back(node < 0 ? -1 : copied(node));
    for (const int node : straight->inputs) motion.inputs.push_back(copied(node));
  }
  return made;
}

}  // namespace rhec
