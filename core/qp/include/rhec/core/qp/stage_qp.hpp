#pragma once

#include <cstddef>
#include <vector>

#include "rhec/core/base/assertion.hpp"
#include "rhec/core/qp/iterate.hpp"

namespace rhec {

/// An Ocp linearised at an iterate (docs/method.md, section 7), in the steps z_i = [ds_i; dw_i] from there:
///
///     minimise    sum_{i=0}^{N} 1/2 z_i' H_i z_i + h_i' z_i                           (no dw at node N)
///     subject to  ds_{i+1} = AB_i z_i + b_i,   lower_i <= z_i <= upper_i
///                 ds_0 = initial_step where the initial state is given
///                 limit_lower_i - sigma_i <= G_i z_i <= limit_upper_i + sigma_i,   sigma_i >= 0
///
/// with  AB = [A B],  H = [Q S'; S R],  h = [q; r]. Limits are the rows of G: a soft one may be violated by sigma, at
/// the cost  linear sigma + 1/2 quadratic sigma^2  beside those above; a hard one has an infinite linear weight.
///
/// Sizes are set per stage at run time; storage never moves, except in `drop_first`. All rows have length `stride`
/// (capacity().row()). A stage's AB has n_s rows (row r: derivatives of next state r). Its H is symmetric, with as many
/// rows (or columns) as z has entries and both halves filled. Its G has one row per limit; what belongs to limits has
/// rows of capacity().limit_row() entries. Unused entries of a row are zero and have no bounds.
class RHEC_EXPORT StageQp {
 public:
  StageQp() = default;
  explicit StageQp(const Capacity& capacity);
  /// A window that stores only `stages` stages of a QP of this capacity at a time, to process a long horizon piece by
  /// piece within the processor's cache. Only the stages from `look_at` on may be accessed.
  StageQp(const Capacity& capacity, int stages);
  /// Moves the window to the stages `first`, first + 1, ...; their content is undefined.
  void look_at(int first) noexcept;
  int window() const noexcept { return window_; }  ///< number of stages stored; 0: all

  const Capacity& capacity() const noexcept { return capacity_; }
  int stride() const noexcept { return stride_; }
  int intervals() const noexcept { return intervals_; }
  int states(int node) const noexcept { return state_counts_[node]; }
  int controls(int interval) const noexcept { return interval < intervals_ ? control_counts_[interval] : 0; }
  int limits(int node) const noexcept { return limit_counts_[node]; }
  bool has_limits() const noexcept { return capacity_.limits > 0; }
  const int* state_counts() const noexcept { return state_counts_.data(); }
  const int* control_counts() const noexcept { return control_counts_.data(); }  ///< for intervals 0 .. N - 1
  const int* identity_counts() const noexcept { return identity_counts_.data(); }
  const int* limit_counts() const noexcept { return limit_counts_.data(); }
  void set_intervals(int intervals) noexcept {
    RHEC_ASSERT(intervals >= 0 && intervals <= capacity_.intervals, "at most the capacity");
    intervals_ = intervals;
  }
  /// Clears entries that a smaller stage no longer uses. The last `identities` states are carried over unchanged by the
  /// interval: their rows of AB are, or will be, rows of the identity, and solvers may rely on it.
  void set_sizes(int node, int states, int controls, int identities = 0) noexcept {
    RHEC_ASSERT(node >= 0 && node <= capacity_.intervals, "a node of the capacity");
    RHEC_ASSERT(states <= capacity_.states && controls <= capacity_.controls && identities <= states,
                "at most the capacity");
    if (states < state_counts_[node] || controls < control_counts_[node]) clear(node);
    state_counts_[node] = states;
    control_counts_[node] = controls;
    identity_counts_[node] = identities;
  }
  /// The number of limits of a node; clears those that it no longer uses.
  void set_limits(int node, int limits) noexcept {
    RHEC_ASSERT(limits >= 0 && limits <= capacity_.limits, "at most the capacity");
    if (limits < limit_counts_[node]) clear_limits(node);
    limit_counts_[node] = limits;
  }
  /// Moves AB, b, H, h, the limits and sizes towards the front by `stages`; zeros follow.
  void drop_first(int stages) noexcept;
  /// Becomes a copy of a whole QP of the same capacity, of as many stages as that has.
  void take_stages(const StageQp& from) noexcept;
  bool initial_state_is_given = false;
  /// For callers that write to AB: no row counts as a row of the identity any more.
  void drop_identity_rows() noexcept;

