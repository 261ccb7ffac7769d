#pragma once

#include <cstddef>
#include <cstring>
#include <vector>

namespace rhec::sim {

/// Number of lattice points per axis that contribute to a field value.
constexpr int lattice_taps = 12;

/// Sum of column_weights[c] * row_weights[r] * corner[r * stride + c] over `lattice_taps` rows and columns. All
/// variants add in the same order and give the same bits.
using LatticeSum = double (*)(const double* corner, std::ptrdiff_t stride, const double* row_weights,
                              const double* column_weights);

namespace lattice_sums {

// Four neighbours at once; the compiler does not vectorise this on its own. With two-lane registers it processes two at
// a time.
using Four [[gnu::vector_size(4 * sizeof(double))]] = double;

[[gnu::always_inline]] inline double add_up(const double* corner, std::ptrdiff_t stride, const double* row_weights,
                                            const double* column_weights) {
  constexpr int groups = lattice_taps / 4;
  static_assert(groups * 4 == lattice_taps);
  Four sums[groups] = {}, part;
  const double* const end = row_weights + lattice_taps;
  for (; row_weights != end; ++row_weights, corner += stride) {
    for (int group = 0; group < groups; ++group) {
      std::memcpy(&part, corner + 4 * group, sizeof part);
      sums[group] += *row_weights * part;
    }
  }
  double even = 0.0, odd = 0.0;
  for (int group = 0; group < groups; ++group) {
    std::memcpy(&part, column_weights + 4 * group, sizeof part);
    part *= sums[group];
    even = even + part[0] + part[2];
    odd = odd + part[1] + part[3];
  }
  return even + odd;
}

inline double plain(const double* corner, std::ptrdiff_t stride, const double* row_weights,
                    const double* column_weights) {
  return add_up(corner, stride, row_weights, column_weights);
}

#if defined(__x86_64__)
[[gnu::target("avx2")]] inline double avx2(const double* corner, std::ptrdiff_t stride, const double* row_weights,
                                           const double* column_weights) {
  return add_up(corner, stride, row_weights, column_weights);
}
#endif

}  // namespace lattice_sums

/// Variants that this machine can run, fastest last.
inline std::vector<LatticeSum> available_lattice_sums() {
  std::vector<LatticeSum> sums = {lattice_sums::plain};
#if defined(__x86_64__)
  if (__builtin_cpu_supports("avx2")) sums.push_back(lattice_sums::avx2);
#endif
  return sums;
}

}  // namespace rhec::sim
