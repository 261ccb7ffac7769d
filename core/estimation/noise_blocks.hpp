#pragma once

#include <memory>

#include "rhec/core/estimation/receding_horizon_estimation.hpp"

namespace rhec {

/// The model of a problem whose blocked noises are parameters instead of inputs; the model itself if there are none.
/// Throws Error for noise that the model does not have as an input.
std::shared_ptr<const Model> with_noise_blocks(const std::shared_ptr<const Model>& model,
                                               const RecedingHorizonEstimation::Setup& setup);

/// The same for the set-up: weights of inputs become walks of parameters. Throws Error for a blocking that links
/// blocks.
RecedingHorizonEstimation::Setup with_noise_blocks(const Model& model, RecedingHorizonEstimation::Setup setup);

}  // namespace rhec