  // Raw access for kernels: pointers to stage i.
  double* AB(int i) noexcept { return at(AB_, first_ + i, capacity_.states); }
  double* H(int i) noexcept { return at(H_, first_ + i, wide_); }
  double* h(int i) noexcept { return at(h_, first_ + i, 1); }
  double* b(int i) noexcept { return at(b_, first_ + i, 1); }
  double* lower(int i) noexcept { return at(lower_, first_bounds_ + i, 1); }
  double* upper(int i) noexcept { return at(upper_, first_bounds_ + i, 1); }
  double* q(int i) noexcept { return h(i); }
  double* r(int i) noexcept { return h(i) + capacity_.states; }
  double* state_lower(int i) noexcept { return lower(i); }
  double* state_upper(int i) noexcept { return upper(i); }
  double* control_lower(int i) noexcept { return lower(i) + capacity_.states; }
  double* control_upper(int i) noexcept { return upper(i) + capacity_.states; }
  double* initial_step() noexcept { return initial_step_.data(); }
  double* G(int i) noexcept { return at(G_, first_ + i, capacity_.limits); }
  double* limit_lower(int i) noexcept { return of_limits(i, 0); }
  double* limit_upper(int i) noexcept { return of_limits(i, 1); }
  double* limit_linear(int i) noexcept { return of_limits(i, 2); }
  double* limit_quadratic(int i) noexcept { return of_limits(i, 3); }
  const double* AB(int i) const noexcept { return at(AB_, first_ + i, capacity_.states); }
  const double* H(int i) const noexcept { return at(H_, first_ + i, wide_); }
  const double* h(int i) const noexcept { return at(h_, first_ + i, 1); }
  const double* b(int i) const noexcept { return at(b_, first_ + i, 1); }
  const double* lower(int i) const noexcept { return at(lower_, first_bounds_ + i, 1); }
  const double* upper(int i) const noexcept { return at(upper_, first_bounds_ + i, 1); }
  const double* q(int i) const noexcept { return h(i); }
  const double* r(int i) const noexcept { return h(i) + capacity_.states; }
  const double* state_lower(int i) const noexcept { return lower(i); }
  const double* state_upper(int i) const noexcept { return upper(i); }
  const double* control_lower(int i) const noexcept { return lower(i) + capacity_.states; }
  const double* control_upper(int i) const noexcept { return upper(i) + capacity_.states; }
  const double* initial_step() const noexcept { return initial_step_.data(); }
  const double* G(int i) const noexcept { return at(G_, first_ + i, capacity_.limits); }
  const double* limit_lower(int i) const noexcept { return of_limits(i, 0); }
  const double* limit_upper(int i) const noexcept { return of_limits(i, 1); }
  const double* limit_linear(int i) const noexcept { return of_limits(i, 2); }
  const double* limit_quadratic(int i) const noexcept { return of_limits(i, 3); }

 private:
  double* at(AlignedDoubles& v, int i, int rows) const noexcept {
    RHEC_ASSERT(is_held(v, i, rows), "a stage that is held");
    return v.data() + static_cast<std::ptrdiff_t>(i) * rows * stride_;
  }
  const double* at(const AlignedDoubles& v, int i, int rows) const noexcept {
    RHEC_ASSERT(is_held(v, i, rows), "a stage that is held");
    return v.data() + static_cast<std::ptrdiff_t>(i) * rows * stride_;
  }
  bool is_held(const AlignedDoubles& v, int i, int rows) const noexcept {
    // Kernels take the address that stage 0 would have, whether a window holds it or not.
    return window_ > 0 || (i >= 0 && (static_cast<std::ptrdiff_t>(i) + 1) * rows * stride_ <= std::ssize(v));
  }
  /// Bounds and weights of a stage's limits are four consecutive rows.
  static constexpr int rows_of_limits = 4;
  std::ptrdiff_t limit_place(int i, int row) const noexcept {
    return (static_cast<std::ptrdiff_t>(first_ + i) * rows_of_limits + row) * capacity_.limit_row();
  }
  double* of_limits(int i, int row) noexcept { return limits_.data() + limit_place(i, row); }
  const double* of_limits(int i, int row) const noexcept { return limits_.data() + limit_place(i, row); }
  void clear(int i) noexcept;
  void clear_limits(int i) noexcept;

  Capacity capacity_;
  int stride_ = 0, wide_ = 0, intervals_ = 0;
  int window_ = 0;
  int first_ = 0;         ///< slot of stage 0 in AB, b, H, h and the limits, so that moving them copies nothing
  int first_bounds_ = 0;  ///< the same for the bounds
  std::vector<int> state_counts_, control_counts_, identity_counts_, limit_counts_;
  AlignedDoubles AB_, H_, h_, b_, lower_, upper_, initial_step_, G_, limits_;
};

}  // namespace rhec
