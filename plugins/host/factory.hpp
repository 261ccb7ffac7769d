#pragma once

#include <memory>
#include <string_view>
#include <vector>

#include "library.hpp"
#include "rhec/core/config/option_values.hpp"
#include "rhec/core/config/settings.hpp"
#include "rhec/plugins/host/host.hpp"

namespace rhec {

/// An error about the plugin that `settings` names, with the place of its name.
Error plugin_error(const Settings& settings, const std::string& text);

/// A new object of a library's plugin, as a pointer to the interface of its kind. It keeps the library loaded. Throws
/// Error if the plugin makes none, with its message.
std::shared_ptr<void> make_object(const Library& library, const Settings& settings);

/// The options of a library's plugin. Throws Error if the plugin does not tell them.
std::vector<OptionRow> options_of(const Library& library);

/// The model with the outputs that its section names, or the usual ones by default. Throws Error for a wrong name.
std::shared_ptr<Model> choose_outputs(std::shared_ptr<Model> model, const Settings& section);

/// Asks for the options, makes an object with their defaults, and deletes it. `stage` is called before each of the
/// three, with "options", "make" and "destroy".
PluginTrial try_library(const Library& library, const Stage& stage);

}  // namespace rhec
