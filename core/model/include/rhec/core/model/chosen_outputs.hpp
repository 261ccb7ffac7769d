#pragma once

#include <memory>
#include <string>
#include <vector>

#include "rhec/core/model/model.hpp"

namespace rhec {

/// The outputs that are measured by default: indices of those that are `usual`.
RHEC_EXPORT std::vector<int> usual_outputs(const ModelDescription& about);

/// The same vehicle with other sensors: a model with the outputs `chosen` (indices of the given model's outputs), in
/// this order, and otherwise identical. Returns the given model if these are all of its outputs. Throws Error for an
/// index that is out of range or repeated, and for a model with too many outputs and states to be evaluated without
/// allocation (thousands of entries in a Jacobian).
RHEC_EXPORT std::shared_ptr<Model> with_outputs(std::shared_ptr<Model> model, const std::vector<int>& chosen);

}  // namespace rhec
