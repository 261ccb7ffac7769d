#pragma once

// How packs are loaded from rows and stored to them. Included by pack.hpp, under the pack's namespace.

#include <utility>

#include "rhec/core/model/lane_traits.hpp"
#include "rhec/core/model/pack.hpp"

namespace rhec {

#if defined(__AVX512F__)
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

/// The first four entries of eight rows, as four packs.
RHEC_INLINE inline void load_half(const double* const* rows, Pack<xsimd::avx512dq>* a) {
  __m512d both[4];  // row i and, in the upper half, row i + 4
  for (int i = 0; i < 4; ++i)
    both[i] = _mm512_insertf64x4(_mm512_castpd256_pd512(_mm256_loadu_pd(rows[i])), _mm256_loadu_pd(rows[i + 4]), 1);
  const __m512i lower = _mm512_setr_epi64(0, 1, 8, 9, 4, 5, 12, 13),
                upper = _mm512_setr_epi64(2, 3, 10, 11, 6, 7, 14, 15);
  const __m512d even[2] = {_mm512_unpacklo_pd(both[0], both[1]), _mm512_unpacklo_pd(both[2], both[3])};
  const __m512d odd[2] = {_mm512_unpackhi_pd(both[0], both[1]), _mm512_unpackhi_pd(both[2], both[3])};
  a[0] = _mm512_permutex2var_pd(even[0], lower, even[1]);
  a[1] = _mm512_permutex2var_pd(odd[0], lower, odd[1]);
  a[2] = _mm512_permutex2var_pd(even[0], upper, even[1]);
  a[3] = _mm512_permutex2var_pd(odd[0], upper, odd[1]);
}
#endif

template <class Arch>
struct LaneTraits<Pack<Arch>> {
  using Lane = Pack<Arch>;
  static constexpr int width = Lane::width;

  template <int size>
  static void load(const double* rows, int count, std::ptrdiff_t step, Lane* out) {
    const auto load_entry = [&]<int... i>(int k, std::integer_sequence<int, i...>) {
      return Lane(typename Lane::Batch{rows[(i < count ? i : count - 1) * step + k]...});
    };
    for (int k = 0; k < size; ++k) out[k] = load_entry(k, std::make_integer_sequence<int, width>());
  }
  template <int size>
  RHEC_INLINE static void load_padded(const double* rows, int count, std::ptrdiff_t step, Lane* out) {
    if constexpr (width == 8 && size <= 4) {
      const double* at[width];
      for_indices<width>([&](auto i) RHEC_INLINE { at[i] = rows + (i < count ? i : count - 1) * step; });
      Lane block[4];
      load_half(at, block);
      for_indices<size>([&](auto k) RHEC_INLINE { out[k] = block[k]; });
      return;
    }
    for_indices<padded(size) / width>([&](auto part) RHEC_INLINE {
      Lane block[width];
      for_indices<width>(
          [&](auto i) RHEC_INLINE { block[i] = Lane::load(rows + (i < count ? i : count - 1) * step + part * width); });
      transpose(block);
      for_indices<width>([&](auto i) RHEC_INLINE {
        if constexpr (part * width + i < size) out[part * width + i] = block[i];
      });
    });
  }
  template <int size>
  RHEC_INLINE static void store_padded(const Lane* entries, int count, double* rows, std::ptrdiff_t step) {
    for_indices<padded(size) / width>([&](auto part) RHEC_INLINE {
      Lane block[width];
      for_indices<width>([&](auto i) RHEC_INLINE {
        if constexpr (part * width + i < size)
          block[i] = entries[part * width + i];
        else
          block[i] = Lane(0.0);
      });
      if constexpr (width == 8 && size <= part * width + 4)
        transpose_half(block);
      else if constexpr (part * width < size)
        transpose(block);
      for_indices<width>([&](auto i) RHEC_INLINE {
        if (i < count) block[i].store(rows + i * step + part * width);
      });
    });
  }
  /// Blocks of `width` entries of all rows first, then the remaining entries one by one.
  template <int size>
  static void store(const Lane* entries, int count, double* rows) {
    int k = 0;
    for (; k + width <= size; k += width) {
      Lane block[width];
      for (int i = 0; i < width; ++i) block[i] = entries[k + i];
      transpose(block);
      for (int i = 0; i < count; ++i) block[i].store(rows + i * size + k);
    }
    for (; k < size; ++k) {
      alignas(64) double spread[width];
      entries[k].store(spread);
      for (int i = 0; i < count; ++i) rows[i * size + k] = spread[i];
    }
  }
};

}  // namespace rhec
