#include "rhec/core/model/state_noise_model.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "rhec/core/base/error.hpp"
#include "rhec/core/base/padded.hpp"
#include "rhec/core/base/scratch.hpp"

namespace rhec {
namespace {

constexpr int noisy_at_once = 8;  ///< intervals, as many as a model evaluates side by side

/// Those of the vehicle, with its derivatives.
std::size_t dense_size(const Model& vehicle) {
  const auto nx = static_cast<std::size_t>(vehicle.state_count()), nu = static_cast<std::size_t>(vehicle.input_count()),
             np = static_cast<std::size_t>(vehicle.parameter_count()), nz = nx + nu + 2 * np;
  return noisy_at_once * (nu + 2 * np + nz * nz);
}

/// Noise as a variable of the model, which stands for a state of the vehicle.
Variable noise_of(const Variable& state) {
  Variable noise;
  noise.name = state.name + "_noise";
  noise.unit = state.unit == "1" ? "1/sqrt(s)" : state.unit + "/sqrt(s)";
  noise.meaning = "process noise of " + state.name;
  noise.scale = state.scale;
  noise.nominal = 0.0;
  return noise;
}

/// Where the noises stand in the z of a request, and how much of each an interval adds to its state per sqrt(dt).
struct Columns {
  std::ptrdiff_t inputs, parameters, ends;  ///< the first xi, w and w at the end of the interval
  double share;                             ///< of a w: half with one at the end
};

/// Sets the entries from `first` to `width`, a multiple of eight, of so many rows to zero. Mostly they are eight, a
/// number that is known, so that no library is called for it.
void clear_behind(int first, int width, int rows, double* matrix, std::ptrdiff_t step) {
  const int first_eight = padded(first);
  if (first == first_eight && width == first + 8) {
    for (double* row = matrix + first; rows > 0; --rows, row += step)
      for (int k = 0; k < 8; ++k) row[k] = 0.0;
    return;
  }
  for (double* row = matrix; rows > 0; --rows, row += step) {
    for (int c = first; c < first_eight; ++c) row[c] = 0.0;
    for (int c = first_eight; c < width; c += 8)
      for (int k = 0; k < 8; ++k) row[c + k] = 0.0;
  }
}

}  // namespace

StateNoiseModel::StateNoiseModel(std::shared_ptr<const Model> vehicle, std::vector<int> states,
                                 std::vector<int> blocked)
    : vehicle_(std::move(vehicle)),
      states_(std::move(states)),
      blocked_(std::move(blocked)),
      description_(vehicle_->description()),
      memory_(dense_size(*vehicle_)) {
  const int nx = vehicle_->state_count();
  if (!description_.noisy_states.empty() || !description_.blocked_noises.empty())
    throw Error(fmt::format("model '{}' has process noise already; name all its states at once", description_.name));
  if (states_.empty() && blocked_.empty())
    throw Error(fmt::format("model '{}': process noise of no state; expected one at least", description_.name));
  for (const auto* chosen : {&states_, &blocked_}) {
    for (std::size_t k = 0; k < chosen->size(); ++k)
      if ((*chosen)[k] < 0 || (*chosen)[k] >= nx || (k > 0 && (*chosen)[k] <= (*chosen)[k - 1]))
        throw Error(fmt::format("model '{}': process noise of the states {}; expected indices of 0 .. {} that increase",
                                description_.name, fmt::join(*chosen, ", "), nx - 1));
  }
  for (const int j : states_)
    if (std::ranges::count(blocked_, j) > 0)
      throw Error(fmt::format("model '{}': process noise of state {} as an input and as a parameter; expected one",
                              description_.name, j));
  for (const int j : states_) description_.inputs.push_back(noise_of(description_.states[j]));
  for (const int j : blocked_) description_.parameters.push_back(noise_of(description_.states[j]));
  description_.noisy_states = states_;
  description_.blocked_noises = blocked_;
}

void StateNoiseModel::straight_motion(double ground_speed, const double* p, double* state,
                                      double* inputs) const noexcept {
  vehicle_->straight_motion(ground_speed, p, state, inputs);
  std::fill_n(inputs + vehicle_->input_count(), states_.size(), 0.0);
}

std::size_t StateNoiseModel::rows_scratch(int count) const noexcept {
  const int z = vehicle_->state_count() + vehicle_->input_count() + 2 * vehicle_->parameter_count();
  return static_cast<std::size_t>(count) * padded(z) + 8 + vehicle_->rows_scratch(count);
}

/// Noise that is an input stands behind all columns of the vehicle, which writes its rows to where they are wanted.
void StateNoiseModel::integrate_in_place(const IntervalRows& request) const noexcept {
  vehicle_->integrate_rows(request);
  const int nx = state_count(), ni = static_cast<int>(states_.size());
  const int first = nx + vehicle_->parameter_count() + vehicle_->input_count(), width = padded(first + ni);
  const int* const states = states_.data();
  // Mostly all intervals are as long.
  double duration = 0.0, root = 0.0;
  for (int i = 0; i < request.count; ++i) {
    if (request.durations[i] != duration) root = std::sqrt(duration = request.durations[i]);
    if (request.next_states) {
      const double* const noises = request.z + i * request.z_step + first;
      double* const next = request.next_states + i * request.next_step;
      for (int k = 0; k < ni; ++k) next[states[k]] += root * noises[k];
    }
    if (request.jacobians) {
      double* const J = request.jacobians + i * request.jacobian_step;
      clear_behind(first, width, nx, J, request.jacobian_row);
      for (int k = 0; k < ni; ++k) J[states[k] * request.jacobian_row + first + k] = root;
    }
    if (request.hessians) {
      double* const H = request.hessians + i * request.hessian_step;
      clear_behind(first, width, first, H, request.hessian_row);
      for (int k = first; k < first + ni; ++k) std::fill_n(H + k * request.hessian_row, width, 0.0);
    }
  }
}

/// The vehicle is given rows of z without noise, and its results are moved apart.
void StateNoiseModel::integrate_rows(const IntervalRows& request) const noexcept {
  if (!request.ramp && blocked_.empty()) return integrate_in_place(request);
  const std::ptrdiff_t nx = state_count(), nu = vehicle_->input_count(), np = vehicle_->parameter_count(),
                       ni = std::ssize(states_), nw = std::ssize(blocked_);
  const std::ptrdiff_t narrow = nx + np + nu + (request.ramp ? np : 0),
                       wide = narrow + ni + nw + (request.ramp ? nw : 0), width = padded(static_cast<int>(wide));
  const Columns noise{.inputs = nx + np + nw + nu,
                      .parameters = nx + np,
                      .ends = nx + 2 * np + nw + nu + ni,
                      .share = request.ramp ? 0.5 : 1.0};
  // Where a column of the vehicle's [x; p; u; p_end] is in [x; p; w; u; xi; p_end; w_end]: never before its own place.
  const auto place = [&](std::ptrdiff_t c) { return c < nx + np ? c : c < nx + np + nu ? c + nw : c + nw + ni; };
  const auto spread = [&](double* row) {
    for (std::ptrdiff_t c = narrow; c-- > nx + np;) row[place(c)] = row[c];
    std::fill_n(row + noise.parameters, nw, 0.0);
    std::fill_n(row + noise.inputs, ni, 0.0);
    std::fill(row + (request.ramp ? noise.ends : wide), row + width, 0.0);
  };
  IntervalRows of_vehicle = request;
  Scratch memory(request.scratch);
  const std::ptrdiff_t step = padded(static_cast<int>(narrow));
  double* const without_noise = memory.take(request.count * step);
  for (int i = 0; i < request.count; ++i)
    for (std::ptrdiff_t c = 0; c < narrow; ++c) without_noise[i * step + c] = request.z[i * request.z_step + place(c)];
  of_vehicle.z = without_noise;
  of_vehicle.z_step = step;
  of_vehicle.scratch = memory.rest();
  vehicle_->integrate_rows(of_vehicle);
  for (int i = 0; i < request.count; ++i) {
    const double root = std::sqrt(request.durations[i]), part = noise.share * root;
    const double* const z = request.z + i * request.z_step;
    if (request.next_states) {
      double* const next = request.next_states + i * request.next_step;
      for (std::ptrdiff_t k = 0; k < ni; ++k) next[states_[k]] += root * z[noise.inputs + k];
      for (std::ptrdiff_t k = 0; k < nw; ++k)
        next[blocked_[k]] += part * (z[noise.parameters + k] + (request.ramp ? z[noise.ends + k] : 0.0));
    }
    if (request.jacobians) {
      double* const J = request.jacobians + i * request.jacobian_step;
      const std::ptrdiff_t row = request.jacobian_row;
      for (std::ptrdiff_t r = 0; r < nx; ++r) spread(J + r * row);
      for (std::ptrdiff_t k = 0; k < ni; ++k) J[states_[k] * row + noise.inputs + k] = root;
      for (std::ptrdiff_t k = 0; k < nw; ++k) {
        J[blocked_[k] * row + noise.parameters + k] = part;
        if (request.ramp) J[blocked_[k] * row + noise.ends + k] = part;
      }
    }
    if (!request.hessians) continue;
    double* const H = request.hessians + i * request.hessian_step;
    const std::ptrdiff_t row = request.hessian_row;
    for (std::ptrdiff_t r = narrow; r-- > 0;) {
      if (place(r) != r) std::copy_n(H + r * row, narrow, H + place(r) * row);
      spread(H + place(r) * row);
    }
    for (std::ptrdiff_t k = 0; k < nw; ++k) std::fill_n(H + (noise.parameters + k) * row, width, 0.0);
    for (std::ptrdiff_t k = 0; k < ni; ++k) std::fill_n(H + (noise.inputs + k) * row, width, 0.0);
    for (std::ptrdiff_t k = 0; request.ramp && k < nw; ++k) std::fill_n(H + (noise.ends + k) * row, width, 0.0);
  }
}

void StateNoiseModel::integrate(const Intervals& request) const noexcept {
  const auto all = [&](double* memory) {
    for (std::ptrdiff_t first = 0; first < request.count; first += noisy_at_once)
      integrate_some(request, first, std::min<std::ptrdiff_t>(noisy_at_once, request.count - first), memory);
  };
  memory_.lend(all);
}

void StateNoiseModel::integrate_some(const Intervals& request, std::ptrdiff_t first, std::ptrdiff_t count,
                                     double* memory) const noexcept {
  const std::ptrdiff_t nx = state_count(), nu = vehicle_->input_count(), np = vehicle_->parameter_count(),
                       ni = std::ssize(states_), nw = std::ssize(blocked_);
  const bool ramp = request.parameters_end != nullptr;
  const std::ptrdiff_t narrow = nx + nu + np + (ramp ? np : 0), wide = narrow + ni + nw + (ramp ? nw : 0);
  const Columns noise{.inputs = nx + nu,
                      .parameters = nx + nu + ni + np,
                      .ends = nx + nu + ni + 2 * np + nw,
                      .share = ramp ? 0.5 : 1.0};
  // Rows without noise.
  double* next = memory;
  const auto without_noise = [&](const double* rows, std::ptrdiff_t size, std::ptrdiff_t noises) {
    rows += first * (size + noises);
    if (noises == 0) return rows;
    double* const to = std::exchange(next, next + count * size);
    for (std::ptrdiff_t i = 0; i < count; ++i) std::copy_n(rows + i * (size + noises), size, to + i * size);
    return static_cast<const double*>(to);
  };
  Model::Intervals some{.count = static_cast<int>(count),
                        .states = request.states + first * nx,
                        .inputs = without_noise(request.inputs, nu, ni),
                        .parameters = without_noise(request.parameters, np, nw),
                        .parameters_end = ramp ? without_noise(request.parameters_end, np, nw) : nullptr,
                        .durations = request.durations + first,
                        .data = request.data ? request.data + first * data_count() : nullptr,
                        .substeps = request.substeps,
                        .next_states = request.next_states ? request.next_states + first * nx : nullptr};
  double* const dense = next;
  if (request.jacobians) some.jacobians = dense;
  vehicle_->integrate(some);
  // Where a column of the vehicle's [x; u; p; p_end] is in [x; u; xi; p; w; p_end; w_end].
  const auto place = [&](std::ptrdiff_t c) { return c < nx + nu ? c : c < nx + nu + np ? c + ni : c + ni + nw; };
  for (std::ptrdiff_t i = 0; i < count; ++i) {
    const double root = std::sqrt(some.durations[i]), part = noise.share * root;
    if (some.next_states) {
      const double *const xi = request.inputs + (first + i) * (nu + ni) + nu,
                          *const w = request.parameters + (first + i) * (np + nw) + np,
                          *const w_end = ramp ? request.parameters_end + (first + i) * (np + nw) + np : nullptr;
      double* const x = some.next_states + i * nx;
      for (std::ptrdiff_t k = 0; k < ni; ++k) x[states_[k]] += root * xi[k];
      for (std::ptrdiff_t k = 0; k < nw; ++k) x[blocked_[k]] += part * (w[k] + (ramp ? w_end[k] : 0.0));
    }
    if (!request.jacobians) continue;
    double* const J = request.jacobians + (first + i) * nx * wide;
    std::fill_n(J, nx * wide, 0.0);
    for (std::ptrdiff_t c = 0; c < narrow; ++c) std::copy_n(dense + (i * narrow + c) * nx, nx, J + place(c) * nx);
    for (std::ptrdiff_t k = 0; k < ni; ++k) J[(noise.inputs + k) * nx + states_[k]] = root;
    for (std::ptrdiff_t k = 0; k < nw; ++k) {
      J[(noise.parameters + k) * nx + blocked_[k]] = part;
      if (ramp) J[(noise.ends + k) * nx + blocked_[k]] = part;
    }
  }
  if (!request.hessians) return;
  some.next_states = some.jacobians = nullptr;
  some.multipliers = request.multipliers + first * nx;
  some.hessians = dense;
  vehicle_->integrate(some);
  for (std::ptrdiff_t i = 0; i < count; ++i) {
    double* const H = request.hessians + (first + i) * wide * wide;
    std::fill_n(H, wide * wide, 0.0);
    for (std::ptrdiff_t c = 0; c < narrow; ++c)
      for (std::ptrdiff_t r = 0; r < narrow; ++r) H[place(c) * wide + place(r)] = dense[(i * narrow + c) * narrow + r];
  }
}

}  // namespace rhec
