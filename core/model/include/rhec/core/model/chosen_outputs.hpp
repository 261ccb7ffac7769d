#pragma once

#include <memory>
#include <string>
#include <vector>

#include "rhec/core/model/model.hpp"

namespace rhec {

/// Which of a model's outputs are measured unless somebody chooses: indices of those that are `usual`.
RHEC_EXPORT std::vector<int> usual_outputs(const ModelDescription& about);

/// The same vehicle with other sensors: a model that has the outputs `chosen` (indices of the given model's) in this
/// order and is the given one in all else; the given one itself where these are all of its outputs. Throws Error for
/// an index that is none or comes twice, and for a model of more outputs and states than can be evaluated without
/// allocation (thousands of entries in a Jacobian).
RHEC_EXPORT std::shared_ptr<Model> with_outputs(std::shared_ptr<Model> model, const std::vector<int>& chosen);

}  // namespace rhec
