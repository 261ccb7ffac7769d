#pragma once

#include <cstdint>

#include "rhec/core/qp/iterate.hpp"
#include "rhec/core/qp/stage_qp.hpp"

namespace rhec {

// Checks of whole stage QPs and iterates, with the widest SIMD registers of the machine.

/// Properties of a step that was found without some of the bounds.
struct StepCheck {
  bool is_finite = false;        ///< states, controls and costates
  bool violates = false;         ///< violates a bound b by more than tolerance (1 + |b|)
  double largest_costate = 0.0;  ///< absolute
};
RHEC_EXPORT StepCheck check_step(const StageQp& qp, const Iterate& step, double tolerance) noexcept;

/// Sets the mark of each of the N + 1 stages to 1 if a bound multiplier of the iterate is non-zero or two bounds of the
/// QP coincide, otherwise to 0. Returns true if a lower bound exceeds its upper bound by more than tolerance (1 +
/// |bound|), or a bound is NaN.
RHEC_EXPORT bool mark_bounds(const StageQp& qp, const Iterate& iterate, double tolerance, std::uint8_t* marks) noexcept;

struct ViolatedBounds {
  double largest = 0.0;  ///< the largest violation, if above 0
  int count = 0;         ///< number of violations above 0
};
/// Writes violations = max(least - values, values - most) for `count` entries, a multiple of eight.
RHEC_EXPORT ViolatedBounds find_violations(const double* values, const double* least, const double* most, int count,
                                           double* violations) noexcept;

/// Widens bounds by their tolerance: least = lower - tolerance (1 + |lower|), most = upper + tolerance (1 + |upper|),
/// for `count` entries, a multiple of eight.
RHEC_EXPORT void widen_bounds(const double* lower, const double* upper, double tolerance, int count, double* least,
                              double* most) noexcept;

/// Turns a step into the full next iterate: adds the values of `from`; the step's multipliers are already those of the
/// new iterate. Both have the same capacity.
RHEC_EXPORT void add_to_step(int intervals, const Iterate& from, Iterate& step) noexcept;

}  // namespace rhec
