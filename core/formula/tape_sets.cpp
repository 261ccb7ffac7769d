#include <cstddef>

#include "rhec/core/formula/tape.hpp"

namespace rhec {

extern const TapeKernels tape_kernels_generic;
#if defined(RHEC_WIDE_TAPES)
extern const TapeKernels tape_kernels_avx2, tape_kernels_avx512;
#endif

namespace {

constexpr const TapeKernels* kernel_sets[] = {&tape_kernels_generic,
#if defined(RHEC_WIDE_TAPES)
                                              &tape_kernels_avx2, &tape_kernels_avx512
#endif
};

/// All instruction sets that the kernels use (cmake/RhecModel.cmake), not only the one in their name.
std::size_t count_runnable() noexcept {
#if defined(RHEC_WIDE_TAPES)
  if (!__builtin_cpu_supports("avx2") || !__builtin_cpu_supports("fma")) return 1;
  const bool has_avx512 = __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512cd") &&
                          __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512bw") &&
                          __builtin_cpu_supports("avx512vl");
  return has_avx512 ? 3 : 2;
#else
  return 1;
#endif
}

}  // namespace

std::span<const TapeKernels* const> runnable_tape_kernels() noexcept {
  static const std::size_t count = count_runnable();
  return {kernel_sets, count};
}

}  // namespace rhec
