#pragma once

// Packs of doubles for SIMD across stages. Included only by translation units that are compiled for one instruction set
// (rhec_add_model_kernels in CMake generates those of models), each of which defines its own RHEC_PACK_NAMESPACE. xsimd
// has helpers that are neither templates nor tied to an instruction set. Of several compiled copies the linker would
// keep one for all units, and a machine without its instructions would crash. So each unit renames xsimd.

#if defined(RHEC_PACK_NAMESPACE)
#define xsimd RHEC_PACK_NAMESPACE
#endif

#include <utility>
#include <xsimd/xsimd.hpp>

#include "rhec/core/base/unrolled.hpp"
#include "rhec/core/packs/pack_functions.hpp"

namespace rhec {

/// The doubles of one register. Arithmetic is the compiler's own on vector types: a kernel has thousands of operations,
/// and through xsimd's layers of functions it takes twice as long to compile. Elementary functions are xsimd's.
template <class Arch>
struct Pack {
  using Batch = xsimd::batch<double, Arch>;
  using Register = typename Batch::register_type;
  static constexpr int width = static_cast<int>(Batch::size);
  using InMemory [[gnu::aligned(sizeof(double)), gnu::may_alias]] = Register;  ///< at any address of a double
  Register values;

  Pack() = default;
  RHEC_INLINE Pack(Register given) : values(given) {}             // NOLINT(google-explicit-constructor)
  RHEC_INLINE Pack(const Batch& given) : values(given) {}         // NOLINT(google-explicit-constructor)
  RHEC_INLINE Pack(double value) : values(value - Register{}) {}  // NOLINT(google-explicit-constructor)
  RHEC_INLINE static Pack load(const double* from) { return *reinterpret_cast<const InMemory*>(from); }
  RHEC_INLINE void store(double* to) const { *reinterpret_cast<InMemory*>(to) = values; }

  RHEC_INLINE friend Pack operator+(Pack a, Pack b) { return a.values + b.values; }
  RHEC_INLINE friend Pack operator-(Pack a, Pack b) { return a.values - b.values; }
  RHEC_INLINE friend Pack operator*(Pack a, Pack b) { return a.values * b.values; }
  RHEC_INLINE friend Pack operator/(Pack a, Pack b) { return a.values / b.values; }
  RHEC_INLINE friend Pack operator-(Pack a) { return -Batch(a.values); }
  RHEC_INLINE friend Pack& operator+=(Pack& a, Pack b) { return a = a + b; }
  RHEC_INLINE friend Pack& operator-=(Pack& a, Pack b) { return a = a - b; }
  RHEC_INLINE friend Pack& operator*=(Pack& a, Pack b) { return a = a * b; }
  RHEC_INLINE friend Pack& operator/=(Pack& a, Pack b) { return a = a / b; }

  /// a b + c, a b - c and c - a b, rounded once.
  RHEC_INLINE friend Pack multiply_add(Pack a, Pack b, Pack c) {
    return fused_multiply_add(a.values, b.values, c.values);
  }
  RHEC_INLINE friend Pack multiply_subtract(Pack a, Pack b, Pack c) {
    return fused_multiply_subtract(a.values, b.values, c.values);
  }
  RHEC_INLINE friend Pack subtract_product(Pack c, Pack a, Pack b) {
    return fused_subtract_product(c.values, a.values, b.values);
  }

