#pragma once

#include <cstddef>
#include <cstdint>

namespace rhec {

/// How many doubles further on memory begins where registers and cache lines do: 0 to 7.
inline std::ptrdiff_t first_aligned(const double* memory) noexcept {
  const auto beyond = reinterpret_cast<std::uintptr_t>(memory) % 64;
  return beyond == 0 ? 0 : static_cast<std::ptrdiff_t>((64 - beyond) / sizeof(double));
}

}  // namespace rhec
