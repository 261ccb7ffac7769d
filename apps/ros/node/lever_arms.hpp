#pragma once

#include "../ros_options.hpp"
#include "../wire/participant.hpp"

namespace rhec::apps::ros {

/// Waits for the transforms that options of the model come from, and writes them into the section `model` of
/// `settings`. Throws Error for one that does not come within `options.patience`, names what is missing, and what did
/// come.
void set_lever_arms(Participant& wire, const RosOptions& options, Settings& settings);

}  // namespace rhec::apps::ros