  RHEC_INLINE friend std::pair<Pack, Pack> sincos(Pack angle) {
    const auto [sine, cosine] = pack_functions::sine_cosine(Batch(angle.values));
    return {sine, cosine};
  }
  RHEC_INLINE friend Pack sin(Pack angle) { return sincos(angle).first; }
  RHEC_INLINE friend Pack cos(Pack angle) { return sincos(angle).second; }
  RHEC_INLINE friend Pack tan(Pack angle) {
    const auto [sine, cosine] = sincos(angle);
    return sine / cosine;
  }
  RHEC_INLINE friend Pack sqrt(Pack a) { return xsimd::sqrt(Batch(a.values)); }
  RHEC_INLINE friend Pack exp(Pack a) { return xsimd::exp(Batch(a.values)); }
  RHEC_INLINE friend Pack log(Pack a) { return xsimd::log(Batch(a.values)); }
  RHEC_INLINE friend Pack tanh(Pack a) { return xsimd::tanh(Batch(a.values)); }
  RHEC_INLINE friend Pack asin(Pack a) { return xsimd::asin(Batch(a.values)); }
  RHEC_INLINE friend Pack acos(Pack a) { return xsimd::acos(Batch(a.values)); }
  RHEC_INLINE friend Pack atan(Pack a) { return xsimd::atan(Batch(a.values)); }
  RHEC_INLINE friend Pack atan2(Pack y, Pack x) { return xsimd::atan2(Batch(y.values), Batch(x.values)); }
};

/// The widest pack of the instruction set for which this unit is compiled.
#if defined(__AVX512F__)
using WidestPack = Pack<xsimd::avx512dq>;
#elif defined(__AVX2__)
using WidestPack = Pack<xsimd::fma3<xsimd::avx2>>;
#elif defined(__aarch64__)
using WidestPack = Pack<xsimd::neon64>;
#endif

#if defined(__aarch64__)
/// Transposes two packs of two, taken as a matrix.
RHEC_INLINE inline void transpose(Pack<xsimd::neon64>* a) {
  const float64x2_t first = a[0].values;
  a[0] = vzip1q_f64(first, a[1].values);
  a[1] = vzip2q_f64(first, a[1].values);
}
#endif

#if defined(__AVX2__)
/// Transposes four packs of four, taken as a matrix.
RHEC_INLINE inline void transpose(Pack<xsimd::fma3<xsimd::avx2>>* a) {
  const __m256d low01 = _mm256_unpacklo_pd(a[0].values, a[1].values),
                high01 = _mm256_unpackhi_pd(a[0].values, a[1].values);
  const __m256d low23 = _mm256_unpacklo_pd(a[2].values, a[3].values),
                high23 = _mm256_unpackhi_pd(a[2].values, a[3].values);
  a[0] = _mm256_permute2f128_pd(low01, low23, 0x20);
  a[1] = _mm256_permute2f128_pd(high01, high23, 0x20);
  a[2] = _mm256_permute2f128_pd(low01, low23, 0x31);
  a[3] = _mm256_permute2f128_pd(high01, high23, 0x31);
}
#endif

#if defined(__AVX512F__)
/// Transposes eight packs of eight, taken as a matrix: pairs of columns, then quarters of the pack, then its halves.
RHEC_INLINE inline void transpose(Pack<xsimd::avx512dq>* a) {
  __m512d pairs[8], quads[8];
  for (int i = 0; i < 8; i += 2) {
    pairs[i] = _mm512_unpacklo_pd(a[i].values, a[i + 1].values);
    pairs[i + 1] = _mm512_unpackhi_pd(a[i].values, a[i + 1].values);
  }
  for (int i = 0; i < 8; i += 4) {
    for (int j = 0; j < 2; ++j) {
      quads[i + j] = _mm512_shuffle_f64x2(pairs[i + j], pairs[i + j + 2], 0x88);      // columns 0, 4 (1, 5)
      quads[i + j + 2] = _mm512_shuffle_f64x2(pairs[i + j], pairs[i + j + 2], 0xdd);  // columns 2, 6 (3, 7)
    }
  }
  for (int j = 0; j < 4; ++j) {
    a[j] = _mm512_shuffle_f64x2(quads[j], quads[j + 4], 0x88);
    a[j + 4] = _mm512_shuffle_f64x2(quads[j], quads[j + 4], 0xdd);
  }
}

/// Transposes four packs of eight and four of zeros, taken as a matrix.
RHEC_INLINE inline void transpose_half(Pack<xsimd::avx512dq>* a) {
  // Rows 0, 2, 4, 6 and rows 1, 3, 5, 7, the first two columns and the others.
  const __m512d pairs[2] = {_mm512_unpacklo_pd(a[0].values, a[1].values), _mm512_unpackhi_pd(a[0].values, a[1].values)};
  const __m512d others[2] = {_mm512_unpacklo_pd(a[2].values, a[3].values),
                             _mm512_unpackhi_pd(a[2].values, a[3].values)};
  for_indices<4>([&](auto i) RHEC_INLINE {
    constexpr int at = 2 * i;
    const __m512i row = _mm512_setr_epi64(at, at + 1, at + 8, at + 9, 0, 0, 0, 0);
    for (int odd = 0; odd < 2; ++odd) a[at + odd] = _mm512_maskz_permutex2var_pd(0x0f, pairs[odd], row, others[odd]);
  });
}
#endif

}  // namespace rhec
