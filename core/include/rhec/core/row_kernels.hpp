#pragma once

#include "rhec/core/model_kernels.hpp"
#include "rhec/core/sensitive_step.hpp"

namespace rhec {
namespace kernels {

/// Numbers entries[first], entries[first + 1], ... as the independent variables of these numbers.
template <int size, int first, class Lane, class Scalar>
RHEC_INLINE inline void set_variables(const Lane* entries, Scalar* out) {
  for_indices<size>([&](auto j) RHEC_INLINE {
    if constexpr (Differentiable<Scalar>)
      out[j] = Scalar::template variable<first + j>(entries[first + j]);
    else
      out[j] = entries[first + j];
  });
}

template <int size, class Lane>
inline void store_row(const Lane* entries, Rows rows, double* array, std::ptrdiff_t step) {
  LaneTraits<Lane>::template store_padded<size>(entries, rows.count, array + rows.first * step, step);
}

/// One step over z = [x; p; u].
template <bool with_hessian, class Lane, class Formula>
inline void integrate_row_pack(const Formula& formula, const IntervalRows& q, Rows rows) {
  using Step = SensitiveStep<Formula, Lane, with_hessian>;
  constexpr int nx = Step::nx, nz = Step::nz;
  Lane z[nz], duration, weights[nx];
  LaneTraits<Lane>::template load<nz>(q.z + rows.first * q.z_step, rows.count, q.z_step, z);
  load<1>(q.durations, rows, &duration);
  if constexpr (with_hessian)
    LaneTraits<Lane>::template load<nx>(q.multipliers + rows.first * q.multiplier_step, rows.count, q.multiplier_step,
                                        weights);
  Step step;
  step.take(formula, z, duration, weights);
  if (q.next_states) store_row<nx>(step.next, rows, q.next_states, q.next_step);
  for (int r = 0; r < nx; ++r) store_row<nz>(step.jacobian[r], rows, q.jacobians + r * q.jacobian_row, q.jacobian_step);
  if constexpr (with_hessian)
    for (int r = 0; r < nz; ++r) store_row<nz>(step.hessian[r], rows, q.hessians + r * q.hessian_row, q.hessian_step);
}

template <class Scalar, class Formula>
[[gnu::flatten]] inline void observe_row_pack(const Formula& formula, const NodeRows& q, Rows rows) {
  using Lane = typename LaneOf<Scalar>::Type;
  constexpr int nx = Formula::state_count, ny = Formula::output_count;
  Lane values[nx];
  LaneTraits<Lane>::template load<nx>(q.states + rows.first * q.state_step, rows.count, q.state_step, values);
  Scalar x[nx], y[ny];
  set_variables<nx, 0>(values, x);
  formula.outputs(static_cast<const Scalar*>(x), y);
  const int count = q.chosen ? q.chosen_count : ny;
  for (int j = 0; j < count; ++j) {
    const Scalar& output = y[q.chosen ? q.chosen[j] : j];
    if (q.outputs) {
      double spread[LaneTraits<Lane>::width];
      if constexpr (Differentiable<Scalar>)
        LaneTraits<Lane>::template store<1>(&output.value, LaneTraits<Lane>::width, spread);
      else
        LaneTraits<Lane>::template store<1>(&output, LaneTraits<Lane>::width, spread);
      for (int i = 0; i < rows.count; ++i) q.outputs[(rows.first + i) * count + j] = spread[i];
    }
    if constexpr (Differentiable<Scalar>)
      store_row<nx>(output.d, rows, q.jacobians + j * q.jacobian_row, count * q.jacobian_row);
  }
}

template <class Formula, class Lane>
void integrate_rows(const void* formula, const IntervalRows& q) {
  const auto& f = *static_cast<const Formula*>(formula);
  for_each_pack<Lane>(q.count, [&](Rows rows) {
    return q.hessians ? integrate_row_pack<true, Lane>(f, q, rows) : integrate_row_pack<false, Lane>(f, q, rows);
  });
}

template <class Formula, class Lane>
void observe_rows(const void* formula, const NodeRows& q) {
  const auto& f = *static_cast<const Formula*>(formula);
  for_each_pack<Lane>(q.count, [&](Rows rows) {
    if (q.jacobians) return observe_row_pack<Dual<Lane, Formula::state_count>>(f, q, rows);
    return observe_row_pack<Lane>(f, q, rows);
  });
}

}  // namespace kernels

/// The kernels of a formula for one number type (double, or a pack for one instruction set).
template <class Formula, class Lane>
constexpr ModelKernels make_model_kernels() {
  ModelKernels table{&kernels::integrate<Formula, Lane>, &kernels::observe<Formula, Lane>, nullptr, nullptr};
  // Written out for a wide model they would take too long to compile.
  constexpr int nz = Formula::state_count + Formula::parameter_count + Formula::input_count;
  if constexpr (nz <= longest_list && Formula::output_count <= longest_list) {
    table.integrate_rows = &kernels::integrate_rows<Formula, Lane>;
    table.observe_rows = &kernels::observe_rows<Formula, Lane>;
  }
  return table;
}

}  // namespace rhec
