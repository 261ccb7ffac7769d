#include "rhec/logs/mcap/mcap_writer.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <limits>

#include "mcap_format.hpp"
#include "rhec/core/base/error.hpp"
#include "rhec/logs/storage/compression.hpp"

namespace rhec::logs {
namespace {

constexpr std::size_t chunk_size = std::size_t{1} << 20;

std::uint8_t byte_of(Opcode opcode) { return static_cast<std::uint8_t>(opcode); }

std::vector<std::byte> head_of(std::uint8_t opcode, std::uint64_t length) {
  ByteWriter head;
  head.u8(opcode);
  head.u64(length);
  return std::move(head.bytes());
}

void append_record(std::uint8_t opcode, const ByteWriter& content, ByteWriter& to) {
  to.append(head_of(opcode, content.bytes().size()));
  to.append(content.bytes());
}

}  // namespace

McapWriter::McapWriter(const std::filesystem::path& file) : file_(file) {
  put(std::as_bytes(std::span(mcap_magic)));
  ByteWriter header;
  header.text("ros2");
  header.text("rhec");
  put_record(byte_of(Opcode::header), header);
}

std::uint16_t McapWriter::add_channel(const std::string& topic, const std::string& type,
                                      const std::string& definition) {
  if (channels_.size() >= std::numeric_limits<std::uint16_t>::max())
    throw Error(fmt::format("{}: has {} topics; expected fewer", file_.path().string(), channels_.size()));
  const auto [schema, is_new] =
      schema_ids_.try_emplace(std::pair(type, definition), static_cast<std::uint16_t>(schemas_.size() + 1));
  if (is_new) {
    ByteWriter content;
    content.u16(schema->second);
    content.text(type);
    content.text("ros2msg");
    content.text(definition);
    append_record(byte_of(Opcode::schema), content, chunk_);
    schemas_.push_back(std::move(content));
  }
  const auto id = static_cast<std::uint16_t>(channels_.size());
  ByteWriter content;
  content.u16(id);
  content.u16(schema->second);
  content.text(topic);
  content.text("cdr");
  content.u32(0);  // no metadata
  append_record(byte_of(Opcode::channel), content, chunk_);
  channels_.push_back(std::move(content));
  sequences_.push_back(0);
  return id;
}

void McapWriter::write(std::uint16_t channel, Stamp when, std::span<const std::byte> message) {
  const auto time = static_cast<std::uint64_t>(std::max<Stamp>(when, 0));
  if (indices_.empty()) chunk_first_ = chunk_last_ = time;
  chunk_first_ = std::min(chunk_first_, time);
  chunk_last_ = std::max(chunk_last_, time);
  ByteWriter& index = indices_[channel];
  index.u64(time);
  index.u64(chunk_.bytes().size());
  ByteWriter content;
  content.u16(channel);
  content.u32(sequences_.at(channel)++);
  content.u64(time);
  content.u64(time);
  content.append(message);
  append_record(byte_of(Opcode::message), content, chunk_);
  if (chunk_.bytes().size() >= chunk_size) finish_chunk();
}

void McapWriter::finish_chunk() {
  if (chunk_.bytes().empty()) return;
  compress_zstd(chunk_.bytes(), compressed_);
  ByteWriter content;
  content.u64(chunk_first_);
  content.u64(chunk_last_);
  content.u64(chunk_.bytes().size());
  content.u32(crc32(chunk_.bytes()));
  content.text("zstd");
  content.u64(compressed_.size());
  content.append(compressed_);
  ChunkEntry entry{.first = chunk_first_,
                   .last = chunk_last_,
                   .place = place_,
                   .length = record_head + content.bytes().size(),
                   .index_length = 0,
                   .compressed = compressed_.size(),
                   .size = chunk_.bytes().size(),
                   .indices = {}};
  put_record(byte_of(Opcode::chunk), content);
  const std::uint64_t indices_begin = place_;
  for (const auto& [channel, entries] : indices_) {
    entry.indices[channel] = place_;
    ByteWriter index;
    index.u16(channel);
    index.u32(static_cast<std::uint32_t>(entries.bytes().size()));
    index.append(entries.bytes());
    put_record(byte_of(Opcode::message_index), index);
  }
  entry.index_length = place_ - indices_begin;
  chunks_.push_back(std::move(entry));
  chunk_.bytes().clear();
  indices_.clear();
  chunk_first_ = chunk_last_ = 0;
}

/// Schemas, channels, statistics and the index of chunks, each a group of its own. Returns where the offsets begin.
std::uint64_t McapWriter::write_summary() {
  ByteWriter offsets;
  const auto group = [&](Opcode opcode, const auto& write_records) {
    const std::uint64_t begin = place_;
    write_records();
    if (place_ == begin) return;
    ByteWriter offset;
    offset.u8(byte_of(opcode));
    offset.u64(begin);
    offset.u64(place_ - begin);
    append_record(byte_of(Opcode::summary_offset), offset, offsets);
  };
  group(Opcode::schema, [&] {
    for (const ByteWriter& schema : schemas_) put_record(byte_of(Opcode::schema), schema);
  });
  group(Opcode::channel, [&] {
    for (const ByteWriter& channel : channels_) put_record(byte_of(Opcode::channel), channel);
  });
  group(Opcode::statistics, [&] {
    ByteWriter counts;
    std::uint64_t messages = 0, first = 0, last = 0;
    for (std::size_t channel = 0; channel < sequences_.size(); ++channel) {
      counts.u16(static_cast<std::uint16_t>(channel));
      counts.u64(sequences_[channel]);
      messages += sequences_[channel];
    }
    for (const ChunkEntry& chunk : chunks_) {
      if (chunk.indices.empty()) continue;
      first = first == 0 ? chunk.first : std::min(first, chunk.first);
      last = std::max(last, chunk.last);
    }
    ByteWriter statistics;
    statistics.u64(messages);
    statistics.u16(static_cast<std::uint16_t>(schemas_.size()));
    statistics.u32(static_cast<std::uint32_t>(channels_.size()));
    statistics.u32(0);  // attachments
    statistics.u32(0);  // metadata
    statistics.u32(static_cast<std::uint32_t>(chunks_.size()));
    statistics.u64(first);
    statistics.u64(last);
    statistics.u32(static_cast<std::uint32_t>(counts.bytes().size()));
    statistics.append(counts.bytes());
    put_record(byte_of(Opcode::statistics), statistics);
  });
  group(Opcode::chunk_index, [&] {
    for (const ChunkEntry& chunk : chunks_) {
      ByteWriter indices;
      for (const auto& [channel, place] : chunk.indices) {
        indices.u16(channel);
        indices.u64(place);
      }
      ByteWriter content;
      for (const std::uint64_t value : {chunk.first, chunk.last, chunk.place, chunk.length}) content.u64(value);
      content.u32(static_cast<std::uint32_t>(indices.bytes().size()));
      content.append(indices.bytes());
      content.u64(chunk.index_length);
      content.text("zstd");
      content.u64(chunk.compressed);
      content.u64(chunk.size);
      put_record(byte_of(Opcode::chunk_index), content);
    }
  });
  const std::uint64_t begin = place_;
  put(offsets.bytes());
  return begin;
}

void McapWriter::close() {
  finish_chunk();
  ByteWriter end;
  end.u32(0);  // the data are checked chunk by chunk
  put_record(byte_of(Opcode::data_end), end);
  const std::uint64_t summary = place_;
  summary_crc_ = 0;
  const std::uint64_t offsets = write_summary();
  ByteWriter footer;
  footer.u64(summary);
  footer.u64(offsets);
  put(head_of(byte_of(Opcode::footer), footer_size));
  put(footer.bytes());
  ByteWriter crc;
  crc.u32(summary_crc_);
  put(crc.bytes());
  put(std::as_bytes(std::span(mcap_magic)));
  file_.close();
}

void McapWriter::put(std::span<const std::byte> bytes) {
  file_.write(bytes);
  summary_crc_ = crc32(bytes, summary_crc_);
  place_ += bytes.size();
}

void McapWriter::put_record(std::uint8_t opcode, const ByteWriter& content) {
  put(head_of(opcode, content.bytes().size()));
  put(content.bytes());
}

}  // namespace rhec::logs
