#include "rhec/core/model/graph_model.hpp"

#include <algorithm>
#include <array>
#include <utility>

#include <fmt/format.h>

#include "graph_steps.hpp"
#include "rhec/core/base/assertion.hpp"
#include "rhec/core/base/error.hpp"
#include "rhec/core/base/padded.hpp"
#include "rhec/core/base/scratch.hpp"
#include "rhec/core/formula/derivatives.hpp"
#include "rhec/core/model/formula_model.hpp"

// Memory of a size that is known at run time only, without an allocation.
#define RHEC_STACK(size) (static_cast<double*>(__builtin_alloca_with_align((size) * sizeof(double), 512)))

namespace rhec {
namespace {

template <class... Lists>
std::vector<int> joined(const Lists&... lists) {
  std::vector<int> all;
  (all.insert(all.end(), lists.begin(), lists.end()), ...);
  return all;
}

/// The sources of `rows` rows of `columns` results each, padded.
std::vector<int> padded_rows(const Tape& tape, int first, int rows, int columns) {
  std::vector<int> sources(static_cast<std::size_t>(rows) * padded(columns), Tape::zero);
  for (int r = 0; r < rows; ++r)
    for (int c = 0; c < columns; ++c) sources[r * padded(columns) + c] = tape.results()[first + r * columns + c];
  return sources;
}

/// Calls evaluate(first, count, lanes) for the rows that are evaluated together.
template <class Evaluate>
void for_each_block(int rows, Evaluate evaluate) {
  for (int first = 0; first < rows;) {
    const int lanes = lanes_for(rows - first), count = std::min(lanes, rows - first);
    evaluate(first, count, lanes);
    first += count;
  }
}

}  // namespace

GraphModel::StepTapes::StepTapes(const VehicleGraph& vehicle, bool ramp) {
  const StepGraph step = StepGraph::make(vehicle, ramp);
  const std::vector<int> arguments = step.arguments();
  const auto tape = [&](const std::vector<int>& results) {
    return Tape(*vehicle.graph, arguments, results, vehicle.options);
  };
  values = tape(step.next);
  jacobians = tape(joined(step.next, step.jacobian.nodes));
  hessians = tape(joined(step.next, step.jacobian.nodes, step.hessian.nodes));
  const int nx = step.jacobian.rows, nz = step.jacobian.columns;
  next_of_values = padded_rows(values, 0, 1, nx);
  next_of_jacobians = padded_rows(jacobians, 0, 1, nx);
  next_of_hessians = padded_rows(hessians, 0, 1, nx);
  rows_of_jacobians = padded_rows(jacobians, nx, nx, nz);
  jacobian_of_hessians = padded_rows(hessians, nx, nx, nz);
  hessian_of_hessians = padded_rows(hessians, nx + nx * nz, nz, nz);
}

GraphModel::GraphModel(const VehicleGraph& vehicle, ModelDescription description, const StraightMotion* straight)
    : description_(std::move(description)),
      n_{static_cast<int>(vehicle.states.size()), static_cast<int>(vehicle.inputs.size()),
         static_cast<int>(vehicle.parameters.size()), static_cast<int>(vehicle.outputs.size())},
      kernels_(runnable_tape_kernels().back()) {
  check_description(description_, {.states = n_.x, .inputs = n_.u, .parameters = n_.p, .outputs = n_.y});
  steady_ = StepTapes(vehicle, false);
  if (n_.p > 0) ramped_ = StepTapes(vehicle, true);
  Graph& graph = *vehicle.graph;
  const auto tape = [&](const std::vector<int>& inputs, const std::vector<int>& results) {
    return Tape(graph, inputs, results, vehicle.options);
  };
  rates_ = tape(joined(vehicle.states, vehicle.parameters, vehicle.inputs), vehicle.rates);
  outputs_ = tape(vehicle.states, vehicle.outputs);
  const NodeMatrix slopes = jacobian(graph, vehicle.outputs, vehicle.states);
  output_jacobians_ = tape(vehicle.states, joined(vehicle.outputs, slopes.nodes));
  std::vector<int> weights;
  weights.reserve(static_cast<std::size_t>(n_.y));
  for (int j = 0; j < n_.y; ++j) weights.push_back(graph.input("weight"));
  const NodeMatrix bends = weighted_hessian(graph, vehicle.outputs, weights, vehicle.states);
  std::vector<int> curvature;
  for (int r = 0; r < n_.x; ++r) {
    for (int c = 0; c <= r; ++c) {
      if (graph.is_constant(bends.at(r, c), 0.0)) continue;
      curved_.push_back(r * n_.x + c);
      curvature.push_back(bends.at(r, c));
    }
  }
  output_hessians_ = tape(joined(vehicle.states, weights), curvature);
  if (straight) {
    std::vector<int> results = straight->inputs;
    for (int j = 0; j < n_.x; ++j) {
      if (straight->states[j] < 0) continue;
      straight_states_.push_back(j);
      results.push_back(straight->states[j]);
    }
    straight_ = tape(joined(std::vector<int>{straight->ground_speed}, vehicle.parameters), results);
  }

  std::size_t registers = 0;
  for (const Tape* each : {&steady_.hessians, &ramped_.hessians, &steady_.jacobians, &ramped_.jacobians, &rates_,
                           &outputs_, &output_jacobians_, &output_hessians_, &straight_})
    registers = std::max(registers, each->scratch(GraphSteps::lanes));
  stack_ = registers + GraphSteps::memory(n_.x, n_.z(true));
  if (stack_ > most_stack)
    throw Error(
        fmt::format("model '{}': its step of {} states with second derivatives takes {} numbers for {} rows; "
                    "expected at most {}; write it with fewer states or terms",
                    description_.name, n_.x, stack_, GraphSteps::lanes, most_stack));
}

void GraphModel::integrate(const Intervals& q) const noexcept {
  RHEC_ASSERT(q.count >= 0 && q.substeps >= 1, "whole intervals and Runge-Kutta steps");
  RHEC_ASSERT(q.count == 0 || (q.states && q.durations), "where to integrate");
  RHEC_ASSERT(q.count == 0 || !q.hessians || q.multipliers, "second derivatives are weighted by multipliers");
  if (q.substeps == 1 && !q.parameters_end && !q.jacobians && !q.hessians) return integrate_values(q);
  const StepTapes& of = tapes(GraphSteps::is_ramp(q, n_.p));
  GraphSteps steps({&of.values, &of.jacobians, &of.hessians, kernels_, n_.x, n_.u, n_.p}, q, RHEC_STACK(stack_));
  for (int first = 0; first < q.count; first += GraphSteps::lanes)
    steps.integrate(first, std::min(GraphSteps::lanes, q.count - first));
}

/// One step without derivatives, as the defects of each iterate need it: as many rows at once as the stack holds.
void GraphModel::integrate_values(const Intervals& q) const noexcept {
  const Tape& tape = steady_.values;
  double* const registers = RHEC_STACK(stack_);
  const int most = tape.scratch(32) <= stack_ ? 32 : tape.scratch(16) <= stack_ ? 16 : 8;
  for (int first = 0, count = 0; first < q.count; first += count) {
    const int lanes = std::min(lanes_for(q.count - first), most);
    count = std::min(lanes, q.count - first);
    double* next = registers;
    const auto load = [&](const double* rows, int columns) {
      rows += static_cast<std::ptrdiff_t>(first) * columns;
      for (int c = 0; c < columns; ++c, next += lanes) {
        for (int i = 0; i < count; ++i) next[i] = rows[i * columns + c];
        std::fill(next + count, next + lanes, next[count - 1]);
      }
    };
    load(q.states, n_.x);
    load(q.parameters, n_.p);
    load(q.inputs, n_.u);
    load(q.durations, 1);
    tape.run(*kernels_, registers, lanes);
    for (int j = 0; q.next_states && j < n_.x; ++j) {
      double* const out = q.next_states + static_cast<std::ptrdiff_t>(first) * n_.x + j;
      for (int i = 0; i < count; ++i) out[i * n_.x] = tape.result(j, registers, lanes, i);
    }
  }
}

void GraphModel::integrate_rows(const IntervalRows& q) const noexcept {
  if (q.substeps != 1) return Model::integrate_rows(q);
  const bool ramp = q.ramp && n_.p > 0;
  const StepTapes& of = tapes(ramp);
  const int nz = n_.z(ramp);
  const Tape& tape = q.hessians ? of.hessians : q.jacobians ? of.jacobians : of.values;
  const std::vector<int>& next = q.hessians    ? of.next_of_hessians
                                 : q.jacobians ? of.next_of_jacobians
                                               : of.next_of_values;
  const std::vector<int>& rows = q.hessians ? of.jacobian_of_hessians : of.rows_of_jacobians;
  double* const registers = Scratch(q.scratch).take(0);
  for_each_block(q.count, [&](int first, int count, int lanes) {
    const auto at = [&](int which) { return registers + static_cast<std::ptrdiff_t>(which) * lanes; };
    kernels_->load_rows(q.z + first * q.z_step, q.z_step, count, nz, registers, lanes);
    int argument = nz;
    for (int i = 0; i < lanes; ++i) at(argument)[i] = q.durations[first + std::min(i, count - 1)];
    ++argument;
    if (ramp) {
      std::fill_n(at(argument++), lanes, 0.0);
      std::fill_n(at(argument++), lanes, 1.0);
    }
    if (q.hessians)
      kernels_->load_rows(q.multipliers + first * q.multiplier_step, q.multiplier_step, count, n_.x, at(argument),
                          lanes);
    tape.run(*kernels_, registers, lanes);
    const auto store_row = [&](const int* sources, int columns, double* row, std::ptrdiff_t step) {
      for (int c = 0; c < padded(columns); c += 8)
        kernels_->store_eight(sources + c, tape.uniforms().data(), registers, lanes, row + c, step, count);
    };
    if (q.next_states) store_row(next.data(), n_.x, q.next_states + first * q.next_step, q.next_step);
    for (int r = 0; q.jacobians && r < n_.x; ++r)
      store_row(rows.data() + static_cast<std::ptrdiff_t>(r) * padded(nz), nz,
                q.jacobians + first * q.jacobian_step + r * q.jacobian_row, q.jacobian_step);
    for (int r = 0; q.hessians && r < nz; ++r)
      store_row(of.hessian_of_hessians.data() + static_cast<std::ptrdiff_t>(r) * padded(nz), nz,
                q.hessians + first * q.hessian_step + r * q.hessian_row, q.hessian_step);
  });
}

std::size_t GraphModel::rows_scratch(int count) const noexcept {
  const int lanes = lanes_for(count);
  std::size_t registers = 0;
  for (const Tape* tape : {&steady_.hessians, &ramped_.hessians, &steady_.jacobians, &ramped_.jacobians,
                           &steady_.values, &ramped_.values, &outputs_, &output_jacobians_, &output_hessians_})
    registers = std::max(registers, tape->scratch(lanes));
  return std::max(registers + 7, Model::rows_scratch(count));
}

void GraphModel::rates(const double* x, const double* u, const double* p, double* dxdt) const noexcept {
  constexpr int lanes = GraphSteps::lanes;
  double* const registers = RHEC_STACK(stack_);
  double* next = registers;
  const auto load = [&](const double* values, int count) {
    for (int j = 0; j < count; ++j, next += lanes) std::fill_n(next, lanes, values[j]);
  };
  load(x, n_.x);
  load(p, n_.p);
  load(u, n_.u);
  rates_.run(*kernels_, registers, lanes);
  for (int j = 0; j < n_.x; ++j) dxdt[j] = rates_.result(j, registers, lanes, 0);
}

void GraphModel::straight_motion(double ground_speed, const double* p, double* state, double* inputs) const noexcept {
  if (straight_.results().empty()) return Model::straight_motion(ground_speed, p, state, inputs);
  constexpr int lanes = GraphSteps::lanes;
  double* const registers = RHEC_STACK(stack_);
  std::fill_n(registers, lanes, ground_speed);
  for (int j = 0; j < n_.p; ++j) std::fill_n(registers + (1 + j) * lanes, lanes, p[j]);
  straight_.run(*kernels_, registers, lanes);
  for (int j = 0; j < n_.u; ++j) inputs[j] = straight_.result(j, registers, lanes, 0);
  for (std::size_t k = 0; k < straight_states_.size(); ++k)
    state[straight_states_[k]] = straight_.result(n_.u + k, registers, lanes, 0);
}

void GraphModel::observe(const Nodes& q) const noexcept {
  RHEC_ASSERT(q.count == 0 || (q.count > 0 && q.states), "where to observe");
  RHEC_ASSERT(q.count == 0 || !q.hessians || q.multipliers, "second derivatives are weighted by multipliers");
  double* const registers = RHEC_STACK(stack_);
  constexpr int lanes = GraphSteps::lanes;
  for (int first = 0; first < q.count; first += lanes) {
    const int count = std::min(lanes, q.count - first);
    load_columns(q.states + static_cast<std::ptrdiff_t>(first) * n_.x, n_.x, count, registers);
    const auto store = [&](const Tape& tape, int result, double* out, int size, int entry) {
      for (int i = 0; i < count; ++i)
        out[static_cast<std::ptrdiff_t>(first + i) * size + entry] = tape.result(result, registers, lanes, i);
    };
    if (q.outputs || q.jacobians) {
      const Tape& tape = q.jacobians ? output_jacobians_ : outputs_;
      tape.run(*kernels_, registers, lanes);
      for (int j = 0; q.outputs && j < n_.y; ++j) store(tape, j, q.outputs, n_.y, j);
      for (int j = 0; q.jacobians && j < n_.y; ++j)
        for (int c = 0; c < n_.x; ++c) store(tape, n_.y + j * n_.x + c, q.jacobians, n_.y * n_.x, c * n_.y + j);
    }
    if (!q.hessians) continue;
    const int size = n_.x * n_.x;
    std::fill_n(q.hessians + static_cast<std::ptrdiff_t>(first) * size, static_cast<std::ptrdiff_t>(count) * size, 0.0);
    load_columns(q.states + static_cast<std::ptrdiff_t>(first) * n_.x, n_.x, count, registers);
    load_columns(q.multipliers + static_cast<std::ptrdiff_t>(first) * n_.y, n_.y, count, registers + n_.x * lanes);
    output_hessians_.run(*kernels_, registers, lanes);
    for (std::size_t k = 0; k < curved_.size(); ++k) {
      const int r = curved_[k] / n_.x, c = curved_[k] % n_.x;
      store(output_hessians_, static_cast<int>(k), q.hessians, size, r * n_.x + c);
      store(output_hessians_, static_cast<int>(k), q.hessians, size, c * n_.x + r);
    }
  }
}

void GraphModel::observe_rows(const NodeRows& q) const noexcept {
  double* const registers = Scratch(q.scratch).take(0);
  for_each_block(q.count, [&](int first, int count, int lanes) {
    const auto load_states = [&] {
      kernels_->load_rows(q.states + first * q.state_step, q.state_step, count, n_.x, registers, lanes);
    };
    if (q.outputs || q.jacobians) {
      const Tape& tape = q.jacobians ? output_jacobians_ : outputs_;
      load_states();
      tape.run(*kernels_, registers, lanes);
      store_outputs(q, first, count, tape, registers, lanes);
    }
    if (!q.hessians || curved_.empty()) return;
    load_states();
    set_weights(q, first, count, registers, lanes);
    output_hessians_.run(*kernels_, registers, lanes);
    add_curvature(q, first, count, registers, lanes);
  });
}

void GraphModel::store_outputs(const NodeRows& q, int first, int count, const Tape& tape, const double* registers,
                               int lanes) const noexcept {
  const int chosen_count = q.chosen ? q.chosen_count : n_.y;
  const auto store = [&](const std::array<int, 8>& sources, double* rows, std::ptrdiff_t step) {
    kernels_->store_eight(sources.data(), tape.uniforms().data(), registers, lanes, rows, step, count);
  };
  std::array<int, 8> sources;
  for (int from = 0; q.outputs && from < chosen_count; from += 8) {
    for (int k = 0; k < 8; ++k) {
      const int j = from + k;
      sources[k] = j < chosen_count ? tape.results()[q.chosen ? q.chosen[j] : j] : Tape::zero;
    }
    store(sources, q.outputs + first * q.output_step + from, q.output_step);
  }
  for (int j = 0; q.jacobians && j < chosen_count; ++j) {
    const int* const row =
        tape.results().data() + n_.y + static_cast<std::ptrdiff_t>(q.chosen ? q.chosen[j] : j) * n_.x;
    double* const out = q.jacobians + (static_cast<std::ptrdiff_t>(first) * chosen_count + j) * q.jacobian_row;
    for (int from = 0; from < n_.x; from += 8) {
      for (int k = 0; k < 8; ++k) sources[k] = from + k < n_.x ? row[from + k] : Tape::zero;
      store(sources, out + from, chosen_count * q.jacobian_row);
    }
  }
}

/// The multipliers of the chosen outputs; those of all others are zero.
void GraphModel::set_weights(const NodeRows& q, int first, int count, double* registers, int lanes) const noexcept {
  double* const weights = registers + static_cast<std::ptrdiff_t>(n_.x) * lanes;
  std::fill_n(weights, n_.y * lanes, 0.0);
  const int chosen_count = q.chosen ? q.chosen_count : n_.y;
  for (int j = 0; j < chosen_count; ++j) {
    double* const weight = weights + static_cast<std::ptrdiff_t>(q.chosen ? q.chosen[j] : j) * lanes;
    for (int i = 0; i < count; ++i) weight[i] = q.multipliers[(first + i) * q.multiplier_step + j];
  }
}

void GraphModel::add_curvature(const NodeRows& q, int first, int count, const double* registers,
                               int lanes) const noexcept {
  for (std::size_t k = 0; k < curved_.size(); ++k) {
    const int r = curved_[k] / n_.x, c = curved_[k] % n_.x;
    for (int i = 0; i < count; ++i) {
      const double bend = output_hessians_.result(k, registers, lanes, i);
      double* const hessian = q.hessians + (first + i) * q.hessian_step;
      hessian[r * q.hessian_row + c] += bend;
      if (r != c) hessian[c * q.hessian_row + r] += bend;
    }
  }
}

std::vector<std::string> GraphModel::instruction_sets() const {
  std::vector<std::string> names;
  for (const TapeKernels* kernels : runnable_tape_kernels()) names.emplace_back(kernels->name);
  return names;
}

bool GraphModel::use_instruction_set(const std::string& wanted) {
  for (const TapeKernels* kernels : runnable_tape_kernels()) {
    if (kernels->name != wanted) continue;
    kernels_ = kernels;
    return true;
  }
  return false;
}

}  // namespace rhec
