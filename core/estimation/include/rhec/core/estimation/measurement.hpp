#pragma once

#include <cmath>
#include <limits>

namespace rhec {

/// Stands for an output or input that was not measured.
inline constexpr double missing_value = std::numeric_limits<double>::quiet_NaN();

/// False for what cannot be a measurement: NaN, infinities, and numbers so large that the arithmetic of a whole horizon
/// would suffer from them.
inline bool is_measurement(double value) noexcept { return std::abs(value) < 1e15; }

/// The value, or `missing_value` where it cannot be a measurement. Data are cleaned by this where they come in: by
/// Estimator, and of a recorded run by FullInformationEstimation. Behind them a value is finite or NaN.
inline double cleaned(double value) noexcept { return is_measurement(value) ? value : missing_value; }

}  // namespace rhec
