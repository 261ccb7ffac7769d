#pragma once

#include <cstdint>

#include "rhec/core/qp/iterate.hpp"
#include "rhec/core/qp/stage_qp.hpp"

namespace rhec {

// Looks at whole stage QPs and points, on registers as wide as the machine has.

/// What a step that was found without some of the bounds says of them.
struct StepCheck {
  bool is_finite = false;        ///< states, controls and costates
  bool violates = false;         ///< a bound b by more than tolerance (1 + |b|)
  double largest_costate = 0.0;  ///< absolute
};
RHEC_EXPORT StepCheck check_step(const StageQp& qp, const Iterate& step, double tolerance) noexcept;

/// Marks each of the N + 1 stages with 1 at which a bound multiplier of the iterate is not zero, or two bounds of the
/// QP coincide, and 0 otherwise. True where a lower bound is above its upper one by more than tolerance (1 +
/// |bound|), or one of them is not a number.
RHEC_EXPORT bool mark_bounds(const StageQp& qp, const Iterate& iterate, double tolerance, std::uint8_t* marks) noexcept;

struct ViolatedBounds {
  double largest = 0.0;  ///< violation, if it is above 0
  int count = 0;         ///< of those that are above 0
};
/// Writes violations = max(least - values, values - most), of `count` entries, which are whole eights.
RHEC_EXPORT ViolatedBounds find_violations(const double* values, const double* least, const double* most, int count,
                                           double* violations) noexcept;

/// Bounds b that are violated by more than tolerance (1 + |b|) only: from there on least and most are; of `count`
/// entries, which are whole eights.
RHEC_EXPORT void widen_bounds(const double* lower, const double* upper, double tolerance, int count, double* least,
                              double* most) noexcept;

/// Makes of a step the iterate that it leads to, all of it: values are added, its multipliers are those of the iterate
/// already. Both are of one capacity.
RHEC_EXPORT void add_to_step(int intervals, const Iterate& from, Iterate& step) noexcept;

}  // namespace rhec
