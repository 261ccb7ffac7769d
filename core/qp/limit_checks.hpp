#pragma once

#include "rhec/core/qp/riccati.hpp"

namespace rhec {

/// Takes the limits that are active, or violated, from an iterate's multipliers; false if there are none.
bool guess_limits(const StageQp& qp, const Iterate& iterate, ActiveSet& active) noexcept;

/// Whether the bounds of a limit cross by more than tolerance (1 + |bound|), or a bound, weight or entry of G is NaN.
bool limits_cross(const StageQp& qp, double tolerance) noexcept;

/// H += weight row'row, h += gradient row'.
void add_row(const double* row, double weight, double gradient, int stride, double* H, double* h) noexcept;

}  // namespace rhec
