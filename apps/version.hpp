#pragma once

#include <string>

namespace rhec::apps {

/// What `rhec --version` prints: the version, and what this program was built with. Plugins that stand on other
/// libraries are asked for the versions of these.
std::string version_text();

}  // namespace rhec::apps
