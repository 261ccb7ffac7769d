#pragma once

#include <string>

#include "rhec/core/base/export.hpp"

namespace rhec::sim {

/// Decimals for writing a variable of typical magnitude `scale`: enough to resolve 1e-5 of it.
RHEC_EXPORT int decimals_for(double scale) noexcept;

/// Appends a JSON number with at most `decimals` decimals and no trailing zeros; null if it is not finite. Several
/// times faster than general formatting, since each window has hundreds of numbers.
RHEC_EXPORT void append_number(double value, int decimals, std::string& text);

}  // namespace rhec::sim
