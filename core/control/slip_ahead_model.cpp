#include "rhec/core/control/slip_ahead_model.hpp"

#include <algorithm>
#include <array>
#include <utility>

#include <fmt/format.h>

#include "rhec/core/base/error.hpp"
#include "rhec/core/base/padded.hpp"
#include "rhec/core/base/scratch.hpp"

namespace rhec {
namespace {

constexpr int room = 512;  ///< parameters on the stack

}  // namespace

SlipAheadModel::SlipAheadModel(std::shared_ptr<const Model> vehicle) : vehicle_(std::move(vehicle)) {
  if (vehicle_->data_count() != 0)
    throw Error(fmt::format("model '{}' depends on data of the interval; for slip that is ahead it must not",
                            vehicle_->description().name));
  if (vehicle_->parameter_count() > room)
    throw Error(fmt::format("model '{}': {} parameters are more than {}", vehicle_->description().name,
                            vehicle_->parameter_count(), room));
}

StageVariables SlipAheadModel::variables_below(const StageVariables& own) const {
  StageVariables below = own;
  for (std::size_t j = 0; j < below.parameters.size(); ++j) below.parameters[j] = own.parameters[j] + own.data[j];
  below.data.clear();
  return below;
}

std::size_t SlipAheadModel::rows_scratch(int count) const noexcept {
  const int nz = padded(state_count() + input_count() + 2 * parameter_count());
  return std::max(Model::rows_scratch(count), vehicle_->rows_scratch(count)) + static_cast<std::size_t>(count) * nz + 7;
}

/// With the vehicle's own rows, which are the fast way of a solver.
void SlipAheadModel::integrate_rows(const IntervalRows& request) const noexcept {
  const int nx = state_count(), nu = input_count(), np = parameter_count();
  const std::ptrdiff_t row = padded(nx + nu + (request.ramp ? 2 : 1) * np);
  IntervalRows changed = request;
  if (request.data) {
    Scratch memory(request.scratch);
    double* const z = memory.take(request.count * row);
    for (std::ptrdiff_t i = 0; i < request.count; ++i) {
      std::copy_n(request.z + i * request.z_step, row, z + i * row);
      for (int j = 0; j < np; ++j) {
        const double change = request.data[i * np + j];
        z[i * row + nx + j] += change;
        if (request.ramp) z[i * row + nx + np + nu + j] += change;
      }
    }
    changed.z = z;
    changed.z_step = row;
    changed.scratch = memory.rest();
  }
  changed.data = nullptr;
  vehicle_->integrate_rows(changed);
}

void SlipAheadModel::integrate(const Intervals& request) const noexcept {
  const int nx = state_count(), nu = input_count(), np = parameter_count();
  const std::ptrdiff_t nz = nx + nu + (request.parameters_end ? 2 : 1) * std::ptrdiff_t{np};
  if (np == 0) return vehicle_->integrate(request);
  std::array<double, room> parameters, ends;
  const int at_once = room / np;
  for (std::ptrdiff_t first = 0; first < request.count; first += at_once) {
    const int count = static_cast<int>(std::min<std::ptrdiff_t>(at_once, request.count - first));
    for (std::ptrdiff_t k = 0; k < std::ptrdiff_t{count} * np; ++k) {
      const double change = request.data ? request.data[first * np + k] : 0.0;
      parameters[k] = request.parameters[first * np + k] + change;
      if (request.parameters_end) ends[k] = request.parameters_end[first * np + k] + change;
    }
    const auto from = [first](auto* rows, std::ptrdiff_t size) { return rows ? rows + first * size : nullptr; };
    vehicle_->integrate({.count = count,
                         .states = from(request.states, nx),
                         .inputs = from(request.inputs, nu),
                         .parameters = parameters.data(),
                         .parameters_end = request.parameters_end ? ends.data() : nullptr,
                         .durations = from(request.durations, 1),
                         .substeps = request.substeps,
                         .next_states = from(request.next_states, nx),
                         .jacobians = from(request.jacobians, nx * nz),
                         .multipliers = from(request.multipliers, nx),
                         .hessians = from(request.hessians, nz * nz)});
  }
}

}  // namespace rhec
