#include "rhec/core/model/graph_model.hpp"

#include <algorithm>
#include <utility>

#include "graph_steps.hpp"
#include "rhec/core/base/assertion.hpp"
#include "rhec/core/base/reserve.hpp"
#include "rhec/core/base/scratch.hpp"
#include "rhec/core/model/formula_copy.hpp"
#include "rhec/core/model/model_functions.hpp"
#include "staged_steps.hpp"

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

/// Calls evaluate(first, count, lanes) for the rows that a tape evaluates together.
template <class Evaluate>
void for_each_block(const Tape& tape, int rows, Evaluate evaluate) {
  for (int first = 0; first < rows;) {
    const int lanes = tape.lanes(rows - first), count = std::min(lanes, rows - first);
    evaluate(first, count, lanes);
    first += count;
  }
}

}  // namespace

GraphModel::GraphModel(const VehicleGraph& vehicle, ModelDescription description, const StraightCode* code)
    : vehicle_(formula_copy(vehicle)),
      description_(std::move(description)),
      n_{static_cast<int>(vehicle.states.size()), static_cast<int>(vehicle.inputs.size()),
         static_cast<int>(vehicle.parameters.size()), static_cast<int>(vehicle.outputs.size())},
      code_(code && code->fingerprint == fingerprint_of(vehicle_) ? code : nullptr) {
  check_description(description_, {.states = n_.x, .inputs = n_.u, .parameters = n_.p, .outputs = n_.y});
  rates_ = Tape(*vehicle_.graph, joined(vehicle_.states, vehicle_.parameters, vehicle_.inputs), vehicle_.rates,
                vehicle_.options);
  if (vehicle.straight) {
    const VehicleGraph motion = motion_copy(vehicle);
    const StraightMotion& straight = *motion.straight;
    std::vector<int> results = straight.inputs;
    for (int j = 0; j < n_.x; ++j) {
      if (straight.states[j] < 0) continue;
      straight_states_.push_back(j);
      results.push_back(straight.states[j]);
    }
    straight_ = Tape(*motion.graph, joined(std::vector<int>{straight.ground_speed}, motion.parameters), results,
                     motion.options);
  }
  GraphModel::use_instruction_set(GraphModel::instruction_sets().back());
}

template <class Use>
void GraphModel::with_memory(std::size_t size, Use use) const noexcept {
  if (size > most_stack) return reserve_->lend(use);
  use(RHEC_STACK(size));
}

void GraphModel::integrate(const Intervals& q) const noexcept {
  RHEC_ASSERT(q.count >= 0 && q.substeps >= 1, "whole intervals and Runge-Kutta steps");
  RHEC_ASSERT(q.count == 0 || (q.states && q.durations), "where to integrate");
  RHEC_ASSERT(q.count == 0 || !q.hessians || q.multipliers, "second derivatives are weighted by multipliers");
  const StepTapes& of = steps(GraphSteps::is_ramp(q, n_.p));
  if (q.substeps == 1 && !q.parameters_end && !q.jacobians && !q.hessians && !of.values.results().empty())
    return integrate_values(q);
  if (is_staged(of, q.substeps, q.jacobians != nullptr, q.hessians != nullptr))
    return with_memory(of.staged->memory(), [&](double* memory) { of.staged->integrate(q, *kernels_, memory); });
  with_memory(memory_of_steps_, [&](double* memory) {
    GraphSteps steps({&of.values, &of.jacobians, &of.hessians, kernels_, n_.x, n_.u, n_.p}, q, memory);
    for (int first = 0; first < q.count; first += GraphSteps::lanes)
      steps.integrate(first, std::min(GraphSteps::lanes, q.count - first));
  });
}

/// One step without derivatives, as the defects of each iterate need it: as many rows at once as the stack holds.
void GraphModel::integrate_values(const Intervals& q) const noexcept {
  const Tape& tape = tapes_.steady.values;
  const int most = tape.scratch(32) <= most_stack ? 32 : tape.scratch(16) <= most_stack ? 16 : 8;
  with_memory(tape.scratch(most), [&](double* registers) {
    for (int first = 0, count = 0; first < q.count; first += count) {
      const int lanes = std::min(tape.lanes(q.count - first), most);
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
      tape.run(*kernels_, registers, lanes, count);
      for (int j = 0; q.next_states && j < n_.x; ++j) {
        double* const out = q.next_states + static_cast<std::ptrdiff_t>(first) * n_.x + j;
        for (int i = 0; i < count; ++i) out[i * n_.x] = tape.result(j, registers, lanes, i);
      }
    }
  });
}

