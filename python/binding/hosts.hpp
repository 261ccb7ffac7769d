#pragma once

#include <string>
#include <vector>

#include "rhec/plugins/host/host.hpp"

namespace rhec::python {

/// The host of a call: each plugin is examined in a process of its own first, as by the command line.
Host examined_host(const std::vector<std::string>& plugin_path);

}  // namespace rhec::python
