#include "rhec/core/control/input_rate_model.hpp"

#include <algorithm>
#include <array>
#include <cstring>
#include <limits>
#include <utility>

#include <fmt/format.h>

#include "rhec/core/base/error.hpp"
#include "rhec/core/base/padded.hpp"
#include "rhec/core/base/scratch.hpp"
#include "rhec/core/model/dense_rows.hpp"

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

/// Moves parts of rows of derivatives with respect to [x; p; u] to where they are with respect to [x; c; p; v]. The
/// tail is what follows x.
struct AnyShape {
  int of_states, of_held, of_tail;
  int states() const { return of_states; }
  int held() const { return of_held; }
  int tail() const { return of_tail; }
  void move_tail(const double* from, double* to) const {
    const int used = of_states + of_held + of_tail;
    std::copy_backward(from + of_states, from + of_states + of_tail, to + used);
    std::fill(to + used, to + padded(used), 0.0);
  }
  /// From [x; c; p; v] to [x; p; v].
  void gather(const double* from, double* to) const {
    std::copy_n(from, of_states, to);
    std::copy_n(from + of_states + of_held, of_tail, to + of_states);
    std::fill(to + of_states + of_tail, to + padded(of_states + of_tail), 0.0);
  }
  void copy_states(const double* from, double* to) const { std::copy_n(from, of_states, to); }
  void copy_row(const double* from, double* to) const { std::copy_n(from, padded(of_states + of_held + of_tail), to); }
};

/// The same with sizes that the compiler knows, so that no loop remains.
template <int known_states, int known_held, int known_tail>
struct KnownShape {
  static constexpr int used = known_states + known_held + known_tail, wide = padded(used);
  static constexpr int states() { return known_states; }
  static constexpr int held() { return known_held; }
  static constexpr int tail() { return known_tail; }
  static void move_tail(const double* from, double* to) {
    std::array<double, wide - known_states - known_held> moved{};
    std::memcpy(moved.data(), from + known_states, known_tail * sizeof(double));
    std::memcpy(to + known_states + known_held, moved.data(), sizeof moved);
  }
  static void gather(const double* from, double* to) {
    std::array<double, padded(known_states + known_tail)> all{};
    std::memcpy(all.data(), from, known_states * sizeof(double));
    std::memcpy(all.data() + known_states, from + known_states + known_held, known_tail * sizeof(double));
    std::memcpy(to, all.data(), sizeof all);
  }
  static void copy_states(const double* from, double* to) { std::memcpy(to, from, known_states * sizeof(double)); }
  static void copy_row(const double* from, double* to) { std::memcpy(to, from, wide * sizeof(double)); }
};

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

StageVariables InputRateModel::variables_below(const StageVariables& own) const {
  StageVariables below = own;
  const auto nx = static_cast<std::size_t>(vehicle_->state_count());
  below.states.resize(nx);
  for (std::size_t k = 0; k < rated_.size(); ++k) {
    Expression& input = below.inputs[static_cast<std::size_t>(rated_[k])];
    input = own.states[nx + k] + own.duration * input;
  }
  return below;
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

/// The bicycle with a steering rate is worth being compiled for.
void InputRateModel::integrate_rows(const IntervalRows& request) const noexcept {
  const int nx = vehicle_->state_count(), nc = static_cast<int>(rated_.size());
  const int tail = parameter_count() + input_count() + (request.ramp ? parameter_count() : 0);
  if (nx == 4 && nc == 1 && tail == 4)
    integrate_rows_of(request, KnownShape<4, 1, 4>());
  else
    integrate_rows_of(request, AnyShape{nx, nc, tail});
}

/// The vehicle writes its rows to where they are wanted. Then they are widened in place: [x; p; u] becomes
/// [x; c; p; v].
template <class Shape>
void InputRateModel::integrate_rows_of(const IntervalRows& request, const Shape& shape) const noexcept {
  const int nx = shape.states(), nc = shape.held(), first_input = nx + parameter_count();
  const int narrow = padded(nx + shape.tail());
  Scratch memory(request.scratch);
  double* const z = memory.take(static_cast<std::ptrdiff_t>(request.count) * narrow);
  for (int i = 0; i < request.count; ++i) {
    const double* from = request.z + i * request.z_step;
    double* const to = z + static_cast<std::ptrdiff_t>(i) * narrow;
    shape.gather(from, to);
    for (int k = 0; k < nc; ++k) {
      double& input = to[first_input + rated_[k]];
      input = from[nx + k] + request.durations[i] * input;
    }
  }
  IntervalRows inner = request;
  inner.z = z;
  inner.z_step = narrow;
  inner.scratch = memory.rest();
  vehicle_->integrate_rows(inner);
  for (int i = 0; i < request.count && request.next_states; ++i) {
    double* const next = request.next_states + i * request.next_step;
    for (int k = 0; k < nc; ++k) next[nx + k] = z[static_cast<std::ptrdiff_t>(i) * narrow + first_input + rated_[k]];
    std::fill(next + nx + nc, next + padded(nx + nc), 0.0);
  }
  widen(request, shape);
}

/// Widens the derivatives.
template <class Shape>
void InputRateModel::widen(const IntervalRows& request, const Shape& shape) const noexcept {
  const int nx = shape.states(), nc = shape.held(), first = nx + nc + parameter_count(), used = nx + nc + shape.tail();
  const auto split = [&](double* row, double duration) {
    for (int k = 0; k < nc; ++k) {
      double& of_input = row[first + rated_[k]];
      row[nx + k] = of_input;
      of_input *= duration;
    }
  };
  for (int i = 0; i < request.count; ++i) {
    const double duration = request.durations[i];
    if (request.jacobians) {
      double* const rows = request.jacobians + i * request.jacobian_step;
      for (int r = 0; r < nx; ++r) {
        double* const at = rows + r * request.jacobian_row;
        shape.move_tail(at, at);
        split(at, duration);
      }
      for (int k = 0; k < nc; ++k) {
        double* const at = rows + (nx + k) * request.jacobian_row;
        std::fill_n(at, padded(used), 0.0);
        at[nx + k] = 1.0;
        at[first + rated_[k]] = duration;
      }
    }
    if (!request.hessians) continue;
    double* const rows = request.hessians + i * request.hessian_step;
    // From the last row to the first, since rows after x move down.
    for (int r = nx + shape.tail() - 1; r >= 0; --r) {
      const double* const from = rows + r * request.hessian_row;
      double* const to = rows + (r < nx ? r : r + nc) * request.hessian_row;
      shape.move_tail(from, to);
      if (r >= nx) shape.copy_states(from, to);
      split(to, duration);
    }
    for (int k = 0; k < nc; ++k) {
      double *const of_input = rows + (first + rated_[k]) * request.hessian_row,
                    *held = rows + (nx + k) * request.hessian_row;
      shape.copy_row(of_input, held);
      for (int c = 0; c < used; ++c) of_input[c] *= duration;
    }
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
  std::array<double, std::size_t{widest} * widest> dense;
  observe_first_states(*vehicle_, static_cast<int>(rated_.size()), request, dense.data());
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
