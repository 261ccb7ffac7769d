#include "kernels.hpp"

namespace rhec {

extern const RiccatiKernels riccati_kernels_generic;
extern const ProgramKernels program_kernels_generic;
#if defined(RHEC_WIDE_KERNELS)
extern const RiccatiKernels riccati_kernels_avx2, riccati_kernels_avx512;
extern const ProgramKernels program_kernels_avx2, program_kernels_avx512;
#endif

namespace {

constexpr KernelSet kernel_sets[] = {
    {"generic", &riccati_kernels_generic, &program_kernels_generic},
#if defined(RHEC_WIDE_KERNELS)
    {"avx2", &riccati_kernels_avx2, &program_kernels_avx2},
    {"avx512", &riccati_kernels_avx512, &program_kernels_avx512},
#endif
};

std::size_t count_runnable() noexcept {
#if defined(RHEC_WIDE_KERNELS)
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

std::span<const KernelSet> runnable_kernels() noexcept {
  static const std::size_t count = count_runnable();
  return {kernel_sets, count};
}

const RiccatiKernels& riccati_kernels() noexcept { return *runnable_kernels().back().riccati; }
const ProgramKernels& program_kernels() noexcept { return *runnable_kernels().back().program; }

}  // namespace rhec
