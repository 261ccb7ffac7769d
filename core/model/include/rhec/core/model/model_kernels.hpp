#pragma once

#include "rhec/core/model/dual.hpp"
#include "rhec/core/model/lane_traits.hpp"
#include "rhec/core/model/model.hpp"
#include "rhec/core/model/runge_kutta.hpp"

namespace rhec {

/// The evaluation of one model for one instruction set: plain functions over the formula, so that translation units
/// compiled for different instruction sets share nothing but this table.
struct ModelKernels {
  void (*integrate)(const void* formula, const Model::Intervals& request) = nullptr;
  void (*observe)(const void* formula, const Model::Nodes& request) = nullptr;
  /// For one Runge-Kutta step per interval, without ramps and with Jacobians: with Hessians and without. All three are
  /// null for a wide model.
  void (*integrate_rows)(const void* formula, const IntervalRows& request) = nullptr;
  void (*integrate_rows_with_hessians)(const void* formula, const IntervalRows& request) = nullptr;
  void (*observe_rows)(const void* formula, const NodeRows& request) = nullptr;
};

namespace kernels {

/// The rows [first, first + count) of an array, which a pack evaluates at once.
struct Rows {
  int first, count;
};

/// The value type of a number: double or a pack, without derivatives.
template <class Scalar>
struct LaneOf {
  using Type = Scalar;
};
template <Differentiable Scalar>
struct LaneOf<Scalar> {
  using Type = typename Scalar::Value;
};

template <int size, class Lane>
inline void load(const double* array, Rows rows, Lane* out) {
  LaneTraits<Lane>::template load<size>(array + rows.first * size, rows.count, size, out);
}

template <int size, class Lane>
inline void store(const Lane* entries, Rows rows, double* array) {
  LaneTraits<Lane>::template store<size>(entries, rows.count, array + rows.first * size);
}

/// Loads numbers as the independent variables first_direction, first_direction + 1, ...
template <int size, int first_direction, class Scalar>
inline void load_variables(const double* array, Rows rows, Scalar* out) {
  if constexpr (Differentiable<Scalar>) {
    typename Scalar::Value values[room_for(size)];
    load<size>(array, rows, values);
    for (int j = 0; j < size; ++j) out[j] = Scalar::variable(values[j], first_direction + j);
  } else {
    load<size>(array, rows, out);
  }
}

template <int size, class Scalar>
inline void store_values(const Scalar* results, Rows rows, double* out) {
  if constexpr (Differentiable<Scalar>) {
    typename Scalar::Value values[size];
    for (int r = 0; r < size; ++r) values[r] = results[r].value;
    store<size>(values, rows, out);
  } else {
    store<size>(results, rows, out);
  }
}

template <int size, Differentiable Scalar>
inline void store_jacobian(const Scalar* results, Rows rows, double* out) {
  constexpr int n = Scalar::directions;
  typename Scalar::Value jacobian[size * n];
  for (int j = 0; j < n; ++j)
    for (int r = 0; r < size; ++r) jacobian[j * size + r] = results[r].d[j];
  store<size * n>(jacobian, rows, out);
}

/// sum_r weights_r Hess(results_r), both halves.
template <TwiceDifferentiable Scalar>
inline void sum_hessians(const Scalar* results, int size, const typename Scalar::Value* weights,
                         typename Scalar::Value* hessian) {
  constexpr int n = Scalar::directions;
  for (int i = 0, k = 0; i < n; ++i) {
    for (int j = 0; j <= i; ++j, ++k) {
      auto sum = results[0].dd[k] * weights[0];
      for (int r = 1; r < size; ++r) sum = sum + results[r].dd[k] * weights[r];
      hessian[i * n + j] = hessian[j * n + i] = sum;
    }
  }
}

template <int size, TwiceDifferentiable Scalar>
inline void store_hessian(const Scalar* results, const double* multipliers, Rows rows, double* out) {
  using Lane = typename Scalar::Value;
  constexpr int n = Scalar::directions;
  Lane weights[size], hessian[n * n];
  load<size>(multipliers, rows, weights);
  sum_hessians(results, size, weights, hessian);
  store<n * n>(hessian, rows, out);
}

/// Stores the requested results of `request`, an Intervals or Nodes; values go to `out`.
template <int size, class Scalar, class Request>
inline void store_results(const Scalar* results, const Request& request, double* out, Rows rows) {
  if (out) store_values<size>(results, rows, out);
  if constexpr (Differentiable<Scalar>) {
    if (request.jacobians) store_jacobian<size>(results, rows, request.jacobians);
  }
  if constexpr (TwiceDifferentiable<Scalar>) {
    store_hessian<size>(results, request.multipliers, rows, request.hessians);
  }
}

template <bool ramp, class Scalar, class Formula>
inline void integrate_pack(const Formula& formula, const Model::Intervals& q, Rows rows) {
  using Lane = typename LaneOf<Scalar>::Type;
  constexpr int nx = Formula::state_count, nu = Formula::input_count, np = Formula::parameter_count;
  Scalar x[nx], u[room_for(nu)], p[room_for(np)], p_end[room_for(np)];
  load_variables<nx, 0>(q.states, rows, x);
  load_variables<nu, nx>(q.inputs, rows, u);
  load_variables<np, nx + nu>(q.parameters, rows, p);
  if constexpr (ramp) load_variables<np, nx + nu + np>(q.parameters_end, rows, p_end);
  Lane duration;
  load<1>(q.durations, rows, &duration);
  const Scalar* const end = ramp ? p_end : nullptr;
  runge_kutta(formula, x, static_cast<const Scalar*>(u), static_cast<const Scalar*>(p), end, duration, q.substeps);
  store_results<nx>(x, q, q.next_states, rows);
}

template <class Scalar, class Formula>
inline void observe_pack(const Formula& formula, const Model::Nodes& q, Rows rows) {
  Scalar x[Formula::state_count], y[Formula::output_count];
  load_variables<Formula::state_count, 0>(q.states, rows, x);
  formula.outputs(static_cast<const Scalar*>(x), y);
  store_results<Formula::output_count>(y, q, q.outputs, rows);
}

/// Calls `evaluate` for the rows of one pack after another.
template <class Lane, class Evaluate>
inline void for_each_pack(int count, Evaluate evaluate) {
  constexpr int width = LaneTraits<Lane>::width;
  for (int first = 0; first < count; first += width)
    evaluate(Rows{first, count - first < width ? count - first : width});
}

/// Computes only what is requested: the number type carries as many derivatives as the request needs.
template <bool ramp, class Formula, class Lane>
inline void integrate_range(const Formula& formula, const Model::Intervals& q) {
  constexpr int np = Formula::parameter_count;
  constexpr int nz = Formula::state_count + Formula::input_count + (ramp ? 2 * np : np);
  for_each_pack<Lane>(q.count, [&](Rows rows) {
    if (q.hessians) return integrate_pack<ramp, SecondOrder<Lane, nz>>(formula, q, rows);
    if (q.jacobians) return integrate_pack<ramp, Dual<Lane, nz>>(formula, q, rows);
    return integrate_pack<ramp, Lane>(formula, q, rows);
  });
}

template <class Formula, class Lane>
void integrate(const void* formula, const Model::Intervals& q) {
  const auto& f = *static_cast<const Formula*>(formula);
  return q.parameters_end ? integrate_range<true, Formula, Lane>(f, q) : integrate_range<false, Formula, Lane>(f, q);
}

template <class Formula, class Lane>
void observe(const void* formula, const Model::Nodes& q) {
  constexpr int nx = Formula::state_count;
  const auto& f = *static_cast<const Formula*>(formula);
  for_each_pack<Lane>(q.count, [&](Rows rows) {
    if (q.hessians) return observe_pack<SecondOrder<Lane, nx>>(f, q, rows);
    if (q.jacobians) return observe_pack<Dual<Lane, nx>>(f, q, rows);
    return observe_pack<Lane>(f, q, rows);
  });
}

}  // namespace kernels
}  // namespace rhec
