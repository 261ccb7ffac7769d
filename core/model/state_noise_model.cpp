#include "rhec/core/model/state_noise_model.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "rhec/core/base/error.hpp"
#include "rhec/core/base/padded.hpp"

namespace rhec {
namespace {

constexpr std::size_t room = 4096;  ///< doubles on the stack

/// The vehicle's derivatives of one interval.
std::size_t dense_size(const Model& vehicle) {
  const auto nx = static_cast<std::size_t>(vehicle.state_count()), nu = static_cast<std::size_t>(vehicle.input_count()),
             np = static_cast<std::size_t>(vehicle.parameter_count()), nz = nx + nu + 2 * np;
  return nz * nz;
}

}  // namespace

StateNoiseModel::StateNoiseModel(std::shared_ptr<const Model> vehicle, std::vector<int> states)
    : vehicle_(std::move(vehicle)), states_(std::move(states)), description_(vehicle_->description()) {
  const int nx = vehicle_->state_count();
  if (!description_.noisy_states.empty())
    throw Error(fmt::format("model '{}' has process noise already; name all its states at once", description_.name));
  if (states_.empty())
    throw Error(fmt::format("model '{}': process noise of no state; expected one at least", description_.name));
  for (std::size_t k = 0; k < states_.size(); ++k)
    if (states_[k] < 0 || states_[k] >= nx || (k > 0 && states_[k] <= states_[k - 1]))
      throw Error(fmt::format("model '{}': process noise of the states {}; expected indices of 0 .. {} that increase",
                              description_.name, fmt::join(states_, ", "), nx - 1));
  for (const int j : states_) {
    const Variable& state = description_.states[j];
    Variable noise;
    noise.name = state.name + "_noise";
    noise.unit = state.unit == "1" ? "1/sqrt(s)" : state.unit + "/sqrt(s)";
    noise.meaning = "process noise of " + state.name;
    noise.scale = state.scale;
    description_.inputs.push_back(std::move(noise));
  }
  description_.noisy_states = states_;
  if (dense_size(*vehicle_) > room) reserve_ = std::make_unique<Reserve>(dense_size(*vehicle_));
}

void StateNoiseModel::straight_motion(double ground_speed, const double* p, double* state,
                                      double* inputs) const noexcept {
  vehicle_->straight_motion(ground_speed, p, state, inputs);
  std::fill_n(inputs + vehicle_->input_count(), states_.size(), 0.0);
}

std::size_t StateNoiseModel::rows_scratch(int count) const noexcept {
  return std::max(Model::rows_scratch(count), vehicle_->rows_scratch(count));
}

/// The vehicle writes its rows to where they are wanted, since noise stands behind them; but before p_end of a ramp.
void StateNoiseModel::integrate_rows(const IntervalRows& request) const noexcept {
  if (request.ramp) return Model::integrate_rows(request);
  const int nx = state_count(), first = nx + parameter_count() + vehicle_->input_count();
  const int noises = static_cast<int>(states_.size()), used = first + noises;
  vehicle_->integrate_rows(request);
  for (int i = 0; i < request.count; ++i) {
    const double root = std::sqrt(request.durations[i]);
    const double* const noise = request.z + i * request.z_step + first;
    for (int k = 0; k < noises && request.next_states; ++k)
      request.next_states[i * request.next_step + states_[k]] += root * noise[k];
    for (int r = 0; r < nx && request.jacobians; ++r)
      std::fill(request.jacobians + i * request.jacobian_step + r * request.jacobian_row + first,
                request.jacobians + i * request.jacobian_step + r * request.jacobian_row + padded(used), 0.0);
    for (int k = 0; k < noises && request.jacobians; ++k)
      request.jacobians[i * request.jacobian_step + states_[k] * request.jacobian_row + first + k] = root;
    if (!request.hessians) continue;
    double* const rows = request.hessians + i * request.hessian_step;
    for (int r = 0; r < used; ++r)
      std::fill(rows + r * request.hessian_row + (r < first ? first : 0), rows + r * request.hessian_row + padded(used),
                0.0);
  }
}

void StateNoiseModel::integrate(const Intervals& request) const noexcept {
  const auto all = [&](double* memory) {
    for (std::ptrdiff_t i = 0; i < request.count; ++i) integrate_one(request, i, memory);
  };
  if (reserve_) return reserve_->lend(all);
  std::array<double, room> memory;
  all(memory.data());
}

void StateNoiseModel::integrate_one(const Intervals& request, std::ptrdiff_t i, double* memory) const noexcept {
  const std::ptrdiff_t nx = state_count(), nu = vehicle_->input_count(), np = parameter_count();
  const auto noises = static_cast<std::ptrdiff_t>(states_.size());
  const std::ptrdiff_t narrow = nx + nu + np + (request.parameters_end ? np : 0), wide = narrow + noises;
  const double root = std::sqrt(request.durations[i]);
  const double* const inputs = request.inputs + i * (nu + noises);
  Model::Intervals one{.count = 1,
                       .states = request.states + i * nx,
                       .inputs = inputs,
                       .parameters = request.parameters + i * np,
                       .parameters_end = request.parameters_end ? request.parameters_end + i * np : nullptr,
                       .durations = request.durations + i,
                       .data = request.data ? request.data + i * data_count() : nullptr,
                       .substeps = request.substeps,
                       .next_states = request.next_states ? request.next_states + i * nx : nullptr};
  if (request.jacobians) one.jacobians = memory;
  vehicle_->integrate(one);
  // Where a column of the vehicle's z = [x; u; p; p_end] is in ours, which has noise behind u.
  const auto place = [&](std::ptrdiff_t column) { return column < nx + nu ? column : column + noises; };
  for (std::ptrdiff_t k = 0; k < noises && one.next_states; ++k) one.next_states[states_[k]] += root * inputs[nu + k];
  if (request.jacobians) {
    double* const J = request.jacobians + i * nx * wide;
    for (std::ptrdiff_t c = 0; c < narrow; ++c) std::copy_n(memory + c * nx, nx, J + place(c) * nx);
    std::fill_n(J + (nx + nu) * nx, noises * nx, 0.0);
    for (std::ptrdiff_t k = 0; k < noises; ++k) J[(nx + nu + k) * nx + states_[k]] = root;
  }
  if (!request.hessians) return;
  one.next_states = one.jacobians = nullptr;
  one.multipliers = request.multipliers + i * nx;
  one.hessians = memory;
  vehicle_->integrate(one);
  double* const H = request.hessians + i * wide * wide;
  std::fill_n(H, wide * wide, 0.0);
  for (std::ptrdiff_t c = 0; c < narrow; ++c)
    for (std::ptrdiff_t r = 0; r < narrow; ++r) H[place(c) * wide + place(r)] = memory[c * narrow + r];
}

}  // namespace rhec
