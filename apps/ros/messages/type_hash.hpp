#pragma once

#include <string>

#include "rhec/logs/cdr/message_definitions.hpp"

namespace rhec::apps::ros {

/// What ROS 2 compares the definitions of a type by, from Iron on: "RIHS01_" and the SHA-256 of the description of the
/// type and of those that it contains, as JSON (REP 2016). Throws Error for a type that is not defined.
std::string type_hash(const std::string& type, const logs::Definitions& definitions);
/// The text that is hashed.
std::string type_description(const std::string& type, const logs::Definitions& definitions);

}  // namespace rhec::apps::ros
