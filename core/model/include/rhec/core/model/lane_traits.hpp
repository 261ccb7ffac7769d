#pragma once

#include <cstddef>

#include "rhec/core/base/padded.hpp"

namespace rhec {

/// How many stages a number type carries at once, and how their rows of `size` doubles are loaded and stored: lane i of
/// entry k is rows[i * step + k]. If `count` rows do not fill a pack, the last row is repeated, so that no lane
/// computes with undefined values. For rows padded to multiples of eight, `load_padded` also reads the padding and
/// `store_padded` sets it to zero. Packs specialise this (pack.hpp).
template <class Lane>
struct LaneTraits {
  static constexpr int width = 1;
  template <int size>
  static void load(const double* rows, int /*count*/, std::ptrdiff_t /*step*/, Lane* out) {
    for (int k = 0; k < size; ++k) out[k] = rows[k];
  }
  template <int size>
  static void load_padded(const double* rows, int count, std::ptrdiff_t step, Lane* out) {
    load<size>(rows, count, step, out);
  }
  template <int size>
  static void store(const Lane* entries, int /*count*/, double* rows) {
    for (int k = 0; k < size; ++k) rows[k] = entries[k];
  }
  template <int size>
  static void store_padded(const Lane* entries, int /*count*/, double* rows, std::ptrdiff_t /*step*/) {
    for (int k = 0; k < size; ++k) rows[k] = entries[k];
    for (int k = size; k < padded(size); ++k) rows[k] = 0.0;
  }
};

}  // namespace rhec
