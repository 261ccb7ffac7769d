#pragma once

#include <cstddef>
#include <cstdint>
#include <string_view>

namespace rhec::logs {

// The container's format: mcap.dev/spec, version 0.
inline constexpr std::string_view mcap_magic{"\x89MCAP0\r\n", 8};

enum class Opcode : std::uint8_t {
  header = 0x01,
  footer = 0x02,
  schema = 0x03,
  channel = 0x04,
  message = 0x05,
  chunk = 0x06,
  message_index = 0x07,
  chunk_index = 0x08,
  statistics = 0x0B,
  summary_offset = 0x0E,
  data_end = 0x0F,
};

/// An opcode and a length stand before each record.
inline constexpr std::size_t record_head = 9;
inline constexpr std::size_t footer_size = 20;

}  // namespace rhec::logs
