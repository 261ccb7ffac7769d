#pragma once

#include <limits>

namespace rhec {

/// The bound that is none.
inline constexpr double infinity = std::numeric_limits<double>::infinity();

}  // namespace rhec
