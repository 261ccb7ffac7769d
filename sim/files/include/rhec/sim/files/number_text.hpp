#pragma once

#include <string>

#include "rhec/core/base/export.hpp"

namespace rhec::sim {

/// Decimals that a variable of a typical magnitude is written with: a hundred-thousandth of it is seen.
RHEC_EXPORT int decimals_for(double scale) noexcept;

/// Appends a number as JSON has it, with so many decimals at most and no needless zeros; null where it is not finite.
/// Several times as fast as a general format, since windows have hundreds of numbers each.
RHEC_EXPORT void append_number(double value, int decimals, std::string& text);

}  // namespace rhec::sim
