#pragma once

#include "rhec/core/model/model_kernels.hpp"
#include "rhec/core/model/sensitive_step.hpp"

namespace rhec {
namespace kernels {

/// Makes entries[first], entries[first + 1], ... the independent variables with the same numbers.
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
RHEC_INLINE inline void store_row(const Lane* entries, Rows rows, double* array, std::ptrdiff_t step) {
  LaneTraits<Lane>::template store_padded<size>(entries, rows.count, array + rows.first * step, step);
}

template <class Step>
inline void store_step(const Step& step, const IntervalRows& q, Rows rows) {
  constexpr int nx = Step::nx, nz = Step::nz;
  if (q.next_states) store_row<nx>(step.next, rows, q.next_states, q.next_step);
  for_indices<nx>([&](auto r) RHEC_INLINE {
    store_row<nz>(step.jacobian[r], rows, q.jacobians + r * q.jacobian_row, q.jacobian_step);
  });
  if constexpr (Step::has_hessian)
    for_indices<nz>([&](auto r) RHEC_INLINE {
      double* row = q.hessians + r * q.hessian_row;
      if constexpr (Step::Pattern::is_bent(r)) {
        store_row<nz>(step.hessian[r], rows, row, q.hessian_step);
      } else {
        for (int i = rows.first; i < rows.first + rows.count; ++i)
          for (int j = 0; j < padded(nz); ++j) row[i * q.hessian_step + j] = 0.0;
      }
    });
}

/// One step over z = [x; p; u] from each of the rows, two packs at a time.
template <bool with_hessian, class Lane, class Formula>
inline void integrate_row_packs(const Formula& formula, const IntervalRows& q) {
  using Step = SensitiveStep<Formula, Lane, with_hessian>;
  constexpr int nx = Step::nx, nz = Step::nz, width = LaneTraits<Lane>::width, most = with_hessian ? 1 : 2;
  for (int first = 0; first < q.count; first += most * width) {
    Step steps[most];
    Rows rows[most];
    int count = 0;
    for (int i = first; i < q.count && count < most; i += width, ++count) {
      Step& step = steps[count];
      const Rows& these = rows[count] = {i, q.count - i < width ? q.count - i : width};
      LaneTraits<Lane>::template load_padded<nz>(q.z + i * q.z_step, these.count, q.z_step, step.z);
      load<1>(q.durations, these, &step.h);
      if constexpr (with_hessian)
        LaneTraits<Lane>::template load_padded<nx>(q.multipliers + i * q.multiplier_step, these.count,
                                                   q.multiplier_step, step.weights);
    }
    Step::take(formula, count, steps);
    for (int i = 0; i < count; ++i) store_step(steps[i], q, rows[i]);
  }
}

/// Calls function(first, size), both compile-time constants, for each group of eight of `most` outputs that contains
/// one of the first `count`: result rows are padded to these groups.
template <int most, class Function>
RHEC_INLINE inline void for_each_eight(int count, const Function& function) {
  for_indices<(most + 7) / 8>([&](auto eight) RHEC_INLINE {
    constexpr int first = 8 * eight, size = most - first < 8 ? most - first : 8;
    if (first < count) function(std::integral_constant<int, first>(), std::integral_constant<int, size>());
  });
}

template <class Scalar, class Formula>
[[gnu::flatten]] inline void observe_row_pack(const Formula& formula, const NodeRows& q, Rows rows) {
  using Lane = typename LaneOf<Scalar>::Type;
  constexpr int nx = Formula::state_count, ny = Formula::output_count;
  Lane values[nx];
  LaneTraits<Lane>::template load_padded<nx>(q.states + rows.first * q.state_step, rows.count, q.state_step, values);
  Scalar x[nx], y[ny];
  set_variables<nx, 0>(values, x);
  formula.outputs(static_cast<const Scalar*>(x), y);
  const int count = q.chosen ? q.chosen_count : ny;
  Lane predicted[ny];
  for (int j = 0; j < ny; ++j) {
    if (j >= count) {
      predicted[j] = Lane(0.0);
      continue;
    }
    const Scalar& output = y[q.chosen ? q.chosen[j] : j];
    if constexpr (Differentiable<Scalar>) {
      predicted[j] = output.value;
      store_row<nx>(output.d, rows, q.jacobians + j * q.jacobian_row, count * q.jacobian_row);
    } else {
      predicted[j] = output;
    }
  }
  if (!q.outputs) return;
  for_each_eight<ny>(count, [&](auto first, auto size) RHEC_INLINE {
    store_row<size>(predicted + first, rows, q.outputs + first, q.output_step);
  });
}

/// Adds the curvature of the outputs to the Hessians, entry by entry, since most are zero.
template <class Lane, class Formula>
[[gnu::flatten]] inline void bend_row_pack(const Formula& formula, const NodeRows& q, Rows rows) {
  constexpr int nx = Formula::state_count, ny = Formula::output_count, width = LaneTraits<Lane>::width;
  static constexpr OutputPattern<Formula> pattern{};
  if constexpr (pattern.curved > 0) {
    using Scalar = SecondOrder<Lane, pattern.curved>;
    Lane values[nx], given[ny], weights[ny];
    LaneTraits<Lane>::template load_padded<nx>(q.states + rows.first * q.state_step, rows.count, q.state_step, values);
    const int count = q.chosen ? q.chosen_count : ny;
    for_each_eight<ny>(count, [&](auto first, auto size) RHEC_INLINE {
      LaneTraits<Lane>::template load_padded<size>(q.multipliers + rows.first * q.multiplier_step + first, rows.count,
                                                   q.multiplier_step, given + first);
    });
    for (int j = 0; j < ny; ++j) weights[j] = Lane(0.0);
    for (int j = 0; j < count; ++j) weights[q.chosen ? q.chosen[j] : j] = given[j];
    Scalar x[nx], y[ny];
    for_indices<nx>([&](auto j) RHEC_INLINE {
      if constexpr (pattern.direction_of[j] >= 0)
        x[j] = Scalar::template variable<pattern.direction_of[j]>(values[j]);
      else
        x[j] = Scalar(values[j]);
    });
    formula.outputs(static_cast<const Scalar*>(x), y);
    for_indices<nx>([&](auto i) RHEC_INLINE {
      for_indices<i + 1>([&](auto j) RHEC_INLINE {
        if constexpr (pattern.bends(i, j)) {
          constexpr int entry = StepPattern<Formula>::pair(pattern.direction_of[i], pattern.direction_of[j]);
          Lane sum(0.0);
          for (int k = 0; k < ny; ++k) sum = sum + weights[k] * y[k].dd[entry];
          double bend[width];
          LaneTraits<Lane>::template store<1>(&sum, rows.count, bend);
          double* hessian = q.hessians + rows.first * q.hessian_step;
          for (int k = 0; k < rows.count; ++k, hessian += q.hessian_step) {
            hessian[i * q.hessian_row + j] += bend[k];
            if (i != j) hessian[j * q.hessian_row + i] += bend[k];
          }
        }
      });
    });
  }
}

template <bool with_hessian, class Formula, class Lane>
void integrate_rows(const void* formula, const IntervalRows& q) {
  integrate_row_packs<with_hessian, Lane>(*static_cast<const Formula*>(formula), q);
}

template <class Formula, class Lane>
void observe_rows(const void* formula, const NodeRows& q) {
  const auto& f = *static_cast<const Formula*>(formula);
  for_each_pack<Lane>(q.count, [&](Rows rows) {
    if (q.jacobians)
      observe_row_pack<Dual<Lane, Formula::state_count>>(f, q, rows);
    else if (q.outputs)
      observe_row_pack<Lane>(f, q, rows);
    if (q.hessians) bend_row_pack<Lane>(f, q, rows);
  });
}

}  // namespace kernels

}  // namespace rhec
