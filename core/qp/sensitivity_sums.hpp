#pragma once

#include <algorithm>
#include <cstddef>

namespace rhec {

/// Four independent partial sums.
inline double dot(const double* a, const double* b, int count) noexcept {
  double sums[4] = {};
  int k = 0;
  for (; k + 4 <= count; k += 4)
    for (int j = 0; j < 4; ++j) sums[j] += a[k + j] * b[k + j];
  for (; k < count; ++k) sums[0] += a[k] * b[k];
  return (sums[0] + sums[1]) + (sums[2] + sums[3]);
}

/// Calls function(number) for the batches with a non-zero weight.
template <class Weights, class Function>
void for_each_weighted(const Weights& weights, const Function& function) {
  const auto is_zero = [](double weight) { return weight == 0.0; };
  for (std::size_t k = 0; k < weights.size(); ++k)
    if (!std::all_of(weights[k].begin(), weights[k].end(), is_zero)) function(static_cast<int>(k));
}

}  // namespace rhec
