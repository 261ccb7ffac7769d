#include "kernels.hpp"

#include <initializer_list>

#include "program_kernels.hpp"
#include "riccati_kernels.hpp"

namespace rhec {

extern const RiccatiKernels riccati_kernels_generic;
extern const ProgramKernels program_kernels_generic;
#if defined(RHEC_WIDE_KERNELS)
extern const RiccatiKernels riccati_kernels_avx2, riccati_kernels_avx512;
extern const ProgramKernels program_kernels_avx2, program_kernels_avx512;
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

namespace {

/// The table of each instruction set, narrowest first.
template <class Table>
const Table& of_widest(std::initializer_list<const Table*> tables) noexcept {
  return **(tables.begin() + static_cast<int>(widest()));
}

}  // namespace

const RiccatiKernels& riccati_kernels() noexcept {
#if defined(RHEC_WIDE_KERNELS)
  static const RiccatiKernels& table =
      of_widest({&riccati_kernels_generic, &riccati_kernels_avx2, &riccati_kernels_avx512});
  return table;
#else
  return riccati_kernels_generic;
#endif
}

const ProgramKernels& program_kernels() noexcept {
#if defined(RHEC_WIDE_KERNELS)
  static const ProgramKernels& table =
      of_widest({&program_kernels_generic, &program_kernels_avx2, &program_kernels_avx512});
  return table;
#else
  return program_kernels_generic;
#endif
}

}  // namespace rhec
