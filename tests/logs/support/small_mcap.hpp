#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "rhec/logs/cdr/cdr_writer.hpp"
#include "rhec/logs/cdr/message_definitions.hpp"
#include "rhec/logs/mcap/mcap_writer.hpp"

namespace rhec::logs {

/// Messages of std_msgs/Float64 with the numbers 0, 1, ... on /a, and their negatives on /b, every millisecond, each
/// with so many bytes of text on /c to fill chunks.
inline void write_small_mcap(const std::filesystem::path& file, int count, std::size_t filling = 0) {
  McapWriter writer(file);
  const auto number = [&](const char* topic) {
    return writer.add_channel(topic, "std_msgs/msg/Float64",
                              ros2msg_text("std_msgs/msg/Float64", builtin_definitions()));
  };
  const std::uint16_t a = number("/a"), b = number("/b");
  const std::uint16_t c =
      writer.add_channel("/c", "std_msgs/msg/String", ros2msg_text("std_msgs/msg/String", builtin_definitions()));
  std::uint32_t noise = 1;
  for (int i = 0; i < count; ++i) {
    CdrWriter message;
    message.f64(i);
    writer.write(a, Stamp{1'000'000} * i, message.bytes());
    message.clear();
    message.f64(-i);
    writer.write(b, Stamp{1'000'000} * i, message.bytes());
    if (filling == 0) continue;
    std::string text(filling, ' ');  // that cannot be compressed
    for (char& each : text) each = static_cast<char>((noise = noise * 1664525u + 1013904223u) >> 24);
    message.clear();
    message.text(text);
    writer.write(c, Stamp{1'000'000} * i, message.bytes());
  }
  writer.close();
}

}  // namespace rhec::logs
