#pragma once

#include <string>
#include <vector>

#include "rhec/core/base/error.hpp"
#include "rhec/plugins/host/host.hpp"

namespace rhec::apps {

/// The error for a name that is none of the known ones: `what` says so, then come the nearest one and all that was
/// found.
Error unknown_plugin(const std::string& what, const std::string& name, const std::vector<std::string>& known,
                     const Host& host);

/// Prints what the search for plugins looked at and what came of each file, as text or JSON; of the files and plugins
/// that are called `name` alone, unless that is empty. Returns an exit code. Throws Error where nothing has that name.
int examine_plugins(const Host& host, const std::string& name, bool json);

}  // namespace rhec::apps
