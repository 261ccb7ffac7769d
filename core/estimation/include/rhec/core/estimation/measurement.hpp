#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include "rhec/core/model/model.hpp"

namespace rhec {

/// Marks an output or input that was not measured.
inline constexpr double missing_value = std::numeric_limits<double>::quiet_NaN();

/// False for values that cannot be a measurement: NaN, infinity, and numbers so large that they would spoil the
/// arithmetic of the whole horizon.
inline bool is_measurement(double value) noexcept { return std::abs(value) < 1e15; }

/// The value, or `missing_value` if it cannot be a measurement. Data are cleaned where they enter: in Estimator, and
/// for recorded runs in FullInformationEstimation. Behind these a value is finite or NaN.
inline double cleaned(double value) noexcept { return is_measurement(value) ? value : missing_value; }

/// Standard deviation of an input that was not measured, in its unit: a hundred times its typical magnitude, but no
/// more than half of the range that it is bounded to.
inline double unknown_sigma(const Variable& input) noexcept {
  return std::min(100.0 * input.scale, 0.5 * (input.upper - input.lower));
}

}  // namespace rhec
