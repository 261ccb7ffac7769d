#pragma once

#include <filesystem>
#include <memory>

#include "rhec/logs/cdr/message_log.hpp"
#include "rhec/logs/signals/log.hpp"

namespace rhec::logs {

/// Opens a log by what the file holds, whatever its name: MCAP, a .db3 of rosbag2, either compressed as a whole, a
/// folder with metadata.yaml, or a table (CSV). Throws Error that says what it is otherwise, e.g. a bag of ROS 1.
RHEC_EXPORT std::unique_ptr<Log> open_log(const std::filesystem::path& path, const MessageLogOptions& options = {});

}  // namespace rhec::logs
