#include "rhec/core/kernels/kernel_sets.hpp"

namespace rhec {

extern const BankKernels bank_kernels_generic;
extern const RiccatiKernels riccati_kernels_generic;
extern const QpKernels qp_kernels_generic;
extern const TranscriptionKernels transcription_kernels_generic;
#if defined(RHEC_WIDE_KERNELS)
extern const BankKernels bank_kernels_avx2, bank_kernels_avx512;
extern const RiccatiKernels riccati_kernels_avx2, riccati_kernels_avx512;
extern const QpKernels qp_kernels_avx2, qp_kernels_avx512;
extern const TranscriptionKernels transcription_kernels_avx2, transcription_kernels_avx512;
#endif

namespace {

constexpr KernelSet kernel_sets[] = {
    {"generic", &riccati_kernels_generic, &qp_kernels_generic, &transcription_kernels_generic, &bank_kernels_generic},
#if defined(RHEC_WIDE_KERNELS)
    {"avx2", &riccati_kernels_avx2, &qp_kernels_avx2, &transcription_kernels_avx2, &bank_kernels_avx2},
    {"avx512", &riccati_kernels_avx512, &qp_kernels_avx512, &transcription_kernels_avx512, &bank_kernels_avx512},
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
const BankKernels& bank_kernels() noexcept { return *runnable_kernels().back().bank; }
const QpKernels& qp_kernels() noexcept { return *runnable_kernels().back().qp; }
const TranscriptionKernels& transcription_kernels() noexcept { return *runnable_kernels().back().transcription; }

}  // namespace rhec
