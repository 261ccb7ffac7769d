#pragma once

#include <span>

namespace rhec {

struct RiccatiKernels;
struct QpKernels;
struct TranscriptionKernels;
struct BankKernels;

/// The kernels for one instruction set.
struct KernelSet {
  const char* instruction_set;
  const RiccatiKernels* riccati;
  const QpKernels* qp;
  const TranscriptionKernels* transcription;
  const BankKernels* bank;
};
/// The sets that this machine can run, narrowest first.
std::span<const KernelSet> runnable_kernels() noexcept;

/// The kernels of the widest of them.
const RiccatiKernels& riccati_kernels() noexcept;
const QpKernels& qp_kernels() noexcept;
const TranscriptionKernels& transcription_kernels() noexcept;
const BankKernels& bank_kernels() noexcept;

}  // namespace rhec
