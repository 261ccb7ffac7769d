#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "rhec/core/base/export.hpp"
#include "rhec/logs/signals/log.hpp"
#include "rhec/logs/storage/input_file.hpp"
#include "rhec/logs/storage/whole_file.hpp"

namespace rhec::logs {

/// Writes a log in MCAP, as ROS 2 records them: chunks compressed by zstd, with indices, statistics and checksums.
///
/// The file appears under its name when it is complete (`close`); without that it is removed. Throws Error if it cannot
/// be written.
class RHEC_EXPORT McapWriter {
 public:
  explicit McapWriter(const std::filesystem::path& file);

  /// A topic whose messages are in CDR, with the definition of their type in ROS's language. Returns its channel.
  std::uint16_t add_channel(const std::string& topic, const std::string& type, const std::string& definition);
  void write(std::uint16_t channel, Stamp when, std::span<const std::byte> message);
  void close();

 private:
  struct ChunkEntry {
    std::uint64_t first, last, place, length, index_length, compressed, size;
    std::map<std::uint16_t, std::uint64_t> indices;  ///< places of message indices, by channel
  };
  void finish_chunk();
  void put(std::span<const std::byte> bytes);
  void put_record(std::uint8_t opcode, const ByteWriter& content);
  std::uint64_t write_summary();

  WholeFile file_;
  std::uint64_t place_ = 0;
  std::uint32_t summary_crc_ = 0;
  std::vector<ByteWriter> schemas_, channels_;
  std::map<std::pair<std::string, std::string>, std::uint16_t> schema_ids_;  ///< by type and definition
  std::vector<std::uint32_t> sequences_;                                     ///< messages, by channel
  ByteWriter chunk_;
  std::vector<std::byte> compressed_;
  std::uint64_t chunk_first_ = 0, chunk_last_ = 0;
  std::map<std::uint16_t, ByteWriter> indices_;  ///< of the chunk that is being made
  std::vector<ChunkEntry> chunks_;
};

}  // namespace rhec::logs