bool GraphModel::is_staged(const StepTapes& of, int substeps, bool with_jacobian, bool with_hessian) noexcept {
  if (!of.staged || substeps > 1) return of.staged != nullptr;
  return (with_hessian ? of.hessians : with_jacobian ? of.jacobians : of.values).results().empty();
}

void GraphModel::integrate_rows(const IntervalRows& q) const noexcept {
  const bool ramp = q.ramp && n_.p > 0;
  const StepTapes& of = steps(ramp);
  if (is_staged(of, q.substeps, q.jacobians != nullptr, q.hessians != nullptr))
    return of.staged->integrate_rows(q, *kernels_, Scratch(q.scratch).take(0));
  if (q.substeps != 1) return Model::integrate_rows(q);
  const int nz = n_.z(ramp);
  const Tape& tape = q.hessians ? of.hessians : q.jacobians ? of.jacobians : of.values;
  const StoredRows& next = q.hessians ? of.next_of_hessians : q.jacobians ? of.next_of_jacobians : of.next_of_values;
  const StoredRows& rows = q.hessians ? of.jacobian_of_hessians : of.rows_of_jacobians;
  double* const registers = Scratch(q.scratch).take(0);
  for_each_block(tape, q.count, [&](int first, int count, int lanes) {
    const auto at = [&](int which) { return registers + static_cast<std::ptrdiff_t>(which) * lanes; };
    const int filled = tape.filled(lanes, count);
    kernels_->load_rows(q.z + first * q.z_step, q.z_step, count, nz, registers, lanes, filled);
    int argument = nz;
    double* const durations = at(argument);
    std::copy_n(q.durations + first, count, durations);
    std::fill(durations + count, durations + lanes, durations[count - 1]);
    ++argument;
    if (ramp) {
      std::fill_n(at(argument++), lanes, 0.0);
      std::fill_n(at(argument++), lanes, 1.0);
    }
    if (q.hessians)
      kernels_->load_rows(q.multipliers + first * q.multiplier_step, q.multiplier_step, count, n_.x, at(argument),
                          lanes, filled);
    tape.run(*kernels_, registers, lanes, count);
    const auto store = [&](const StoredRows& what, const RowPlaces& places) {
      kernels_->store_rows(what.all.data(), what.rows, what.eights, registers, lanes, places, count);
    };
    if (q.next_states) store(next, {q.next_states + first * q.next_step, q.next_step, 0});
    if (q.jacobians) store(rows, {q.jacobians + first * q.jacobian_step, q.jacobian_step, q.jacobian_row});
    if (q.hessians) store(of.hessian_of_hessians, {q.hessians + first * q.hessian_step, q.hessian_step, q.hessian_row});
  });
}

std::size_t GraphModel::rows_scratch(int count) const noexcept {
  const int lanes = std::max(tapes_.outputs.lanes(count), lanes_for(count));
  std::size_t most = static_cast<std::size_t>(tapes_.most_registers) * lanes;
  for (const StepTapes* each : {&tapes_.steady, &tapes_.ramped})
    if (each->staged) most = std::max(most, each->staged->memory());
  // Several whole steps go by way of dense rows.
  return tapes_.steady.staged ? most + 7 : std::max(most + 7, Model::rows_scratch(count));
}

void GraphModel::rates(const double* x, const double* u, const double* p, double* dxdt) const noexcept {
  constexpr int lanes = GraphSteps::lanes;
  with_memory(rates_.scratch(lanes), [&](double* registers) {
    double* next = registers;
    const auto load = [&](const double* values, int count) {
      for (int j = 0; j < count; ++j, next += lanes) std::fill_n(next, lanes, values[j]);
    };
    load(x, n_.x);
    load(p, n_.p);
    load(u, n_.u);
    rates_.run(*kernels_, registers, lanes, 1);
    for (int j = 0; j < n_.x; ++j) dxdt[j] = rates_.result(j, registers, lanes, 0);
  });
}

