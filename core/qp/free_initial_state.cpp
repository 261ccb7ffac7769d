// The last step of the recursion with a free initial state: its states are decided like the controls of a stage.
#include <algorithm>
#include <cmath>

#include "rhec/core/kernels/riccati_kernels.hpp"
#include "rhec/core/qp/riccati.hpp"
#include "rhec/core/qp/small_matrix.hpp"
#include "tolerances.hpp"

namespace rhec {
namespace {

// The prior of the initial state may legitimately be ill-conditioned: only rounding counts as indefinite.
constexpr double initial_definite_tolerance = 1e-14;

}  // namespace

void Riccati::factor_initial(const StageQp& qp, const ActiveSet& /*active*/) noexcept {
  const int N = qp.intervals(), n = qp.states(0);
  // Node 0 uses the slot of node N for its reduction; the slot's C stays that of node N.
  const Special first = special(0);
  Special v = special(N);
  Reduction& reduction = reductions_[N];
  const bool fixed[max_width] = {};
  double* reduced = work_.data();
  reduction.plain = reduction.rows == 0;
  reduction.free = n;
  has_initial_inverse_ =
      reduction.plain && kernels_->invert(P(0), n, stride_, initial_definite_tolerance, initial_inverse_.data());
  if (has_initial_inverse_) return;
  if (!reduction.plain) {
    double* D = reduced + 3 * width_ * width_;
    double* E = D + max_rows_ * width_;
    for (int c = 0; c < n; ++c) std::copy_n(first.C + c * max_rows_, reduction.rows, D + c * max_rows_);
    for (int c = 0; c < ns_; ++c) std::fill_n(E + c * max_rows_, reduction.rows, 0.0);
    eliminate(D, E, reduction.rows, n, fixed, reduction, v);
    null_space(D, E, n, fixed, reduction, v);
    reduction.free = n - reduction.pivots;
    double* PT = reduced + width_ * width_;
    small::multiply(P(0), stride_, v.T, width_, PT, width_, n, n, reduction.free);
    for (int c = 0; c < reduction.free; ++c) std::fill_n(reduced + c * width_, reduction.free, 0.0);
    small::add_transposed(v.T, width_, PT, width_, reduced, width_, reduction.free, n, reduction.free);
  } else {
    for (int c = 0; c < n; ++c) std::copy_n(P(0) + c * stride_, n, reduced + c * width_);
  }
  factor_reduced(reduced, reduction.free, initial_definite_tolerance, v.factor);
}

/// The initial state, given or free; false if active bounds contradict each other or the given state.
bool Riccati::solve_initial(const StageQp& qp, const ActiveSet& active, Iterate& step) noexcept {
  const Special first = special(0);
  const int N = qp.intervals(), n0 = qp.states(0);
  double *s0 = step.state(0), *multipliers = row_multipliers_.data();
  const Reduction& initial = reductions_[N];
  std::fill_n(step.costate(0), stride_, 0.0);
  std::fill_n(multipliers, initial.rows, 0.0);
  if (qp.initial_state_is_given) {
    std::copy_n(qp.initial_step(), n0, s0);
    for (int row = 0; row < initial.rows; ++row) {
      double value = d_[row], scale = std::abs(d_[row]);
      for (int c = 0; c < n0; ++c) {
        value -= first.C[c * max_rows_ + row] * s0[c];
        scale = std::max(scale, std::abs(first.C[c * max_rows_ + row] * s0[c]));
      }
      if (std::abs(value) > consistency_tolerance * (1.0 + scale)) return false;
    }
    std::copy_n(p(0), n0, step.costate(0));
    small::add_product(P(0), stride_, s0, step.costate(0), n0, n0);
  } else {
    const Special v = special(N);
    double free_step[max_width], gradient[max_width], transformed[3 * max_width];
    if (initial.overflow) return false;
    if (has_initial_inverse_) {
      kernels_->solve(P(0), initial_inverse_.data(), n0, stride_, p(0), s0);
    } else if (initial.plain) {
      for (int j = 0; j < n0; ++j) s0[j] = -p(0)[j];
      small::solve(v.factor, width_, n0, s0);
    } else {
      double scale = 0.0;
      for (int row = 0; row < initial.rows; ++row) scale = std::max(scale, std::abs(d_[row]));
      if (!transform_rows(d_.data(), initial, v, transformed, scale)) return false;
      std::fill_n(s0, n0, 0.0);
      for (int t = 0; t < initial.pivots; ++t) s0[v.pivot_column[t]] = transformed[v.pivot_row[t]];
      std::copy_n(p(0), n0, gradient);
      small::add_product(P(0), stride_, s0, gradient, n0, n0);
      std::fill_n(free_step, initial.free, 0.0);
      small::add_transposed_product(v.T, width_, gradient, free_step, n0, initial.free, -1.0);
      small::solve(v.factor, width_, initial.free, free_step);
      small::add_product(v.T, width_, free_step, s0, n0, initial.free);
      // P s + p + C' nu = 0 gives the multipliers of the pivot rows; the row operations give those of all rows.
      std::copy_n(p(0), n0, gradient);
      small::add_product(P(0), stride_, s0, gradient, n0, n0);
      double reduced[3 * max_width] = {};
      for (int t = 0; t < initial.pivots; ++t) reduced[v.pivot_row[t]] = -gradient[v.pivot_column[t]];
      small::add_transposed_product(v.eliminator, max_rows_, reduced, multipliers, initial.rows, initial.rows);
    }
  }
  write_bound_multipliers(qp, active, step, 0);
  return true;
}

}  // namespace rhec
