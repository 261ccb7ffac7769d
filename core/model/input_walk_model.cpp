#include "rhec/core/model/input_walk_model.hpp"

#include <algorithm>
#include <cstddef>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "rhec/core/base/assertion.hpp"
#include "rhec/core/base/error.hpp"
#include "rhec/core/model/dense_rows.hpp"

namespace rhec {
namespace {

Variable kept_input(const Variable& input) {
  Variable kept = input;
  kept.name = input.name + "_kept";
  kept.meaning = input.meaning + ", on the interval before";
  return kept;
}

}  // namespace

/// By which variable of the vehicle's [x; u; p; p_end] one of ours acts, and how much.
struct InputWalkModel::Of {
  std::ptrdiff_t variable;
  double by;
};

InputWalkModel::InputWalkModel(std::shared_ptr<const Model> vehicle, std::vector<int> inputs)
    : vehicle_(std::move(vehicle)),
      inputs_(std::move(inputs)),
      nx_(vehicle_->state_count()),
      nu_(vehicle_->input_count()),
      np_(vehicle_->parameter_count()),
      n_(nx_ + std::ssize(inputs_)),
      description_(vehicle_->description()),
      memory_(DenseRows::size(*vehicle_)) {
  bool is_right = !inputs_.empty() && inputs_.front() >= 0 && inputs_.back() < nu_;
  for (std::size_t k = 1; k < inputs_.size(); ++k) is_right &= inputs_[k] > inputs_[k - 1];
  if (!is_right)
    throw Error(fmt::format("model '{}': walks of the inputs [{}]; expected indices of 0 .. {} that increase",
                            description_.name, fmt::join(inputs_, ", "), nu_ - 1));
  if (vehicle_->data_count() != 0)
    throw Error(fmt::format("model '{}' depends on data of the interval; walks of its inputs need one without",
                            description_.name));
  for (const int j : inputs_) description_.states.push_back(kept_input(description_.inputs[j]));
}

void InputWalkModel::hold(int parameter, double value, double* data) const noexcept {
  double* const own = data + 2 * (std::ssize(inputs_) + parameter);
  own[0] = 1.0;
  own[1] = value;
}

void InputWalkModel::integrate(const Intervals& request) const noexcept {
  RHEC_ASSERT(request.count == 0 || (request.states && request.inputs && request.durations && request.data),
              "where to integrate");
  memory_.lend([&](double* memory) {
    const std::ptrdiff_t at_once = memory_.rows();
    for (std::ptrdiff_t first = 0; first < request.count; first += at_once)
      integrate_some(request, first, std::min(at_once, request.count - first), memory);
  });
}

void InputWalkModel::integrate_some(const Intervals& request, std::ptrdiff_t first, std::ptrdiff_t count,
                                    double* memory) const noexcept {
  const DenseRows rows(memory, count, *vehicle_);
  const bool ramp = request.parameters_end != nullptr;
  const std::ptrdiff_t K = std::ssize(inputs_), row = data_count();
  const double* const data = request.data + first * row;
  for (std::ptrdiff_t i = 0; i < count; ++i) {
    const double *s = request.states + (first + i) * n_, *nu = request.inputs + (first + i) * nu_, *of = data + i * row;
    std::copy_n(s, nx_, rows.x + i * nx_);
    double* const u = rows.u + i * nu_;
    std::copy_n(nu, nu_, u);
    for (std::ptrdiff_t k = 0; k < K; ++k) {
      const int j = inputs_[static_cast<std::size_t>(k)];
      u[j] = of[2 * k] * s[nx_ + k] + of[2 * k + 1] * nu[j];
      if (request.next_states) request.next_states[(first + i) * n_ + nx_ + k] = u[j];
    }
    for (std::ptrdiff_t j = 0; j < np_; ++j) {
      const double* const held = of + 2 * (K + j);
      const auto value = [&](const double* all) { return held[0] != 0.0 ? held[1] : all[(first + i) * np_ + j]; };
      rows.p[i * np_ + j] = value(request.parameters);
      if (ramp) rows.p_end[i * np_ + j] = value(request.parameters_end);
    }
    if (request.hessians) std::copy_n(request.multipliers + (first + i) * n_, nx_, rows.multipliers + i * nx_);
  }
  vehicle_->integrate({.count = static_cast<int>(count),
                       .states = rows.x,
                       .inputs = rows.u,
                       .parameters = rows.p,
                       .parameters_end = ramp ? rows.p_end : nullptr,
                       .durations = request.durations + first,
                       .substeps = request.substeps,
                       .next_states = request.next_states ? rows.next : nullptr,
                       .jacobians = request.jacobians ? rows.jacobians : nullptr,
                       .multipliers = request.hessians ? rows.multipliers : nullptr,
                       .hessians = request.hessians ? rows.hessians : nullptr});
  const std::ptrdiff_t vehicle_z = nx_ + nu_ + (ramp ? 2 : 1) * np_, z = vehicle_z + K;
  for (std::ptrdiff_t i = 0; i < count; ++i) {
    const double* const of_interval = data + i * row;
    if (request.next_states) std::copy_n(rows.next + i * nx_, nx_, request.next_states + (first + i) * n_);
    if (request.jacobians) {
      double* const J = request.jacobians + (first + i) * n_ * z;
      for (std::ptrdiff_t c = 0; c < z; ++c) {
        const Of by = of(c, of_interval);
        const double* const from = rows.jacobians + (i * vehicle_z + by.variable) * nx_;
        for (std::ptrdiff_t r = 0; r < nx_; ++r) J[c * n_ + r] = by.by * from[r];
        for (std::ptrdiff_t k = 0; k < K; ++k)
          J[c * n_ + nx_ + k] = by.variable == nx_ + inputs_[static_cast<std::size_t>(k)] ? by.by : 0.0;
      }
    }
    if (!request.hessians) continue;
    double* const H = request.hessians + (first + i) * z * z;
    const double* const from = rows.hessians + i * vehicle_z * vehicle_z;
    for (std::ptrdiff_t c = 0; c < z; ++c) {
      const Of of_c = of(c, of_interval);
      for (std::ptrdiff_t r = 0; r < z; ++r) {
        const Of of_r = of(r, of_interval);
        H[c * z + r] = of_r.by * of_c.by * from[of_c.variable * vehicle_z + of_r.variable];
      }
    }
  }
}

InputWalkModel::Of InputWalkModel::of(std::ptrdiff_t variable, const double* data) const noexcept {
  const std::ptrdiff_t K = std::ssize(inputs_);
  if (variable < nx_) return {variable, 1.0};
  if (variable < n_) return {nx_ + inputs_[static_cast<std::size_t>(variable - nx_)], data[2 * (variable - nx_)]};
  const std::ptrdiff_t of_vehicle = variable - K;
  if (of_vehicle >= nx_ + nu_) return {of_vehicle, data[2 * (K + (of_vehicle - nx_ - nu_) % np_)] != 0.0 ? 0.0 : 1.0};
  const auto walking = std::ranges::find(inputs_, of_vehicle - nx_);
  return {of_vehicle, walking == inputs_.end() ? 1.0 : data[2 * (walking - inputs_.begin()) + 1]};
}

void InputWalkModel::observe(const Nodes& request) const noexcept {
  memory_.lend(
      [&](double* memory) { observe_first_states(*vehicle_, static_cast<int>(inputs_.size()), request, memory); });
}

void InputWalkModel::rates(const double* x, const double* u, const double* p, double* dxdt) const noexcept {
  vehicle_->rates(x, u, p, dxdt);
  std::fill(dxdt + nx_, dxdt + n_, 0.0);
}

void InputWalkModel::straight_motion(double ground_speed, const double* p, double* state,
                                     double* inputs) const noexcept {
  vehicle_->straight_motion(ground_speed, p, state, inputs);
  for (std::size_t k = 0; k < inputs_.size(); ++k) state[nx_ + static_cast<std::ptrdiff_t>(k)] = inputs[inputs_[k]];
}

}  // namespace rhec
