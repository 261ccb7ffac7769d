#pragma once

#include <type_traits>

namespace rhec {

/// Calls `function` with a size: as a compile-time constant for the sizes common in vehicle models (3 to 8), so that
/// short loops are unrolled, otherwise as an int.
template <class Function>
decltype(auto) with_size(int size, const Function& function) {
  switch (size) {
    case 3:
      return function(std::integral_constant<int, 3>{});
    case 4:
      return function(std::integral_constant<int, 4>{});
    case 5:
      return function(std::integral_constant<int, 5>{});
    case 6:
      return function(std::integral_constant<int, 6>{});
    case 7:
      return function(std::integral_constant<int, 7>{});
    case 8:
      return function(std::integral_constant<int, 8>{});
    default:
      return function(size);
  }
}

}  // namespace rhec
