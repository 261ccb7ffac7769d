#pragma once

#include <string>

#include "rhec/plugins/host.hpp"

namespace rhec::apps {

/// Prints what the search for plugins looked at and what came of each file, as text or JSON; of the files and plugins
/// that are called `name` alone, unless that is empty. Returns an exit code. Throws Error where nothing has that name.
int examine_plugins(const Host& host, const std::string& name, bool json);

}  // namespace rhec::apps
