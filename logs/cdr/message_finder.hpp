#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "rhec/logs/cdr/message_definitions.hpp"

namespace rhec::logs {

/// The definition of a message: as its bag has it (`encoding` "ros2msg" or "ros2idl"; empty: not at all), else from the
/// folders, else as built in. Throws Error for a type that nobody defines, and for a text that is none.
std::shared_ptr<const MessageType> find_message(const std::string& type, std::string_view encoding,
                                                std::string_view schema,
                                                const std::vector<std::filesystem::path>& folders);

}  // namespace rhec::logs
