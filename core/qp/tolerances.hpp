#pragma once

#include <cmath>

namespace rhec {

/// A bound b counts as violated beyond this times 1 + |b|.
constexpr double bound_tolerance = 1e-10;
/// A multiplier has the wrong sign beyond this times 1 + the largest costate.
constexpr double multiplier_tolerance = 1e-9;
/// Active bounds contradict each other beyond this, relative to their size.
constexpr double consistency_tolerance = 1e-9;

inline bool is_equality(double lower, double upper) {
  return std::isfinite(lower) && upper - lower <= 1e-14 * (1.0 + std::abs(lower));
}

}  // namespace rhec
