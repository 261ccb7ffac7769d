#pragma once

#include <memory>
#include <string>
#include <vector>

#include "rhec/core/config/option_values.hpp"
#include "rhec/core/model/model.hpp"

namespace rhec {

/// The outputs that are measured by default: indices of those that are `usual`.
RHEC_EXPORT std::vector<int> usual_outputs(const ModelDescription& about);

/// The same vehicle with other sensors: a model with the outputs `chosen` (indices of the given model's outputs), in
/// this order, and otherwise identical. `names`: what they are called, an empty one as in the model; so an output can
/// be there twice, for two sensors that measure the same. None: all as in the model. Returns the given model if these
/// are all of its outputs with their own names. Throws Error for an index that is out of range, a name that is there
/// twice, and for a model with too many outputs and states to be evaluated without allocation (thousands of entries in
/// a Jacobian).
RHEC_EXPORT std::shared_ptr<Model> with_outputs(std::shared_ptr<Model> model, const std::vector<int>& chosen,
                                                const std::vector<std::string>& names = {});

/// The option `outputs` of every model in a configuration, for lists of options.
RHEC_EXPORT OptionRow outputs_row();

}  // namespace rhec
