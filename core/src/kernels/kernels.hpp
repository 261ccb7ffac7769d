#pragma once

#include "rhec/core/export.hpp"

namespace rhec {

struct RiccatiKernels;

/// The kernels for the widest instruction set that this machine has.
const RiccatiKernels& riccati_kernels() noexcept;

}  // namespace rhec
