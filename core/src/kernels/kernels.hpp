#pragma once

#include "rhec/core/export.hpp"

namespace rhec {

struct RiccatiKernels;
struct ProgramKernels;

/// The kernels for the widest instruction set that this machine has.
const RiccatiKernels& riccati_kernels() noexcept;
const ProgramKernels& program_kernels() noexcept;

}  // namespace rhec
