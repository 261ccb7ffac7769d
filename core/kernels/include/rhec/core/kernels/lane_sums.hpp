#pragma once

#include "rhec/core/kernels/lanes.hpp"

namespace rhec::kernels {
namespace {

/// sums[j] += sum_of(lanes[j]) for j = 0 .. 7.
inline void add_sums_of(const Lanes* lanes, double* sums) {
#if defined(__AVX512F__)
  Lanes twos[4], fours[2];
  for (int j = 0; j < 4; ++j)
    twos[j] = __builtin_shufflevector(lanes[2 * j], lanes[2 * j + 1], 0, 8, 2, 10, 4, 12, 6, 14) +
              __builtin_shufflevector(lanes[2 * j], lanes[2 * j + 1], 1, 9, 3, 11, 5, 13, 7, 15);
  for (int j = 0; j < 2; ++j)
    fours[j] = __builtin_shufflevector(twos[2 * j], twos[2 * j + 1], 0, 1, 8, 9, 4, 5, 12, 13) +
               __builtin_shufflevector(twos[2 * j], twos[2 * j + 1], 2, 3, 10, 11, 6, 7, 14, 15);
  const Lanes eights = __builtin_shufflevector(fours[0], fours[1], 0, 1, 2, 3, 8, 9, 10, 11) +
                       __builtin_shufflevector(fours[0], fours[1], 4, 5, 6, 7, 12, 13, 14, 15);
  store(load(sums) + eights, sums);
#elif defined(__AVX2__)
  for (int j = 0; j < 8; j += 4) {
    const Lanes* const four = lanes + j;
    const Lanes first = __builtin_shufflevector(four[0], four[1], 0, 4, 2, 6) +
                        __builtin_shufflevector(four[0], four[1], 1, 5, 3, 7),
                second = __builtin_shufflevector(four[2], four[3], 0, 4, 2, 6) +
                         __builtin_shufflevector(four[2], four[3], 1, 5, 3, 7);
    store(load(sums + j) +
              (__builtin_shufflevector(first, second, 0, 1, 4, 5) + __builtin_shufflevector(first, second, 2, 3, 6, 7)),
          sums + j);
  }
#else
  for (int j = 0; j < 8; j += 2)
    store(load(sums + j) + (__builtin_shufflevector(lanes[j], lanes[j + 1], 0, 2) +
                            __builtin_shufflevector(lanes[j], lanes[j + 1], 1, 3)),
          sums + j);
#endif
}

}  // namespace
}  // namespace rhec::kernels
