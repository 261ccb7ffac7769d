#include "rhec/core/kernels/kernel_sets.hpp"

#include "rhec/core/base/instruction_sets.hpp"

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

}  // namespace

std::span<const KernelSet> runnable_kernels() noexcept {
  static const std::size_t count = runnable_sets(kernel_sets, &KernelSet::instruction_set);
  return {kernel_sets, count};
}

const RiccatiKernels& riccati_kernels() noexcept { return *runnable_kernels().back().riccati; }
const BankKernels& bank_kernels() noexcept { return *runnable_kernels().back().bank; }
const QpKernels& qp_kernels() noexcept { return *runnable_kernels().back().qp; }
const TranscriptionKernels& transcription_kernels() noexcept { return *runnable_kernels().back().transcription; }

}  // namespace rhec
