#pragma once

#include <cstddef>
#include <cstring>

// What is done with small matrices again and again, in few instructions.
namespace rhec {

/// Whether all numbers in a vector or a matrix are.
template <class Numbers>
bool are_finite(const Numbers& numbers) noexcept {
  const double* each = numbers.data();
  double zeros[4] = {};  // they stay 0 as long as every number is finite, else NaN
  const auto count = static_cast<std::size_t>(numbers.size());
  std::size_t i = 0;
  for (; i + 4 <= count; i += 4)
    for (std::size_t k = 0; k < 4; ++k) zeros[k] += 0.0 * each[i + k];
  for (; i < count; ++i) zeros[0] += 0.0 * each[i];
  return zeros[0] + zeros[1] + zeros[2] + zeros[3] == 0.0;
}

/// Copies a vector or a matrix to one of its size.
template <class Numbers>
void copy_numbers(const Numbers& from, Numbers& to) noexcept {
  std::memcpy(to.data(), from.data(), static_cast<std::size_t>(from.size()) * sizeof(double));
}

}  // namespace rhec
