#pragma once

#include "../live.hpp"
#include "../ros_options.hpp"
#include "participant.hpp"

namespace rhec::apps::ros {

/// How a node takes part: as the command line says, else the file, else the environment. Throws Error.
WireOptions wire_options(const RosOptions& options, const LiveArguments& arguments);

}  // namespace rhec::apps::ros
