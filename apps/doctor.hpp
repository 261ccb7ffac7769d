#pragma once

#include <string>
#include <vector>

#include "rhec/core/base/error.hpp"
#include "rhec/plugins/host/host.hpp"

namespace rhec::apps {

/// The error for an unknown name: `what` went wrong, the nearest known name, and everything that was found.
Error unknown_plugin(const std::string& what, const std::string& name, const std::vector<std::string>& known,
                     const Host& host);

/// Prints the places that were searched for plugins and the result for each file, as text or JSON; if `name` is not
/// empty, only for files and plugins of that name. Returns an exit code. Throws Error if nothing has that name.
int examine_plugins(const Host& host, const std::string& name, bool json);

}  // namespace rhec::apps
