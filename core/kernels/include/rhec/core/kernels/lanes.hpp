#pragma once

#include "rhec/core/base/padded.hpp"

// SIMD arithmetic on doubles with the compiler's vector types, as wide as a register of the instruction set. Included
// only by units that are compiled once per instruction set. All of their code is local to the unit: none of its
// functions may be merged with that of another set.

namespace rhec::kernels {
namespace {

// Sanitizers check each access, which makes inlined code large and its compilation long: with them, the compiler
// decides.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define RHEC_ALWAYS_INLINE
constexpr bool has_checks = true;
#else
#define RHEC_ALWAYS_INLINE __attribute__((always_inline))
constexpr bool has_checks = false;
#endif

/// A compile-time number, and lists of them. (The standard's templates could be merged with the instance of another
/// instruction set by the linker.)
template <int number>
struct Constant {
  constexpr operator int() const { return number; }
};
template <int...>
struct Constants {};
template <int count, int... numbers>
constexpr auto make_constants() {
  if constexpr (count > 0)
    return make_constants<count - 1, count - 1, numbers...>();
  else
    return Constants<numbers...>();
}

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

// Lanes anywhere in memory. (With memcpy the compiler would have to assume that every store changes everything.)
using LanesInMemory [[gnu::aligned(sizeof(double))]] = Lanes;
inline Lanes load(const double* from) { return *reinterpret_cast<const LanesInMemory*>(from); }
inline void store(const Lanes& lanes, double* to) { *reinterpret_cast<LanesInMemory*>(to) = lanes; }
inline Lanes all(double value) { return value - Lanes{}; }

/// The first `count` entries of a row, in its register number `part`; the others are zero.
inline Lanes first_of(const Lanes& lanes, int part, int count) {
  const LaneMask keep = lane_numbers < static_cast<long long>(count - part * lane_count);
  return keep ? lanes : Lanes{};
}

/// The same for the entries from .. end - 1.
inline Lanes between(const Lanes& lanes, int part, int from, int end) {
  const LaneMask is_left_out = lane_numbers < static_cast<long long>(from - part * lane_count);
  return is_left_out ? Lanes{} : first_of(lanes, part, end);
}

inline Lanes absolute(const Lanes& lanes) {
  constexpr long long but_sign = 0x7fff'ffff'ffff'ffff;
  return reinterpret_cast<Lanes>(reinterpret_cast<LaneMask>(lanes) & but_sign);
}
/// The larger of each pair; the first if they are not comparable (NaN).
inline Lanes larger(const Lanes& a, const Lanes& b) { return b > a ? b : a; }
inline Lanes smaller(const Lanes& a, const Lanes& b) { return b < a ? b : a; }

inline double sum_of(const Lanes& lanes) {
#if defined(__AVX512F__)
  const Lanes fours = lanes + __builtin_shufflevector(lanes, lanes, 4, 5, 6, 7, 0, 1, 2, 3);
  const Lanes twos = fours + __builtin_shufflevector(fours, fours, 2, 3, 0, 1, 6, 7, 4, 5);
  return twos[0] + twos[1];
#elif defined(__AVX2__)
  const Lanes twos = lanes + __builtin_shufflevector(lanes, lanes, 2, 3, 0, 1);
  return twos[0] + twos[1];
#else
  return lanes[0] + lanes[1];
#endif
}

inline double largest_of(const Lanes& lanes) {
#if defined(__AVX512F__)
  const Lanes fours = larger(lanes, __builtin_shufflevector(lanes, lanes, 4, 5, 6, 7, 0, 1, 2, 3));
  const Lanes twos = larger(fours, __builtin_shufflevector(fours, fours, 2, 3, 0, 1, 6, 7, 4, 5));
#elif defined(__AVX2__)
  const Lanes twos = larger(lanes, __builtin_shufflevector(lanes, lanes, 2, 3, 0, 1));
#else
  const Lanes& twos = lanes;
#endif
  return twos[1] > twos[0] ? twos[1] : twos[0];
}

/// A row, or a part of one, in registers.
template <int registers>
struct Row {
  /// Partial sums in a sum of many rows: two independent ones if there are registers for them.
  static constexpr int chains = registers == 1 ? 2 : 1;
  Lanes part[registers];
  static Row from(const double* memory) {
    Row row;
    for (int v = 0; v < registers; ++v) row.part[v] = load(memory + v * lane_count);
    return row;
  }
  void to(double* memory) const {
    for (int v = 0; v < registers; ++v) store(part[v], memory + v * lane_count);
  }
  double entry(int k) const { return part[k / lane_count][k % lane_count]; }
  /// One entry, copied to all lanes.
  Lanes splat(int k) const { return all(entry(k)); }
  template <int number>
  Lanes splat(Constant<number> /*k*/) const {
    const Lanes& from = part[number / lane_count];
    constexpr int at = number % lane_count;
#if defined(__AVX512F__)
    return __builtin_shufflevector(from, from, at, at, at, at, at, at, at, at);
#elif defined(__AVX2__)
    return __builtin_shufflevector(from, from, at, at, at, at);
#else
    return __builtin_shufflevector(from, from, at, at);
#endif
  }
  void add(const Row& other, const Lanes& factor) {
    for (int v = 0; v < registers; ++v) part[v] += other.part[v] * factor;
  }
  void add(const Row& other, double factor) { add(other, all(factor)); }
  void add(const Row& other) {
    for (int v = 0; v < registers; ++v) part[v] += other.part[v];
  }
  /// The row with one entry replaced.
  Row with(int k, double value) const {
    Row row = *this;
    const LaneMask is_it = lane_numbers == static_cast<long long>(k % lane_count);
    Lanes& changed = row.part[k / lane_count];
    changed = is_it ? all(value) : changed;
    return row;
  }
  /// The entries from .. end - 1; the others are zero.
  Row between(int from, int end) const {
    Row row;
    for (int v = 0; v < registers; ++v) row.part[v] = kernels::between(part[v], v, from, end);
    return row;
  }
  Row first(int count) const {
    Row row;
    for (int v = 0; v < registers; ++v) row.part[v] = first_of(part[v], v, count);
    return row;
  }
};

/// Transposes as many rows as they have lanes; only if a row of eight is one register.
inline void transpose([[maybe_unused]] Lanes* rows) {
#if defined(__AVX512F__)
  Lanes pairs[8], quads[8];
  for (int i = 0; i < 8; i += 2) {
    pairs[i] = __builtin_shufflevector(rows[i], rows[i + 1], 0, 8, 2, 10, 4, 12, 6, 14);
    pairs[i + 1] = __builtin_shufflevector(rows[i], rows[i + 1], 1, 9, 3, 11, 5, 13, 7, 15);
  }
  for (int i = 0; i < 8; i += 4) {
    for (int j = 0; j < 2; ++j) {
      quads[i + j] = __builtin_shufflevector(pairs[i + j], pairs[i + j + 2], 0, 1, 8, 9, 4, 5, 12, 13);
      quads[i + j + 2] = __builtin_shufflevector(pairs[i + j], pairs[i + j + 2], 2, 3, 10, 11, 6, 7, 14, 15);
    }
  }
  for (int j = 0; j < 4; ++j) {
    rows[j] = __builtin_shufflevector(quads[j], quads[j + 4], 0, 1, 2, 3, 8, 9, 10, 11);
    rows[j + 4] = __builtin_shufflevector(quads[j], quads[j + 4], 4, 5, 6, 7, 12, 13, 14, 15);
  }
#endif
}

}  // namespace
}  // namespace rhec::kernels
