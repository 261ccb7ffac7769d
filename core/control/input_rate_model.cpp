#include "rhec/core/control/input_rate_model.hpp"

#include <algorithm>
#include <array>
#include <limits>
#include <utility>

#include <fmt/format.h>

#include "rhec/core/base/error.hpp"
#include "rhec/core/base/padded.hpp"
#include "rhec/core/base/scratch.hpp"

namespace rhec {
namespace {

constexpr int widest = 64;  ///< variables of a stage, with both ends of a ramp: a row on the stack

using Row = std::array<double, widest>;

ModelDescription with_rates(const ModelDescription& vehicle, const std::vector<int>& rated) {
  ModelDescription about = vehicle;
  for (const int j : rated) {
    const Variable& input = vehicle.inputs[j];
    about.states.push_back(input);
    Variable& rate = about.inputs[j];
    rate.name = rate_name(input);
    rate.unit = input.unit == "1" ? "1/s" : input.unit + "/s";
    rate.meaning = "rate of change of " + input.name;
    rate.lower = -std::numeric_limits<double>::infinity();
    rate.upper = std::numeric_limits<double>::infinity();
    rate.is_angle = false;
    if (about.roles.speed != j) continue;
    about.roles.speed = -1;
    about.roles.speed_state = static_cast<int>(about.states.size()) - 1;
  }
  return about;
}

}  // namespace

std::string rate_name(const Variable& input) { return input.name + "_rate"; }

InputRateModel::InputRateModel(std::shared_ptr<const Model> vehicle, std::vector<int> rated)
    : vehicle_(std::move(vehicle)), rated_(std::move(rated)) {
  const ModelDescription& about = vehicle_->description();
  const int nu = vehicle_->input_count();
  if (rated_.empty()) throw Error(fmt::format("model '{}': rates of no input; expected one at least", about.name));
  for (std::size_t k = 0; k < rated_.size(); ++k)
    if (rated_[k] < 0 || rated_[k] >= nu || (k > 0 && rated_[k] <= rated_[k - 1]))
      throw Error(fmt::format("model '{}': rates of the inputs {}; expected indices of 0 .. {} that increase",
                              about.name, fmt::join(rated_, ", "), nu - 1));
  const int all = vehicle_->state_count() + nu + 2 * vehicle_->parameter_count() + static_cast<int>(rated_.size());
  if (all > widest)
    throw Error(
        fmt::format("model '{}': {} variables with the rates of inputs are more than {}", about.name, all, widest));
  description_ = with_rates(about, rated_);
}

/// The vehicle's inputs, of those that are held before an interval and the inputs of this model.
void InputRateModel::write_inputs(const double* held, const double* given, double duration,
                                  double* inputs) const noexcept {
  std::copy_n(given, vehicle_->input_count(), inputs);
  for (std::size_t k = 0; k < rated_.size(); ++k) inputs[rated_[k]] = held[k] + duration * given[rated_[k]];
}

std::size_t InputRateModel::rows_scratch(int count) const noexcept {
  const int nz = padded(vehicle_->state_count() + input_count() + 2 * parameter_count());
  return std::max(Model::rows_scratch(count), vehicle_->rows_scratch(count) + static_cast<std::size_t>(count) * nz + 7);
}

/// The vehicle writes its rows to where they are wanted. Then they are widened in place: [x; p; u] becomes
/// [x; c; p; u].
void InputRateModel::integrate_rows(const IntervalRows& request) const noexcept {
  const int nx = vehicle_->state_count(), nc = static_cast<int>(rated_.size());
  const int np = parameter_count(), nu = input_count(), tail = np + nu + (request.ramp ? np : 0);
  const int narrow = padded(nx + tail);
  Scratch memory(request.scratch);
  double* const z = memory.take(static_cast<std::ptrdiff_t>(request.count) * narrow);
  for (int i = 0; i < request.count; ++i) {
    const double* from = request.z + i * request.z_step;
    double* const to = z + static_cast<std::ptrdiff_t>(i) * narrow;
    std::copy_n(from, nx, to);
    std::copy_n(from + nx + nc, tail, to + nx);
    std::fill(to + nx + tail, to + narrow, 0.0);
    for (int k = 0; k < nc; ++k) {
      double& input = to[nx + np + rated_[k]];
      input = from[nx + k] + request.durations[i] * input;
    }
  }
  IntervalRows inner = request;
  inner.z = z;
  inner.z_step = narrow;
  inner.scratch = memory.rest();
  vehicle_->integrate_rows(inner);
  for (int i = 0; i < request.count; ++i) {
    if (request.next_states) {
      double* const next = request.next_states + i * request.next_step;
      for (int k = 0; k < nc; ++k) next[nx + k] = z[static_cast<std::ptrdiff_t>(i) * narrow + nx + np + rated_[k]];
      std::fill(next + nx + nc, next + padded(nx + nc), 0.0);
    }
    if (request.jacobians)
      widen_jacobian(request.jacobians + i * request.jacobian_step, request.jacobian_row, tail, request.durations[i]);
    if (request.hessians)
      widen_hessian(request.hessians + i * request.hessian_step, request.hessian_row, tail, request.durations[i]);
  }
}

/// What a row of derivatives with respect to [x; p; u] becomes with respect to [x; c; p; v].
void InputRateModel::widen_jacobian(double* rows, std::ptrdiff_t row, int tail, double duration) const noexcept {
  const int nx = vehicle_->state_count(), nc = static_cast<int>(rated_.size()), first = nx + nc + parameter_count();
  const int used = nx + nc + tail, wide = padded(used);
  for (int r = 0; r < nx; ++r) {
    double* const at = rows + r * row;
    std::copy_backward(at + nx, at + nx + tail, at + used);
    for (int k = 0; k < nc; ++k) {
      double& of_input = at[first + rated_[k]];
      at[nx + k] = of_input;
      of_input *= duration;
    }
    std::fill(at + used, at + wide, 0.0);
  }
  for (int k = 0; k < nc; ++k) {
    double* const at = rows + (nx + k) * row;
    std::fill_n(at, wide, 0.0);
    at[nx + k] = 1.0;
    at[first + rated_[k]] = duration;
  }
}

void InputRateModel::widen_hessian(double* rows, std::ptrdiff_t row, int tail, double duration) const noexcept {
  const int nx = vehicle_->state_count(), nc = static_cast<int>(rated_.size()), first = nx + nc + parameter_count();
  const int used = nx + nc + tail, wide = padded(used);
  // From the last row to the first, since rows after x move down.
  for (int r = nx + tail - 1; r >= 0; --r) {
    const double* const from = rows + r * row;
    double* const to = rows + (r < nx ? r : r + nc) * row;
    std::copy_backward(from + nx, from + nx + tail, to + used);
    if (to != from) std::copy_n(from, nx, to);
    for (int k = 0; k < nc; ++k) {
      double& of_input = to[first + rated_[k]];
      to[nx + k] = of_input;
      of_input *= duration;
    }
    std::fill(to + used, to + wide, 0.0);
  }
  for (int k = 0; k < nc; ++k) {
    double* const of_input = rows + (first + rated_[k]) * row;
    std::copy_n(of_input, wide, rows + (nx + k) * row);
    for (int c = 0; c < used; ++c) of_input[c] *= duration;
  }
}

void InputRateModel::integrate(const Intervals& request) const noexcept {
  const int nx = vehicle_->state_count(), nc = static_cast<int>(rated_.size()), np = parameter_count(),
            nu = input_count();
  const int tail = nu + np + (request.parameters_end ? np : 0), narrow = nx + tail, wide = narrow + nc;
  Row inputs;
  // Where a column of the vehicle's derivatives goes; those of rated inputs go to c as well.
  const auto place = [&](int column) { return column < nx ? column : column + nc; };
  std::array<double, std::size_t{widest} * widest> dense;
  for (std::ptrdiff_t i = 0; i < request.count; ++i) {
    const double duration = request.durations[i], *state = request.states + i * (nx + nc);
    write_inputs(state + nx, request.inputs + i * nu, duration, inputs.data());
    Intervals one{.count = 1,
                  .states = state,
                  .inputs = inputs.data(),
                  .parameters = request.parameters + i * np,
                  .parameters_end = request.parameters_end ? request.parameters_end + i * np : nullptr,
                  .durations = request.durations + i,
                  .data = request.data ? request.data + i * data_count() : nullptr,
                  .substeps = request.substeps,
                  .next_states = request.next_states ? request.next_states + i * (nx + nc) : nullptr};
    if (request.jacobians) one.jacobians = dense.data();
    vehicle_->integrate(one);
    for (int k = 0; k < nc && one.next_states; ++k) one.next_states[nx + k] = inputs[rated_[k]];
    if (request.jacobians) {
      const int rows = nx + nc;
      double* const J = request.jacobians + i * rows * wide;
      std::fill_n(J, rows * wide, 0.0);
      for (int c = 0; c < narrow; ++c) std::copy_n(dense.data() + c * nx, nx, J + place(c) * rows);
      for (int k = 0; k < nc; ++k) {
        double *const held = J + (nx + k) * rows, *const rate = J + (nx + nc + rated_[k]) * rows;
        std::copy_n(rate, nx, held);
        for (int r = 0; r < nx; ++r) rate[r] *= duration;
        held[nx + k] = 1.0;
        rate[nx + k] = duration;
      }
    }
    if (!request.hessians) continue;
    one.next_states = one.jacobians = nullptr;
    one.multipliers = request.multipliers + i * (nx + nc);
    one.hessians = dense.data();
    vehicle_->integrate(one);
    double* const H = request.hessians + i * wide * wide;
    std::fill_n(H, wide * wide, 0.0);
    for (int c = 0; c < narrow; ++c)
      for (int r = 0; r < narrow; ++r) H[place(c) * wide + place(r)] = dense[c * narrow + r];
    for (int k = 0; k < nc; ++k) {
      const int held = nx + k, rate = nx + nc + rated_[k];
      for (int r = 0; r < wide; ++r) H[held * wide + r] = H[rate * wide + r];
      for (int r = 0; r < wide; ++r) H[rate * wide + r] *= duration;
      for (int c = 0; c < wide; ++c) H[c * wide + held] = H[c * wide + rate];
      for (int c = 0; c < wide; ++c) H[c * wide + rate] *= duration;
    }
  }
}

void InputRateModel::observe(const Nodes& request) const noexcept {
  const int nx = vehicle_->state_count(), nc = static_cast<int>(rated_.size()), ny = output_count(), wide = nx + nc;
  std::array<double, std::size_t{widest} * widest> dense;
  for (std::ptrdiff_t i = 0; i < request.count; ++i) {
    Nodes one{.count = 1, .states = request.states + i * wide};
    if (request.outputs) one.outputs = request.outputs + i * ny;
    if (request.jacobians) {
      one.jacobians = request.jacobians + i * ny * wide;
      std::fill_n(one.jacobians + ny * nx, ny * nc, 0.0);
    }
    if (request.hessians) {
      one.multipliers = request.multipliers + i * ny;
      one.hessians = dense.data();
    }
    vehicle_->observe(one);
    if (!request.hessians) continue;
    double* const H = request.hessians + i * wide * wide;
    std::fill_n(H, wide * wide, 0.0);
    for (int c = 0; c < nx; ++c) std::copy_n(dense.data() + c * nx, nx, H + c * wide);
  }
}

void InputRateModel::rates(const double* x, const double* u, const double* p, double* dxdt) const noexcept {
  const int nx = vehicle_->state_count();
  Row inputs;
  write_inputs(x + nx, u, 0.0, inputs.data());
  vehicle_->rates(x, inputs.data(), p, dxdt);
  for (std::size_t k = 0; k < rated_.size(); ++k) dxdt[nx + static_cast<int>(k)] = u[rated_[k]];
}

void InputRateModel::straight_motion(double ground_speed, const double* p, double* state,
                                     double* inputs) const noexcept {
  const int nx = vehicle_->state_count();
  vehicle_->straight_motion(ground_speed, p, state, inputs);
  for (std::size_t k = 0; k < rated_.size(); ++k)
    state[nx + static_cast<int>(k)] = std::exchange(inputs[rated_[k]], 0.0);
}

}  // namespace rhec
