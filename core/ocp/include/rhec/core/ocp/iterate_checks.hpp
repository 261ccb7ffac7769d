#pragma once

#include <span>

#include "rhec/core/ocp/ocp.hpp"

namespace rhec {

// What solvers ask of a primal-dual iterate, over the stages that the problem really uses.

/// Every state, control and multiplier is finite.
RHEC_EXPORT bool is_finite(const Ocp& ocp, const Iterate& iterate) noexcept;
/// What `is_sound_start` asks for but for the objective, for who is about to evaluate that anyway.
RHEC_EXPORT bool has_sound_numbers(const Ocp& ocp, const Iterate& iterate) noexcept;
/// A solver can start here: iterate and objective are finite, the capacities are the same, and no bound is NaN.
/// `scratch` is of the Ocp's `scratch_size()`.
RHEC_EXPORT bool is_sound_start(const Ocp& ocp, const Iterate& iterate, std::span<double> scratch) noexcept;
/// max |costate| of nodes 1 .. N; zero means that the iterate has no history.
RHEC_EXPORT double largest_costate(const Ocp& ocp, const Iterate& iterate) noexcept;
RHEC_EXPORT double largest_bound_multiplier(const Ocp& ocp, const Iterate& iterate) noexcept;
/// Sum of what bounds are violated by.
RHEC_EXPORT double total_violation(const Ocp& ocp, const Iterate& iterate) noexcept;

}  // namespace rhec
