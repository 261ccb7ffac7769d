#include "kernels.hpp"

#include "riccati_kernels.hpp"

namespace rhec {

extern const RiccatiKernels riccati_kernels_generic;
#if defined(RHEC_WIDE_KERNELS)
extern const RiccatiKernels riccati_kernels_avx2, riccati_kernels_avx512;
#endif

namespace {

enum class InstructionSet { generic, avx2, avx512 };

InstructionSet widest() noexcept {
#if defined(RHEC_WIDE_KERNELS)
  if (!__builtin_cpu_supports("avx2") || !__builtin_cpu_supports("fma")) return InstructionSet::generic;
  if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512cd") && __builtin_cpu_supports("avx512dq") &&
      __builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512vl"))
    return InstructionSet::avx512;
  return InstructionSet::avx2;
#else
  return InstructionSet::generic;
#endif
}

}  // namespace

const RiccatiKernels& riccati_kernels() noexcept {
  switch (widest()) {
#if defined(RHEC_WIDE_KERNELS)
    case InstructionSet::avx2:
      return riccati_kernels_avx2;
    case InstructionSet::avx512:
      return riccati_kernels_avx512;
#endif
    default:
      return riccati_kernels_generic;
  }
}

}  // namespace rhec