void GraphModel::straight_motion(double ground_speed, const double* p, double* state, double* inputs) const noexcept {
  if (straight_.results().empty()) return Model::straight_motion(ground_speed, p, state, inputs);
  constexpr int lanes = GraphSteps::lanes;
  with_memory(straight_.scratch(lanes), [&](double* registers) {
    std::fill_n(registers, lanes, ground_speed);
    for (int j = 0; j < n_.p; ++j) std::fill_n(registers + (1 + j) * lanes, lanes, p[j]);
    straight_.run(*kernels_, registers, lanes, 1);
    for (int j = 0; j < n_.u; ++j) inputs[j] = straight_.result(j, registers, lanes, 0);
    for (std::size_t k = 0; k < straight_states_.size(); ++k)
      state[straight_states_[k]] = straight_.result(n_.u + k, registers, lanes, 0);
  });
}

void GraphModel::observe(const Nodes& q) const noexcept {
  RHEC_ASSERT(q.count == 0 || (q.count > 0 && q.states), "where to observe");
  RHEC_ASSERT(q.count == 0 || !q.hessians || q.multipliers, "second derivatives are weighted by multipliers");
  const int registers =
      std::max(tapes_.outputs.register_count(), std::max(q.jacobians ? tapes_.output_jacobians.register_count() : 0,
                                                         q.hessians ? tapes_.output_hessians.register_count() : 0));
  with_memory(static_cast<std::size_t>(registers) * GraphSteps::lanes, [&](double* memory) {
    for (int first = 0; first < q.count; first += GraphSteps::lanes)
      observe(q, first, std::min(GraphSteps::lanes, q.count - first), memory);
  });
}

void GraphModel::observe(const Nodes& q, int first, int count, double* registers) const noexcept {
  constexpr int lanes = GraphSteps::lanes;
  const auto store = [&](const Tape& tape, int result, double* out, int size, int entry) {
    for (int i = 0; i < count; ++i)
      out[static_cast<std::ptrdiff_t>(first + i) * size + entry] = tape.result(result, registers, lanes, i);
  };
  load_columns(q.states + static_cast<std::ptrdiff_t>(first) * n_.x, n_.x, count, registers);
  if (q.outputs || q.jacobians) {
    const Tape& tape = q.jacobians ? tapes_.output_jacobians : tapes_.outputs;
    tape.run(*kernels_, registers, lanes, count);
    for (int j = 0; q.outputs && j < n_.y; ++j) store(tape, j, q.outputs, n_.y, j);
    for (int j = 0; q.jacobians && j < n_.y; ++j)
      for (int c = 0; c < n_.x; ++c) store(tape, n_.y + j * n_.x + c, q.jacobians, n_.y * n_.x, c * n_.y + j);
  }
  if (!q.hessians) return;
  const int size = n_.x * n_.x;
  std::fill_n(q.hessians + static_cast<std::ptrdiff_t>(first) * size, static_cast<std::ptrdiff_t>(count) * size, 0.0);
  load_columns(q.states + static_cast<std::ptrdiff_t>(first) * n_.x, n_.x, count, registers);
  load_columns(q.multipliers + static_cast<std::ptrdiff_t>(first) * n_.y, n_.y, count, registers + n_.x * lanes);
  tapes_.output_hessians.run(*kernels_, registers, lanes, count);
  for (const int entry : tapes_.curved) {
    const int r = entry / n_.x, c = entry % n_.x;
    store(tapes_.output_hessians, entry, q.hessians, size, r * n_.x + c);
    store(tapes_.output_hessians, entry, q.hessians, size, c * n_.x + r);
  }
}

void GraphModel::observe_rows(const NodeRows& q) const noexcept {
  double* const registers = Scratch(q.scratch).take(0);
  for_each_block(tapes_.outputs, q.count, [&](int first, int count, int lanes) {
    const auto load_states = [&] {
      kernels_->load_rows(q.states + first * q.state_step, q.state_step, count, n_.x, registers, lanes,
                          tapes_.outputs.filled(lanes, count));
    };
    if (q.outputs || q.jacobians) {
      const Tape& tape = q.jacobians ? tapes_.output_jacobians : tapes_.outputs;
      load_states();
      tape.run(*kernels_, registers, lanes, count);
      store_outputs(q, first, count, q.jacobians != nullptr, registers, lanes);
    }
    if (!q.hessians || tapes_.curved.empty()) return;
    load_states();
    set_weights(q, first, count, registers, lanes);
    tapes_.output_hessians.run(*kernels_, registers, lanes, count);
    add_curvature(q, first, count, registers, lanes);
  });
}

