#pragma once

#include "rhec/core/model/model_kernels.hpp"
#include "rhec/core/model/row_kernels.hpp"

namespace rhec {

/// Whether a formula has kernels on rows: unrolled for a wide model, they would take too long to compile.
template <class Formula>
inline constexpr bool has_row_kernels = Formula::state_count + Formula::parameter_count + Formula::input_count <=
                                        longest_list&& Formula::output_count <= longest_list;

/// The kernels of a formula on dense arrays, for one number type (double, or a pack for one instruction set).
template <class Formula, class Lane>
constexpr ModelKernels make_dense_kernels() {
  ModelKernels table{};
  table.integrate = &kernels::integrate<Formula, Lane>;
  table.observe = &kernels::observe<Formula, Lane>;
  return table;
}

/// Those on padded rows but for the following.
template <class Formula, class Lane>
constexpr ModelKernels make_row_kernels() {
  ModelKernels table{};
  if constexpr (has_row_kernels<Formula>) {
    table.integrate_rows = &kernels::integrate_rows<false, Formula, Lane>;
    table.observe_rows = &kernels::observe_rows<Formula, Lane>;
  }
  return table;
}

/// The step with Hessians on padded rows, half of the work of the compiler.
template <class Formula, class Lane>
constexpr ModelKernels make_hessian_row_kernels() {
  ModelKernels table{};
  if constexpr (has_row_kernels<Formula>)
    table.integrate_rows_with_hessians = &kernels::integrate_rows<true, Formula, Lane>;
  return table;
}

/// All three in one table.
constexpr ModelKernels join(const ModelKernels& dense, const ModelKernels& rows, const ModelKernels& hessian_rows) {
  return {dense.integrate, dense.observe, rows.integrate_rows, hessian_rows.integrate_rows_with_hessians,
          rows.observe_rows};
}
template <class Formula, class Lane>
constexpr ModelKernels make_model_kernels() {
  return join(make_dense_kernels<Formula, Lane>(), make_row_kernels<Formula, Lane>(),
              make_hessian_row_kernels<Formula, Lane>());
}

}  // namespace rhec
