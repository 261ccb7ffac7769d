#pragma once

#include <cstdint>
#include <string>

#include "rhec/logs/cdr/message_definitions.hpp"
#include "rhec/logs/mcap/mcap_writer.hpp"

namespace rhec::sim {

/// A channel of one of the messages that are built in.
inline std::uint16_t add_channel(logs::McapWriter& writer, const std::string& topic, const std::string& type) {
  return writer.add_channel(topic, type, logs::ros2msg_text(type, logs::builtin_definitions()));
}

}  // namespace rhec::sim
