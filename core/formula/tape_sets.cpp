#include "rhec/core/base/instruction_sets.hpp"
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

}  // namespace

std::span<const TapeKernels* const> runnable_tape_kernels() noexcept {
  static const std::size_t count = runnable_sets(kernel_sets, &TapeKernels::name);
  return {kernel_sets, count};
}

}  // namespace rhec
