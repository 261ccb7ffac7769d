#pragma once

#include <string_view>
#include <vector>

#include "rhec/core/model/model.hpp"

namespace rhec {

/// Throws Error unless there is one finite, non-negative weight for each variable.
void check_weights(std::string_view what, const std::vector<double>& weights, const std::vector<Variable>& variables);

/// Empty bounds become the variables' own (or none if `use_model` is false); others must have the right size and lower
/// <= upper.
void fill_default_bounds(std::string_view what, std::vector<double>& lower, std::vector<double>& upper,
                         const std::vector<Variable>& variables, bool use_model);

}  // namespace rhec
