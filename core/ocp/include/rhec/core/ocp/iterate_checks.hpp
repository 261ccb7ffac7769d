#pragma once

#include <span>

#include "rhec/core/ocp/ocp.hpp"

namespace rhec {

// Checks of a primal-dual iterate, over the entries that the problem uses.

/// Every state, control and multiplier is finite.
RHEC_EXPORT bool is_finite(const Ocp& ocp, const Iterate& iterate) noexcept;
/// The conditions of `is_sound_start` without the objective, for callers that evaluate it anyway.
RHEC_EXPORT bool has_sound_numbers(const Ocp& ocp, const Iterate& iterate) noexcept;
/// Whether a solver can start here: iterate, objective and the initial state, if it is given, are finite, capacities
/// match, and no bound is NaN. `scratch` has the Ocp's `scratch_size()`.
RHEC_EXPORT bool is_sound_start(const Ocp& ocp, const Iterate& iterate, std::span<double> scratch) noexcept;
/// max |costate| of nodes 1 .. N; zero means a cold start.
RHEC_EXPORT double largest_costate(const Ocp& ocp, const Iterate& iterate) noexcept;
RHEC_EXPORT double largest_bound_multiplier(const Ocp& ocp, const Iterate& iterate) noexcept;
/// Sum of all bound violations.
RHEC_EXPORT double total_violation(const Ocp& ocp, const Iterate& iterate) noexcept;

}  // namespace rhec
