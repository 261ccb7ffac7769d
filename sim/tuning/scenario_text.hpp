#pragma once

#include <string>

#include "rhec/core/config/settings.hpp"

namespace rhec::sim {

/// Settings as YAML that is read back as the same. Null values are left out: they mean 'not given'.
std::string scenario_text(const Settings& settings);

}  // namespace rhec::sim
