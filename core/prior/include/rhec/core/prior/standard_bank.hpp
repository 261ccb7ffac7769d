#pragma once

#include <memory>
#include <vector>

#include "rhec/core/base/export.hpp"
#include "rhec/core/prior/prior.hpp"

namespace rhec {

struct ModelDescription;

/// One prior for every parameter of a model, in their order.
using PriorCombination = std::vector<std::shared_ptr<const Prior>>;

/// No bank has more members, whatever the number of parameters.
inline constexpr int most_bank_members = 24;

/// All combinations of the priors that are `given` for each parameter. Where none are, nothing is known but the
/// parameter's bounds: random walks per metre and Matern processes of 6 to 40 m, as many as the limit leaves room for;
/// the speed factor, which the data determine best, has most of them. Throws Error if what is given exceeds the limit
/// by itself.
RHEC_EXPORT std::vector<PriorCombination> standard_bank(const ModelDescription& about,
                                                        const std::vector<PriorCombination>& given = {});

}  // namespace rhec
