#pragma once

// What a unit of a model's kernels for one instruction set includes (rhec_add_model_kernels in CMake generates it):
// packs first, since they rename xsimd.

#include "rhec/core/packs/pack.hpp"

#include "rhec/core/model/kernel_tables.hpp"
#include "rhec/core/model/pack_lanes.hpp"
