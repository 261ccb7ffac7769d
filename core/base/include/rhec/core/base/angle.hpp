#pragma once

#include <cmath>
#include <numbers>

namespace rhec {

/// The signed difference a - b on the circle, in (-pi, pi].
inline double angle_difference(double a, double b) noexcept {
  const double difference = a - b;
  return std::abs(difference) <= std::numbers::pi ? difference : std::remainder(difference, 2.0 * std::numbers::pi);
}

}  // namespace rhec
