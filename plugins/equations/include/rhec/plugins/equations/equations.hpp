#pragma once

#include <filesystem>
#include <memory>
#include <string_view>
#include <vector>

#include "rhec/core/config/option_values.hpp"
#include "rhec/core/config/settings.hpp"
#include "rhec/core/model/model.hpp"

namespace rhec {

/// True if the name of a model is that of a file with its equations (docs/equations.md) instead of a plugin's: it ends
/// in .yaml or .yml.
RHEC_EXPORT bool is_equations_file(std::string_view name);

/// The vehicle of such a file, with the options in `settings`: a map, whose keys "name", "equations" and "outputs" are
/// not looked at, or null for the defaults. Throws Error with file, line and (in equations) column of a mistake.
RHEC_EXPORT std::shared_ptr<Model> load_vehicle(const std::filesystem::path& file, const Settings& settings = {});

/// The same of equations that stand in a configuration themselves: `settings` has them as a map at the key "equations",
/// beside the vehicle's options.
RHEC_EXPORT std::shared_ptr<Model> load_inline_vehicle(const Settings& settings);

/// The options that the file declares, and the outputs that a configuration may choose.
RHEC_EXPORT std::vector<OptionRow> vehicle_options(const std::filesystem::path& file);

}  // namespace rhec
