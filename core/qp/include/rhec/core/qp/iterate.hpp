#pragma once

#include <cstddef>

#include "rhec/core/base/aligned.hpp"
#include "rhec/core/base/assertion.hpp"
#include "rhec/core/base/export.hpp"
#include "rhec/core/base/padded.hpp"

namespace rhec {

/// The sizes for which memory is allocated: the largest structure of a problem.
struct Capacity {
  int intervals = 0;  ///< N
  int states = 0;     ///< n_s, at any node
  int controls = 0;   ///< n_w, on any interval
  int limits = 0;     ///< n_g, at any node

  bool operator==(const Capacity&) const = default;

  /// The length of a row z = [s; w] of one stage in memory, padded to a multiple of eight. The state begins at 0 and
  /// the control at `states`, however many of them a stage uses.
  int row() const noexcept {
    const int used = states + controls;
    return used > 32 ? (used + 63) / 64 * 64 : padded(used);
  }
  /// The same for a row of limits g.
  int limit_row() const noexcept { return padded(limits); }
};

/// Consecutive stages first .. last (both included).
struct StageRange {
  int first = 0;
  int last = 0;
};

/// A primal-dual iterate of an Ocp. Rows have the capacity's length, whatever a stage uses. With the Lagrangian
///
///     L = sum_i l_i(s_i, w_i) + sum_i costate_{i+1}' (F_i(s_i, w_i) - s_{i+1}) + sum_i state_bound_i' s_i +
///     control_bound_i' w_i + limit_bound_i' g_i(s_i, w_i)
///
/// a multiplier of a bound or limit is positive at the upper side, negative at the lower one and zero between
/// (docs/method.md, section 7). That of a violated soft limit has its side's sign and the size linear + quadratic times
/// the violation. costate_0 belongs to a given initial state; it is zero if the initial state is free.
class RHEC_EXPORT Iterate {
 public:
  Iterate() = default;
  explicit Iterate(const Capacity& capacity);

  const Capacity& capacity() const noexcept { return capacity_; }

  double* state(int node) noexcept { return at(values_, node); }
  double* control(int interval) noexcept { return at(values_, interval) + capacity_.states; }
  double* costate(int node) noexcept { return at(costates_, node); }
  double* state_bound(int node) noexcept { return at(bounds_, node); }
  double* control_bound(int interval) noexcept { return at(bounds_, interval) + capacity_.states; }
  const double* state(int node) const noexcept { return at(values_, node); }
  const double* control(int interval) const noexcept { return at(values_, interval) + capacity_.states; }
  const double* costate(int node) const noexcept { return at(costates_, node); }
  const double* state_bound(int node) const noexcept { return at(bounds_, node); }
  const double* control_bound(int interval) const noexcept { return at(bounds_, interval) + capacity_.states; }

  /// Multipliers of the limits of a stage; rows of capacity().limit_row() are consecutive.
  double* limit_bound(int stage) noexcept { return limits_.data() + limit_place(stage); }
  const double* limit_bound(int stage) const noexcept { return limits_.data() + limit_place(stage); }

  /// Values and bound multipliers of a stage as one row [s; w]; rows are consecutive.
  double* row(int stage) noexcept { return at(values_, stage); }
  double* bound_row(int stage) noexcept { return at(bounds_, stage); }
  const double* row(int stage) const noexcept { return at(values_, stage); }
  const double* bound_row(int stage) const noexcept { return at(bounds_, stage); }

  bool is_finite() const noexcept;
  void clear_multipliers() noexcept;

 private:
  double* at(AlignedDoubles& v, int i) const noexcept {
    RHEC_ASSERT(i >= 0 && i <= capacity_.intervals, "a stage of the capacity");
    return v.data() + static_cast<std::ptrdiff_t>(i) * row_;
  }
  const double* at(const AlignedDoubles& v, int i) const noexcept {
    RHEC_ASSERT(i >= 0 && i <= capacity_.intervals, "a stage of the capacity");
    return v.data() + static_cast<std::ptrdiff_t>(i) * row_;
  }
  std::ptrdiff_t limit_place(int stage) const noexcept {
    RHEC_ASSERT(stage >= 0 && stage <= capacity_.intervals, "a stage of the capacity");
    return static_cast<std::ptrdiff_t>(stage) * capacity_.limit_row();
  }

  Capacity capacity_;
  int row_ = 0;
  AlignedDoubles values_, costates_, bounds_, limits_;
};

}  // namespace rhec
