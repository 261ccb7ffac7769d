#pragma once

#include <span>

namespace rhec {

struct RiccatiKernels;
struct ProgramKernels;

/// The kernels for one instruction set.
struct KernelSet {
  const char* instruction_set;
  const RiccatiKernels* riccati;
  const ProgramKernels* program;
};
/// Those that this machine can run, narrowest first.
std::span<const KernelSet> runnable_kernels() noexcept;

/// Of the widest of them.
const RiccatiKernels& riccati_kernels() noexcept;
const ProgramKernels& program_kernels() noexcept;

}  // namespace rhec
