#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "rhec/core/config/settings.hpp"

namespace rhec {

/// Reads a YAML file into Settings whose nodes know file and line. Anchors, aliases and merge keys (`<<`) work; tags
/// other than YAML's own do not. An empty file gives null. Throws Error with file and line: a file that is not there or
/// cannot be read, wrong syntax, a key written twice, a key that is no plain text, more than one document.
RHEC_EXPORT Settings load_yaml(const std::filesystem::path& file);

/// The same of a text; `name` stands for the file in errors.
RHEC_EXPORT Settings parse_yaml(const std::string& text, const std::string& name);

/// Puts an assignment of the command line, "horizon.length=25" or "weights=[1, 2]", into `settings`, in the place of
/// what was there. The value is read as YAML; in errors its origin is "--set horizon.length=25". Throws Error where
/// there is no '=' or no key, where the value is not YAML, and where the path leads through something that is not a
/// map.
RHEC_EXPORT void apply_assignment(Settings& settings, std::string_view assignment);

}  // namespace rhec
