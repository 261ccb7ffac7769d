#include "rhec/core/model/motion_outputs.hpp"

#include <algorithm>
#include <cstddef>

#include <fmt/format.h>

#include "rhec/core/base/error.hpp"
#include "rhec/core/base/reserve.hpp"
#include "rhec/core/formula/derivatives.hpp"
#include "rhec/core/model/formula_copy.hpp"

namespace rhec {
namespace {

constexpr int motion_lanes = 8;
constexpr std::size_t most_motion_stack = std::size_t{1} << 14;  ///< doubles

}  // namespace

std::vector<int> outputs_of_motion(const VehicleGraph& vehicle) {
  std::vector<int> made;
  for (std::size_t j = 0; j < vehicle.outputs.size(); ++j) {
    const std::vector<int> reached = vehicle.graph->reach({&vehicle.outputs[j], 1});
    const auto is_reached = [&](int node) { return std::binary_search(reached.begin(), reached.end(), node); };
    if (std::any_of(vehicle.inputs.begin(), vehicle.inputs.end(), is_reached) ||
        std::any_of(vehicle.parameters.begin(), vehicle.parameters.end(), is_reached))
      made.push_back(static_cast<int>(j));
  }
  return made;
}

std::vector<int> outputs_of_motion(const Model& model) {
  const VehicleGraph* const graph = model.graph();
  return graph ? outputs_of_motion(*graph) : std::vector<int>{};
}

MotionOutputs::MotionOutputs(const Model& model)
    : which_(outputs_of_motion(model)),
      nx_(model.state_count()),
      nu_(model.input_count()),
      np_(model.parameter_count()),
      kernels_(runnable_tape_kernels().back()) {
  if (which_.empty()) return;
  // Derivatives are made in a copy.
  const VehicleGraph vehicle = formula_copy(*model.graph(), which_);
  if (std::ssize(vehicle.states) != nx_ || std::ssize(vehicle.inputs) != nu_ || std::ssize(vehicle.parameters) != np_)
    throw Error(
        fmt::format("model '{}': its graph has other variables than the model, so that its outputs of motion "
                    "cannot be made of it; expected a graph of the model itself",
                    model.description().name));
  Graph& graph = *vehicle.graph;
  std::vector<int> z = vehicle.states;
  z.insert(z.end(), vehicle.inputs.begin(), vehicle.inputs.end());
  z.insert(z.end(), vehicle.parameters.begin(), vehicle.parameters.end());
  std::vector<int> slopes = vehicle.outputs;
  const NodeMatrix first = rhec::jacobian(graph, vehicle.outputs, z);
  slopes.insert(slopes.end(), first.nodes.begin(), first.nodes.end());
  jacobian_ = Tape(graph, z, slopes, vehicle.options);
  std::vector<int> weights;
  weights.reserve(which_.size());
  for (int j = 0; j < count(); ++j) weights.push_back(graph.input("weight"));
  const NodeMatrix second = weighted_hessian(graph, vehicle.outputs, weights, z);
  z.insert(z.end(), weights.begin(), weights.end());
  hessian_ = Tape(graph, z, second.nodes, vehicle.options);
  const std::size_t registers = std::max(jacobian_.scratch(motion_lanes), hessian_.scratch(motion_lanes));
  if (registers > most_motion_stack) reserve_ = std::make_shared<Reserve>(registers);
}

void MotionOutputs::evaluate(const Points& request) const noexcept {
  if (which_.empty()) return;
  if (reserve_) return reserve_->lend([&](double* memory) { evaluate(request, memory); });
  // Memory of a size that is known at run time only, without an allocation.
  const std::size_t size = std::max(jacobian_.scratch(motion_lanes), hessian_.scratch(motion_lanes)) * sizeof(double);
  evaluate(request, static_cast<double*>(__builtin_alloca_with_align(size, 512)));
}

void MotionOutputs::evaluate(const Points& q, double* registers) const noexcept {
  constexpr int lanes = motion_lanes;
  const std::ptrdiff_t nm = count(), nz = nx_ + nu_ + np_;
  for (int first = 0; first < q.count; first += lanes) {
    const int here = std::min(lanes, q.count - first);
    double* next = registers;
    const auto load = [&](const double* rows, std::ptrdiff_t columns) {
      rows += first * columns;
      for (std::ptrdiff_t c = 0; c < columns; ++c, next += lanes)
        for (int i = 0; i < lanes; ++i) next[i] = rows[std::min(i, here - 1) * columns + c];
    };
    const auto load_variables = [&] {
      next = registers;
      load(q.states, nx_);
      load(q.inputs, nu_);
      load(q.parameters, np_);
    };
    if (q.outputs || q.jacobians) {
      load_variables();
      jacobian_.run(*kernels_, registers, lanes, here);
      for (int i = 0; i < here; ++i) {
        for (std::ptrdiff_t j = 0; q.outputs && j < nm; ++j)
          q.outputs[(first + i) * nm + j] = jacobian_.result(j, registers, lanes, i);
        for (std::ptrdiff_t j = 0; q.jacobians && j < nm; ++j)
          for (std::ptrdiff_t c = 0; c < nz; ++c)
            q.jacobians[((first + i) * nz + c) * nm + j] = jacobian_.result(nm + j * nz + c, registers, lanes, i);
      }
    }
    if (!q.hessians) continue;
    load_variables();
    load(q.multipliers, nm);
    hessian_.run(*kernels_, registers, lanes, here);
    for (int i = 0; i < here; ++i)
      for (std::ptrdiff_t k = 0; k < nz * nz; ++k)
        q.hessians[(first + i) * nz * nz + k] = hessian_.result(k, registers, lanes, i);
  }
}

void refuse_outputs_of_motion(const Model& model, const char* user) {
  const std::vector<int> of_motion = outputs_of_motion(model);
  if (of_motion.empty()) return;
  const ModelDescription& about = model.description();
  throw Error(
      fmt::format("{}: the output '{}' of model '{}' depends on the input or on slip, and here outputs are "
                  "those of the state; make a SensorModel of the model",
                  user, about.outputs[of_motion.front()].name, about.name));
}

}  // namespace rhec
