#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "rhec/core/config/settings.hpp"

namespace rhec {

/// Reads a YAML file into Settings whose nodes know file and line. Anchors, aliases and merge keys (`<<`) work; tags
/// other than YAML's own do not. An empty file gives null. Throws Error with file and line for a missing or unreadable
/// file, a syntax error, a duplicate key, a key that is not plain text, or more than one document.
RHEC_EXPORT Settings load_yaml(const std::filesystem::path& file);

/// The same for a text; `name` replaces the file name in errors.
RHEC_EXPORT Settings parse_yaml(const std::string& text, const std::string& name);

/// Applies an assignment of the command line, "horizon.length=25" or "weights=[1, 2]", to `settings`, replacing the
/// previous value. The value is read as YAML; in errors its origin is "--set horizon.length=25". Throws Error if there
/// is no '=' or no key, if the value is not YAML, or if the path leads through something that is not a map.
RHEC_EXPORT void apply_assignment(Settings& settings, std::string_view assignment);

}  // namespace rhec
