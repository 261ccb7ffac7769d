#include "rhec/core/base/instruction_sets.hpp"
#include "rhec/core/formula/tape.hpp"
#include "tape_set_list.hpp"

namespace rhec {

#define RHEC_DECLARED(set) extern const TapeKernels tape_kernels_##set;
RHEC_FOR_EACH_SET(RHEC_DECLARED)

namespace {

#define RHEC_TAPE_KERNELS(set) &tape_kernels_##set,
constexpr const TapeKernels* kernel_sets[] = {RHEC_FOR_EACH_SET(RHEC_TAPE_KERNELS)};

}  // namespace

std::span<const TapeKernels* const> runnable_tape_kernels() noexcept {
  static const std::size_t count = runnable_sets(kernel_sets, &TapeKernels::name);
  return {kernel_sets, count};
}

}  // namespace rhec
