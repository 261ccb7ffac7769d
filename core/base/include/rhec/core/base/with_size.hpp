#pragma once

#include <type_traits>

namespace rhec {

/// Calls `function` with a number: as a constant of the compiler for those that vehicles usually have, so that short
/// loops to it become straight code, else as an int.
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
