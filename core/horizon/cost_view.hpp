#pragma once

#include "rhec/core/horizon/horizon_structure.hpp"
#include "rhec/core/kernels/transcription_kernels.hpp"

namespace rhec {

/// View for the cost kernels to write to: H and h of stage 0 (null: not wanted).
inline CostView cost_view(const HorizonStructure& structure, double* H, double* h, bool adds_to_curvature) noexcept {
  return {.intervals = structure.intervals(),
          .states = structure.capacity().states,
          .controls = structure.capacity().controls,
          .stride = structure.stride(),
          .control_counts = structure.control_counts(),
          .H = H,
          .h = h,
          .adds_to_curvature = adds_to_curvature};
}

}  // namespace rhec
