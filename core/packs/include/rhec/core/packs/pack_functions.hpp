#pragma once

// Sine, cosine and tangent of packs. xsimd's own accept every argument, with so much code that a model's kernels would
// not fit into the instruction cache. Here large arguments are left to the standard library, out of line. Included by
// pack.hpp, under the pack's namespace.

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <xsimd/xsimd.hpp>

#include "rhec/core/base/unrolled.hpp"

namespace rhec {

// a b + c, a b - c and c - a b, rounded once. xsimd has none of them for AVX-512, and leaves that to the compiler,
// which is told not to fuse what is written apart (rhec/core/formula/lane.hpp).
#if defined(__aarch64__)
RHEC_INLINE static inline float64x2_t fused_multiply_add(float64x2_t a, float64x2_t b, float64x2_t c) {
  return vfmaq_f64(c, a, b);
}
RHEC_INLINE static inline float64x2_t fused_multiply_subtract(float64x2_t a, float64x2_t b, float64x2_t c) {
  return vfmaq_f64(vnegq_f64(c), a, b);
}
RHEC_INLINE static inline float64x2_t fused_subtract_product(float64x2_t c, float64x2_t a, float64x2_t b) {
  return vfmsq_f64(c, a, b);
}
#endif
#if defined(__AVX2__) && defined(__FMA__)
RHEC_INLINE static inline __m256d fused_multiply_add(__m256d a, __m256d b, __m256d c) {
  return _mm256_fmadd_pd(a, b, c);
}
RHEC_INLINE static inline __m256d fused_multiply_subtract(__m256d a, __m256d b, __m256d c) {
  return _mm256_fmsub_pd(a, b, c);
}
RHEC_INLINE static inline __m256d fused_subtract_product(__m256d c, __m256d a, __m256d b) {
  return _mm256_fnmadd_pd(a, b, c);
}
#endif
#if defined(__AVX512F__)
RHEC_INLINE static inline __m512d fused_multiply_add(__m512d a, __m512d b, __m512d c) {
  return _mm512_fmadd_pd(a, b, c);
}
RHEC_INLINE static inline __m512d fused_multiply_subtract(__m512d a, __m512d b, __m512d c) {
  return _mm512_fmsub_pd(a, b, c);
}
RHEC_INLINE static inline __m512d fused_subtract_product(__m512d c, __m512d a, __m512d b) {
  return _mm512_fnmadd_pd(a, b, c);
}
#endif

}  // namespace rhec

namespace rhec::pack_functions {

template <class Pack>
RHEC_INLINE inline Pack fma(const Pack& a, const Pack& b, const Pack& c) {
  using Register = typename Pack::register_type;
  return Pack(fused_multiply_add(Register(a), Register(b), Register(c)));
}
template <class Pack>
RHEC_INLINE inline Pack fnma(const Pack& a, const Pack& b, const Pack& c) {
  using Register = typename Pack::register_type;
  return Pack(fused_subtract_product(Register(c), Register(a), Register(b)));
}

/// Up to this angle, two products give the distance to the nearest multiple of pi/2.
inline constexpr double near = 1e9;

template <class Pack>
struct SineCosine {
  Pack sine, cosine;
};

template <class Pack>
[[gnu::cold, gnu::noinline]] SineCosine<Pack> of_far(Pack angle) {
  constexpr std::size_t width = Pack::size;
  alignas(64) double angles[width], sines[width], cosines[width];
  angle.store_aligned(angles);
  for (std::size_t i = 0; i < width; ++i) {
    sines[i] = std::sin(angles[i]);
    cosines[i] = std::cos(angles[i]);
  }
  return {Pack::load_aligned(sines), Pack::load_aligned(cosines)};
}

/// Sine and cosine to about one unit in the last place. With angle = n pi/2 + r, |r| <= pi/4 and t = r^2,
///
///     sin r = r + r t P(t),    cos r = 1 - t/2 + t^2 Q(t)
///
/// where P and Q are Chebyshev fits of degree 5 on [0, (pi/4)^2], computed with 50 digits; their errors are 2e-17 and
/// 2e-18.
template <class Pack>
[[gnu::always_inline]] inline SineCosine<Pack> sine_cosine(const Pack& angle) {
  using Bits = xsimd::batch<std::int64_t, typename Pack::arch_type>;
  constexpr double to_integer = 6755399441055744.0;  // 1.5 * 2^52: adding it rounds to an integer
  if (xsimd::any(xsimd::abs(angle) > Pack(near))) [[unlikely]]
    return of_far(angle);
  const Pack shifted = pack_functions::fma(angle, Pack(0x1.45f306dc9c883p-1), Pack(to_integer)),
             n = shifted - Pack(to_integer);
  // pi/2 in two parts: the first product leaves no rounding error.
  const Pack r =
      pack_functions::fnma(n, Pack(0x1.1a62633145c07p-54), pack_functions::fnma(n, Pack(0x1.921fb54442d18p+0), angle));
  const Pack t = r * r;
  Pack p = pack_functions::fma(t, Pack(0x1.5e0b05bff20f2p-33), Pack(-0x1.ae600aca92c64p-26));
  Pack q = pack_functions::fma(t, Pack(-0x1.907d8f29fe831p-37), Pack(0x1.1eeb68cd22f56p-29));
  p = pack_functions::fma(t, p, Pack(0x1.71de379654304p-19));
  q = pack_functions::fma(t, q, Pack(-0x1.27e4fa17bf139p-22));
  p = pack_functions::fma(t, p, Pack(-0x1.a01a019e83816p-13));
  q = pack_functions::fma(t, q, Pack(0x1.a01a019f4e9b4p-16));
  p = pack_functions::fma(t, p, Pack(0x1.1111111110bb2p-7));
  q = pack_functions::fma(t, q, Pack(-0x1.6c16c16c16967p-10));
  p = pack_functions::fma(t, p, Pack(-0x1.5555555555555p-3));
  q = pack_functions::fma(t, q, Pack(0x1.5555555555555p-5));
  const Pack sine = pack_functions::fma(r * t, p, r),
             cosine = pack_functions::fma(t * t, q, pack_functions::fnma(t, Pack(0.5), Pack(1.0)));
  // A quarter turn swaps the two; the second bit of n is the sine's sign, that of n + 1 the cosine's.
  const Bits quarters = xsimd::bitwise_cast<Bits>(shifted);
  const auto is_odd = xsimd::bool_cast((quarters & Bits(1)) != Bits(0));
  const auto sign = [](const Bits& of) { return xsimd::bitwise_cast<Pack>((of & Bits(2)) << 62); };
  return {xsimd::select(is_odd, cosine, sine) ^ sign(quarters),
          xsimd::select(is_odd, sine, cosine) ^ sign(quarters + Bits(1))};
}

}  // namespace rhec::pack_functions
