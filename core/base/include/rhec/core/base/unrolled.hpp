#pragma once

#include <utility>

/// For functions and lambdas that must always be inlined.
#define RHEC_INLINE __attribute__((always_inline))

namespace rhec {

/// Calls function(0), ..., function(count - 1) with compile-time indices. No loop remains, so the compiler keeps what
/// it knows of single entries (e.g. that a derivative is always 0 or 1).
template <int count, class Function>
RHEC_INLINE constexpr void for_indices(const Function& function) {
  [&]<int... index>(std::integer_sequence<int, index...>) RHEC_INLINE {
    (function(std::integral_constant<int, index>()), ...);
  }
  (std::make_integer_sequence<int, count>());
}

}  // namespace rhec
