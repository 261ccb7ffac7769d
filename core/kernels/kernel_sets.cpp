#include "rhec/core/kernels/kernel_sets.hpp"

#include "kernel_set_list.hpp"
#include "rhec/core/base/instruction_sets.hpp"

namespace rhec {

#define RHEC_DECLARED(set)                           \
  extern const BankKernels bank_kernels_##set;       \
  extern const RiccatiKernels riccati_kernels_##set; \
  extern const QpKernels qp_kernels_##set;           \
  extern const TranscriptionKernels transcription_kernels_##set;
RHEC_FOR_EACH_SET(RHEC_DECLARED)

namespace {

#define RHEC_KERNEL_SET(set) \
  {#set, &riccati_kernels_##set, &qp_kernels_##set, &transcription_kernels_##set, &bank_kernels_##set},
constexpr KernelSet kernel_sets[] = {RHEC_FOR_EACH_SET(RHEC_KERNEL_SET)};

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
