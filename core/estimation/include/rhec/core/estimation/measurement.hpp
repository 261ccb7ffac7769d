#pragma once

#include <cmath>
#include <limits>

namespace rhec {

/// Marks an output or input that was not measured.
inline constexpr double missing_value = std::numeric_limits<double>::quiet_NaN();

/// False for values that cannot be a measurement: NaN, infinity, and numbers so large that they would spoil the
/// arithmetic of the whole horizon.
inline bool is_measurement(double value) noexcept { return std::abs(value) < 1e15; }

/// The value, or `missing_value` if it cannot be a measurement. Data are cleaned where they enter: in Estimator, and
/// for recorded runs in FullInformationEstimation. Behind these a value is finite or NaN.
inline double cleaned(double value) noexcept { return is_measurement(value) ? value : missing_value; }

}  // namespace rhec
