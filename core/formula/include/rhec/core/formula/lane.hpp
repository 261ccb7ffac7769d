#pragma once

// The numbers that interpreter and compiled kernels compute with, in units that are compiled for one instruction set:
// `Lane` is the widest pack of a unit that defines RHEC_PACK_NAMESPACE, and else a double. Both compute a given
// instruction with the same operations, so that they give the same bits: products are fused with sums where the
// instruction says so and the instruction set can, and nowhere else (compile with -ffp-contract=off).

#include <cmath>
#include <cstdint>
#include <utility>

#if defined(RHEC_PACK_NAMESPACE)
#include "rhec/core/packs/pack.hpp"
#endif

#include "rhec/core/base/unrolled.hpp"

namespace rhec {

#if defined(RHEC_PACK_NAMESPACE)
using Lane = WidestPack;
inline constexpr int lane_width = Lane::width;
RHEC_INLINE static inline Lane load_lane(const double* from) { return Lane::load(from); }
RHEC_INLINE static inline void store_lane(Lane value, double* to) { value.store(to); }
#else
using Lane = double;
inline constexpr int lane_width = 1;
RHEC_INLINE static inline Lane load_lane(const double* from) { return *from; }
RHEC_INLINE static inline void store_lane(Lane value, double* to) { *to = value; }
RHEC_INLINE static inline Lane multiply_add(Lane a, Lane b, Lane c) { return a * b + c; }
RHEC_INLINE static inline Lane multiply_subtract(Lane a, Lane b, Lane c) { return a * b - c; }
RHEC_INLINE static inline Lane subtract_product(Lane c, Lane a, Lane b) { return c - a * b; }
RHEC_INLINE static inline std::pair<Lane, Lane> sincos(Lane angle) { return {std::sin(angle), std::cos(angle)}; }
#endif

RHEC_INLINE static inline Lane reciprocal(Lane a) { return Lane(1.0) / a; }

RHEC_INLINE static inline Lane to_power(Lane base, std::uint32_t exponent) {
  Lane result(1.0);
  for (; exponent > 0; exponent >>= 1, base = base * base)
    if (exponent & 1) result = result * base;
  return result;
}

}  // namespace rhec
