#pragma once

// Doubles that are computed with at once, in terms of the compiler's own vectors: as many as a register of the
// instruction set has. Included only by the units that are compiled once for each instruction set, all of whose code is
// local to them: no function of theirs may be merged with that of another set.

namespace rhec::kernels {
namespace {

#if defined(__AVX512F__)
constexpr int lane_count = 8;
using Lanes = double __attribute__((vector_size(64)));
using LaneMask = long long __attribute__((vector_size(64)));
constexpr LaneMask lane_numbers = {0, 1, 2, 3, 4, 5, 6, 7};
#elif defined(__AVX2__)
constexpr int lane_count = 4;
using Lanes = double __attribute__((vector_size(32)));
using LaneMask = long long __attribute__((vector_size(32)));
constexpr LaneMask lane_numbers = {0, 1, 2, 3};
#else
constexpr int lane_count = 2;
using Lanes = double __attribute__((vector_size(16)));
using LaneMask = long long __attribute__((vector_size(16)));
constexpr LaneMask lane_numbers = {0, 1};
#endif
/// Rows are multiples of eight doubles long.
constexpr int padded(int size) { return (size + 7) / 8 * 8; }

inline Lanes load(const double* from) {
  Lanes lanes;
  __builtin_memcpy(&lanes, from, sizeof lanes);
  return lanes;
}
inline void store(const Lanes& lanes, double* to) { __builtin_memcpy(to, &lanes, sizeof lanes); }
inline Lanes all(double value) { return Lanes{} + value; }

/// What is left of a row's part number `part` when only its first `count` entries are kept.
inline Lanes first_of(const Lanes& lanes, int part, int count) {
  const LaneMask keep = lane_numbers < static_cast<long long>(count - part * lane_count);
  return keep ? lanes : Lanes{};
}

inline Lanes absolute(const Lanes& lanes) { return lanes < 0.0 ? -lanes : lanes; }
/// The larger of each two; the first where they cannot be compared.
inline Lanes larger(const Lanes& a, const Lanes& b) { return b > a ? b : a; }
inline Lanes smaller(const Lanes& a, const Lanes& b) { return b < a ? b : a; }

inline double sum_of(const Lanes& lanes) {
#if defined(__AVX512F__)
  const Lanes fours = lanes + __builtin_shuffle(lanes, LaneMask{4, 5, 6, 7, 0, 1, 2, 3});
  const Lanes twos = fours + __builtin_shuffle(fours, LaneMask{2, 3, 0, 1, 6, 7, 4, 5});
  return twos[0] + twos[1];
#elif defined(__AVX2__)
  const Lanes twos = lanes + __builtin_shuffle(lanes, LaneMask{2, 3, 0, 1});
  return twos[0] + twos[1];
#else
  return lanes[0] + lanes[1];
#endif
}

inline double largest_of(const Lanes& lanes) {
  double result = lanes[0];
  for (int k = 1; k < lane_count; ++k) result = lanes[k] > result ? lanes[k] : result;
  return result;
}

}  // namespace
}  // namespace rhec::kernels
