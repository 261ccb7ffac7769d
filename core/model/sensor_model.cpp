#include "rhec/core/model/sensor_model.hpp"

#include <algorithm>
#include <array>
#include <utility>

#include <fmt/format.h>

#include "rhec/core/base/error.hpp"
#include "rhec/core/base/reserve.hpp"

namespace rhec {
namespace {

constexpr std::size_t sensor_room = 8192;  ///< doubles on the stack
constexpr int vehicles_at_once = 8;        ///< intervals, as many as a model evaluates side by side

void check_sensors(const ModelDescription& about, const std::vector<int>& chosen, const char* what) {
  for (std::size_t k = 0; k < chosen.size(); ++k)
    if (chosen[k] < 0 || chosen[k] >= std::ssize(about.outputs) || (k > 0 && chosen[k] <= chosen[k - 1]))
      throw Error(fmt::format("model '{}': {} of output {}; expected indices of 0 .. {} that increase", about.name,
                              what, chosen[k], std::ssize(about.outputs) - 1));
}

}  // namespace

SensorModel::SensorModel(std::shared_ptr<const Model> vehicle, Errors errors)
    : vehicle_(std::move(vehicle)),
      errors_(std::move(errors)),
      motion_(*vehicle_),
      description_(vehicle_->description()),
      nx_(vehicle_->state_count()) {
  check_sensors(description_, errors_.biased, "a bias");
  check_sensors(description_, errors_.scaled, "a scale error");
  bias_of_.assign(description_.outputs.size(), -1);
  scale_of_ = motion_of_ = bias_of_;
  const auto add = [&](const std::vector<int>& outputs, std::vector<int>& places, const char* ending,
                       const char* meaning, bool has_unit) {
    for (const int j : outputs) {
      const Variable& output = description_.outputs[j];
      Variable state{.name = output.name + ending,
                     .unit = has_unit ? output.unit : "1",
                     .meaning = fmt::format("{} of {}", meaning, output.name),
                     .scale = has_unit ? output.scale : 1.0};
      for (const Variable& other : description_.states)
        if (other.name == state.name)
          throw Error(fmt::format("model '{}' has a state '{}' already, as the {} would be called; rename it",
                                  description_.name, state.name, state.meaning));
      places[j] = static_cast<int>(description_.states.size());
      description_.states.push_back(std::move(state));
    }
  };
  add(errors_.biased, bias_of_, "_bias", "bias", true);
  add(errors_.scaled, scale_of_, "_scale", "scale error", false);
  add(motion_.which(), motion_of_, "_at_node", "value", true);
  const auto nx = static_cast<std::size_t>(nx_), nu = static_cast<std::size_t>(vehicle_->input_count()),
             np = static_cast<std::size_t>(vehicle_->parameter_count()),
             ny = static_cast<std::size_t>(vehicle_->output_count()), nm = motion_.which().size();
  const std::size_t nz = nx + nu + 2 * np, nh = nx + nu + np;
  const std::size_t interval = vehicles_at_once * (3 * nx + nz * (nx + nz) + nm * (2 + nh) + nh * nh + nh * nz),
                    node = 2 * ny + ny * nx + nx * nx;
  memory_ = std::max(interval, node);
  if (memory_ > sensor_room) reserve_ = std::make_shared<Reserve>(memory_);
}

template <class Use>
void SensorModel::with_memory(Use use) const noexcept {
  if (reserve_) return reserve_->lend(use);
  std::array<double, sensor_room> memory;
  use(memory.data());
}

std::size_t SensorModel::rows_scratch(int count) const noexcept {
  return std::max(Model::rows_scratch(count), vehicle_->rows_scratch(count));
}

void SensorModel::rates(const double* x, const double* u, const double* p, double* dxdt) const noexcept {
  vehicle_->rates(x, u, p, dxdt);
  std::fill_n(dxdt + nx_, state_count() - nx_, 0.0);
}

void SensorModel::straight_motion(double ground_speed, const double* p, double* state, double* inputs) const noexcept {
  vehicle_->straight_motion(ground_speed, p, state, inputs);
}

void SensorModel::integrate(const Intervals& request) const noexcept {
  with_memory([&](double* memory) {
    for (std::ptrdiff_t first = 0; first < request.count; first += vehicles_at_once)
      integrate_some(request, first, std::min<std::ptrdiff_t>(vehicles_at_once, request.count - first), memory);
  });
}

/// With G = d[x_end; u; p_at_end]/dz, the values of motion have the slopes h_z G, and the curvature
/// G' (sum_j lambda_j d2h_j) G + sum_r (h_x' lambda)_r d2F_r. The vehicle and h are evaluated for several intervals at
/// once.
void SensorModel::integrate_some(const Intervals& q, std::ptrdiff_t first, std::ptrdiff_t count,
                                 double* memory) const noexcept {
  const std::ptrdiff_t nx = nx_, wide = state_count(), nu = input_count(), np = parameter_count(), nm = motion_.count(),
                       errors = wide - nx - nm, first_m = nx + errors;
  const bool ramp = q.parameters_end != nullptr;
  const std::ptrdiff_t nz = nx + nu + (ramp ? 2 : 1) * np, nZ = nz + wide - nx, nh = nx + nu + np;
  const bool with_slopes = q.jacobians || q.hessians;
  double* next = memory;
  const auto take = [&](std::ptrdiff_t size) { return std::exchange(next, next + count * size); };
  double *states = take(nx), *x_ends = take(nx), *slopes = take(nx * nz), *values = take(nm), *of_h = take(nm * nh);
  for (std::ptrdiff_t i = 0; i < count; ++i) std::copy_n(q.states + (first + i) * wide, nx, states + i * nx);
  Intervals some{.count = static_cast<int>(count),
                 .states = states,
                 .inputs = q.inputs + first * nu,
                 .parameters = q.parameters + first * np,
                 .parameters_end = ramp ? q.parameters_end + first * np : nullptr,
                 .durations = q.durations + first,
                 .data = q.data ? q.data + first * data_count() : nullptr,
                 .substeps = q.substeps,
                 .next_states = x_ends,
                 .jacobians = with_slopes ? slopes : nullptr};
  vehicle_->integrate(some);
  MotionOutputs::Points at{.count = some.count,
                           .states = x_ends,
                           .inputs = some.inputs,
                           .parameters = ramp ? some.parameters_end : some.parameters};
  at.outputs = values;
  at.jacobians = with_slopes ? of_h : nullptr;
  motion_.evaluate(at);
  // Where a column of the vehicle's z = [x; u; p; p_end] is in ours, and what it is among the arguments of h: -1 where
  // it comes by way of x_end alone.
  const auto place = [&](std::ptrdiff_t c) { return c < nx ? c : c + wide - nx; };
  const auto argument = [&](std::ptrdiff_t c) -> std::ptrdiff_t {
    if (c < nx) return -1;
    if (c < nx + nu) return c;
    if (ramp) return c < nx + nu + np ? -1 : c - np;
    return c;
  };
  for (std::ptrdiff_t i = 0; i < count; ++i) {
    if (q.next_states) {
      double* const to = q.next_states + (first + i) * wide;
      std::copy_n(x_ends + i * nx, nx, to);
      std::copy_n(q.states + (first + i) * wide + nx, errors, to + nx);
      std::copy_n(values + i * nm, nm, to + first_m);
    }
    if (!q.jacobians) continue;
    const double *const F = slopes + i * nx * nz, *const h = of_h + i * nm * nh;
    double* const J = q.jacobians + (first + i) * wide * nZ;
    std::fill_n(J, wide * nZ, 0.0);
    for (std::ptrdiff_t c = 0; c < nz; ++c) {
      double* const to = J + place(c) * wide;
      std::copy_n(F + c * nx, nx, to);
      for (std::ptrdiff_t j = 0; j < nm; ++j) {
        double slope = argument(c) < 0 ? 0.0 : h[argument(c) * nm + j];
        for (std::ptrdiff_t r = 0; r < nx; ++r) slope += h[r * nm + j] * F[c * nx + r];
        to[first_m + j] = slope;
      }
    }
    for (std::ptrdiff_t k = nx; k < first_m; ++k) J[k * wide + k] = 1.0;
  }
  if (!q.hessians) return;
  double *multipliers = take(nx), *of_motion = take(nm), *hessians = take(nz * nz), *curvatures = take(nh * nh),
         *DG = take(nh * nz);
  for (std::ptrdiff_t i = 0; i < count; ++i) {
    const double *const lambda = q.multipliers + (first + i) * wide, *const h = of_h + i * nm * nh;
    std::copy_n(lambda + first_m, nm, of_motion + i * nm);
    for (std::ptrdiff_t r = 0; r < nx; ++r) {
      multipliers[i * nx + r] = lambda[r];
      for (std::ptrdiff_t j = 0; j < nm; ++j) multipliers[i * nx + r] += h[r * nm + j] * lambda[first_m + j];
    }
  }
  some.next_states = some.jacobians = nullptr;
  some.multipliers = multipliers;
  some.hessians = hessians;
  vehicle_->integrate(some);
  at.outputs = at.jacobians = nullptr;
  at.multipliers = of_motion;
  at.hessians = curvatures;
  motion_.evaluate(at);
  for (std::ptrdiff_t i = 0; i < count; ++i) {
    const double *const F = slopes + i * nx * nz, *const D = curvatures + i * nh * nh;
    double* const H = hessians + i * nz * nz;
    for (std::ptrdiff_t c = 0; c < nz && nm > 0; ++c)
      for (std::ptrdiff_t a = 0; a < nh; ++a) {
        double sum = argument(c) < 0 ? 0.0 : D[argument(c) * nh + a];
        for (std::ptrdiff_t r = 0; r < nx; ++r) sum += D[r * nh + a] * F[c * nx + r];
        DG[c * nh + a] = sum;
      }
    for (std::ptrdiff_t c = 0; c < nz && nm > 0; ++c)
      for (std::ptrdiff_t d = 0; d < nz; ++d) {
        double sum = argument(d) < 0 ? 0.0 : DG[c * nh + argument(d)];
        for (std::ptrdiff_t r = 0; r < nx; ++r) sum += DG[c * nh + r] * F[d * nx + r];
        H[c * nz + d] += sum;
      }
    double* const all = q.hessians + (first + i) * nZ * nZ;
    std::fill_n(all, nZ * nZ, 0.0);
    for (std::ptrdiff_t c = 0; c < nz; ++c)
      for (std::ptrdiff_t d = 0; d < nz; ++d) all[place(c) * nZ + place(d)] = H[c * nz + d];
  }
}

void SensorModel::observe(const Nodes& request) const noexcept {
  with_memory([&](double* memory) {
    for (std::ptrdiff_t i = 0; i < request.count; ++i) observe_one(request, i, memory);
  });
}

void SensorModel::observe_one(const Nodes& q, std::ptrdiff_t i, double* memory) const noexcept {
  const std::ptrdiff_t nx = nx_, wide = state_count(), ny = output_count();
  double *const values = memory, *const slopes = values + ny, *const multipliers = slopes + ny * nx,
                *const curvature = multipliers + ny;
  const double* const x = q.states + i * wide;
  const auto factor = [&](std::ptrdiff_t j) { return scale_of_[j] < 0 ? 1.0 : 1.0 + x[scale_of_[j]]; };
  vehicle_->observe(
      {.count = 1, .states = x, .outputs = values, .jacobians = q.jacobians || q.hessians ? slopes : nullptr});
  for (std::ptrdiff_t j = 0; j < ny; ++j)
    if (motion_of_[j] >= 0) values[j] = x[motion_of_[j]];
  for (std::ptrdiff_t j = 0; j < ny && q.outputs; ++j)
    q.outputs[i * ny + j] = factor(j) * values[j] + (bias_of_[j] < 0 ? 0.0 : x[bias_of_[j]]);
  if (q.jacobians) {
    double* const J = q.jacobians + i * ny * wide;
    std::fill_n(J, ny * wide, 0.0);
    for (std::ptrdiff_t j = 0; j < ny; ++j) {
      if (motion_of_[j] >= 0)
        J[motion_of_[j] * ny + j] = factor(j);
      else
        for (std::ptrdiff_t c = 0; c < nx; ++c) J[c * ny + j] = factor(j) * slopes[c * ny + j];
      if (bias_of_[j] >= 0) J[bias_of_[j] * ny + j] = 1.0;
      if (scale_of_[j] >= 0) J[scale_of_[j] * ny + j] = values[j];
    }
  }
  if (!q.hessians) return;
  const double* const lambda = q.multipliers + i * ny;
  for (std::ptrdiff_t j = 0; j < ny; ++j) multipliers[j] = motion_of_[j] >= 0 ? 0.0 : factor(j) * lambda[j];
  vehicle_->observe({.count = 1, .states = x, .multipliers = multipliers, .hessians = curvature});
  double* const H = q.hessians + i * wide * wide;
  std::fill_n(H, wide * wide, 0.0);
  for (std::ptrdiff_t c = 0; c < nx; ++c)
    for (std::ptrdiff_t r = 0; r < nx; ++r) H[c * wide + r] = curvature[c * nx + r];
  const auto add = [&](std::ptrdiff_t a, std::ptrdiff_t b, double value) {
    H[a * wide + b] += value;
    H[b * wide + a] += value;
  };
  for (std::ptrdiff_t j = 0; j < ny; ++j) {
    if (scale_of_[j] < 0) continue;
    if (motion_of_[j] >= 0)
      add(scale_of_[j], motion_of_[j], lambda[j]);
    else
      for (std::ptrdiff_t c = 0; c < nx; ++c) add(scale_of_[j], c, lambda[j] * slopes[c * ny + j]);
  }
}

}  // namespace rhec