void GraphModel::store_outputs(const NodeRows& q, int first, int count, bool with_jacobians, const double* registers,
                               int lanes) const noexcept {
  const int chosen_count = q.chosen ? q.chosen_count : n_.y;
  const auto store = [&](const StoredEight* groups, int rows, int eights, const RowPlaces& places) {
    kernels_->store_rows(groups, rows, eights, registers, lanes, places, count);
  };
  if (q.outputs) {
    double* const to = q.outputs + first * q.output_step;
    const StoredRows& all = with_jacobians ? tapes_.values_of_output_jacobians : tapes_.output_values;
    if (!q.chosen) {
      store(all.row(0), 1, all.eights, {to, q.output_step, 0});
    } else {
      const Tape& tape = with_jacobians ? tapes_.output_jacobians : tapes_.outputs;
      for (int from = 0; from < chosen_count; from += 8) {
        const int here = std::min(8, chosen_count - from);
        StoredEight eight;
        eight.kind = here <= 4 ? StoredEight::Kind::first_4 : StoredEight::Kind::all;
        eight.sources.fill(tape.stored_zero());
        for (int k = 0; k < here; ++k) eight.sources[k] = tape.stored(q.chosen[from + k]);
        store(&eight, 1, 1, {to + from, q.output_step, 0});
      }
    }
  }
  if (!with_jacobians) return;
  for (int j = 0, next = 0; j < chosen_count; j = next) {
    const int from = q.chosen ? q.chosen[j] : j;
    // Outputs that follow each other are stored together.
    for (next = j + 1; next < chosen_count && (q.chosen ? q.chosen[next] : next) == from + next - j;) ++next;
    store(tapes_.output_slopes.row(from), next - j, tapes_.output_slopes.eights,
          {q.jacobians + (static_cast<std::ptrdiff_t>(first) * chosen_count + j) * q.jacobian_row,
           chosen_count * q.jacobian_row, q.jacobian_row});
  }
}

/// The multipliers of the chosen outputs, of which one may be there twice; those of all others are zero.
void GraphModel::set_weights(const NodeRows& q, int first, int count, double* registers, int lanes) const noexcept {
  double* const weights = registers + static_cast<std::ptrdiff_t>(n_.x) * lanes;
  std::fill_n(weights, n_.y * lanes, 0.0);
  const int chosen_count = q.chosen ? q.chosen_count : n_.y;
  for (int j = 0; j < chosen_count; ++j) {
    double* const weight = weights + static_cast<std::ptrdiff_t>(q.chosen ? q.chosen[j] : j) * lanes;
    for (int i = 0; i < count; ++i) weight[i] += q.multipliers[(first + i) * q.multiplier_step + j];
  }
}

void GraphModel::add_curvature(const NodeRows& q, int first, int count, const double* registers,
                               int lanes) const noexcept {
  for (const int entry : tapes_.curved) {
    const int r = entry / n_.x, c = entry % n_.x;
    for (int i = 0; i < count; ++i) {
      const double bend = tapes_.output_hessians.result(static_cast<std::size_t>(entry), registers, lanes, i);
      double* const hessian = q.hessians + (first + i) * q.hessian_step;
      hessian[r * q.hessian_row + c] += bend;
      if (r != c) hessian[c * q.hessian_row + r] += bend;
    }
  }
}

std::vector<std::string> GraphModel::instruction_sets() const {
  std::vector<std::string> names;
  if (code_) {
    names.emplace_back("interpreted");
    for (const StraightSet& set : code_->sets) names.emplace_back(set.name);
  } else {
    for (const TapeKernels* kernels : runnable_tape_kernels()) names.emplace_back(kernels->name);
  }
  return names;
}

bool GraphModel::use_instruction_set(const std::string& wanted) {
  const auto kernels = [](std::string_view name) -> const TapeKernels* {
    for (const TapeKernels* each : runnable_tape_kernels())
      if (each->name == name) return each;
    return nullptr;
  };
  if (code_) {
    for (const StraightSet& set : code_->sets) {
      if (set.name != wanted) continue;
      use(*kernels(set.name), &set);
      return true;
    }
    if (wanted != "interpreted") return false;
    use(*runnable_tape_kernels().back(), nullptr);
    return true;
  }
  const TapeKernels* const found = kernels(wanted);
  if (found) use(*found, nullptr);
  return found != nullptr;
}

}  // namespace rhec
