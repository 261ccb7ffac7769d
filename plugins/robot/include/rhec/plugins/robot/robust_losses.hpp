#pragma once

#include <string>
#include <vector>

#include "rhec/core/config/settings.hpp"
#include "rhec/core/horizon/rhe_problem.hpp"
#include "rhec/core/model/model.hpp"
#include "rhec/plugins/robot/option_section.hpp"

namespace rhec {

/// The losses of a section `robust`; none if it is null. `owner` is the section that contains it. Throws Error.
RHEC_EXPORT std::vector<RobustLoss> robust_losses(const Settings& section, const ModelDescription& about,
                                                  const std::string& owner);
/// The rows of that section; `otherwise` says which outputs have a loss by default.
RHEC_EXPORT std::vector<OptionRow> robust_rows(const std::string& otherwise);

}  // namespace rhec
