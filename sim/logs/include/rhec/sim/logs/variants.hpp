#pragma once

#include <string>
#include <utility>
#include <vector>

#include "rhec/core/config/settings.hpp"

namespace rhec::sim {

/// The settings of each variant of a scenario, by name: the scenario with the keys of the variant put over it, without
/// `variants`. Without that section the scenario is the only one. `chosen`, if not empty, names those that are wanted;
/// `shared` are keys that no variant may have. Throws Error, with file and line, for unknown names and wrong sections.
RHEC_EXPORT std::vector<std::pair<std::string, Settings>> variant_settings(const std::string& name,
                                                                           const Settings& scenario,
                                                                           const std::vector<std::string>& chosen,
                                                                           const std::vector<std::string>& shared);

}  // namespace rhec::sim
