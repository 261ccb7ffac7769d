#include "rhec/logs/mcap/mcap_log.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <set>
#include <utility>

#include "mcap_format.hpp"
#include "rhec/logs/storage/compression.hpp"
#include "rhec/logs/storage/input_file.hpp"

namespace rhec::logs {
namespace {

// Beyond this a record or a chunk is taken for a broken length; writers make chunks of some megabytes.
constexpr std::uint64_t longest_record = std::uint64_t{1} << 28;

struct Chunk {
  std::uint64_t size = 0;
  std::uint32_t crc = 0;
  std::string_view compression;
  std::span<const std::byte> records;
  bool ok = false;
};

Chunk chunk_of(std::span<const std::byte> content) {
  ByteReader reader(content);
  reader.take(16);  // times of the first and the last message
  Chunk chunk;
  chunk.size = reader.u64();
  chunk.crc = reader.u32();
  chunk.compression = reader.text();
  const std::uint64_t length = reader.u64();
  chunk.ok = reader.ok() && length <= reader.left();
  chunk.records = reader.take(std::min<std::uint64_t>(length, reader.left()));
  return chunk;
}

class McapLog final : public MessageLog {
 public:
  McapLog(const std::filesystem::path& file, const MessageLogOptions& options)
      : MessageLog(options.name.empty() ? file.string() : options.name, options), file_(file) {
    InputFile input(file_);
    std::vector<std::byte> magic(mcap_magic.size());
    if (!input.read(magic) || !begins_with(magic, mcap_magic))
      throw Error(fmt::format("{}: found no MCAP, which begins with its magic bytes; give an MCAP file", name()));
    if (!read_summary(input)) walk(input, {.learner = this});
    for (const auto& [channel, count] : counts_)
      if (const auto found = channels_.find(channel); found != channels_.end()) add_count(found->second.topic, count);
  }

  std::optional<Damage> read(const std::vector<bool>& wanted, const Take& take) const override {
    InputFile input(file_);
    return walk(input, {.wanted = &wanted, .take = &take});
  }

  Damage damage_at(const Record& record, const RecordError& error) const override {
    return damage(record.place, fmt::format("a message of {} cannot be read: {}",
                                            topics_[static_cast<std::size_t>(record.topic)].name, error.what()));
  }

 private:
  Damage damage(std::int64_t place, std::string_view what) const {
    return {
        fmt::format("{}: byte {}: {}; what is before it is used; `mcap recover` may save more", name(), place, what)};
  }

  void add_count(int topic, std::int64_t count) {
    std::int64_t& total = topics_[static_cast<std::size_t>(topic)].count;
    total = std::max<std::int64_t>(total, 0) + count;
  }

  // What is known from records that may come again and again.

  void take_schema(std::span<const std::byte> content) {
    ByteReader reader(content);
    const std::uint16_t id = reader.u16();
    std::string type(reader.text()), encoding(reader.text());
    const std::string_view text = reader.text();
    if (reader.ok()) schemas_.try_emplace(id, Schema{std::move(type), std::move(encoding), std::string(text)});
  }

  void take_channel(std::span<const std::byte> content) {
    ByteReader reader(content);
    const std::uint16_t id = reader.u16(), schema_id = reader.u16();
    const std::string topic(reader.text()), encoding(reader.text());
    if (!reader.ok() || channels_.contains(id)) return;
    const auto schema = schemas_.find(schema_id);
    static const Schema none;
    const Schema& found = schema == schemas_.end() ? none : schema->second;
    channels_[id] = add_topic(topic, found.type, {encoding, found.encoding, found.text});
  }

  struct Schema {
    std::string type, encoding, text;
  };

  /// False if there is no summary that says all.
  bool read_summary(InputFile& input) {
    const auto tail = static_cast<std::int64_t>(record_head + footer_size + mcap_magic.size());
    if (input.left() < tail) return false;
    std::vector<std::byte> bytes(static_cast<std::size_t>(tail));
    input.seek(input.size() - tail);
    if (!input.read(bytes) || bytes[0] != static_cast<std::byte>(Opcode::footer)) return false;
    ByteReader footer(std::span<const std::byte>(bytes).subspan(record_head));
    const std::uint64_t start = footer.u64();
    footer.u64();
    const std::uint32_t crc = footer.u32();
    const std::int64_t end = input.size() - tail;
    if (start == 0 || start > static_cast<std::uint64_t>(end)) return false;
    const std::uint64_t size = static_cast<std::uint64_t>(end) - start;
    if (size > longest_record) return false;
    std::vector<std::byte> summary(static_cast<std::size_t>(size));
    input.seek(static_cast<std::int64_t>(start));
    if (!input.read(summary)) return false;
    // The checksum goes as far as itself.
    const auto before_crc = std::span(bytes).first(record_head + footer_size - sizeof(crc));
    if (crc != 0 && crc32(before_crc, crc32(summary)) != crc) return false;
    return take_summary(summary);
  }

  bool take_summary(std::span<const std::byte> summary) {
    std::vector<std::span<const std::byte>> channels;  // behind their schemas
    std::uint64_t channel_count = 0;
    for (ByteReader reader(summary); reader.left() > 0;) {
      const auto opcode = static_cast<Opcode>(reader.u8());
      const auto content = reader.take(reader.u64());
      if (!reader.ok()) return false;
      if (opcode == Opcode::schema) take_schema(content);
      if (opcode == Opcode::channel) channels.push_back(content);
      if (opcode == Opcode::chunk_index) take_chunk_index(content);
      if (opcode == Opcode::statistics) channel_count = take_statistics(content);
    }
    for (const auto content : channels) take_channel(content);
    // Writers may leave channels out of the summary, or have none of its parts.
    return channel_count > 0 && channels_.size() >= channel_count;
  }

  void take_chunk_index(std::span<const std::byte> content) {
    ByteReader reader(content);
    reader.take(16);
    const std::uint64_t place = reader.u64();
    reader.u64();
    const std::uint32_t size = reader.u32();
    std::set<std::uint16_t> inside;
    for (ByteReader offsets(reader.take(size)); offsets.left() > 0;) {
      inside.insert(offsets.u16());
      offsets.u64();
      if (!offsets.ok()) return;
    }
    if (!inside.empty()) chunks_[static_cast<std::int64_t>(place)] = std::move(inside);
  }

  std::uint64_t take_statistics(std::span<const std::byte> content) {
    ByteReader reader(content);
    reader.take(8 + 2);
    const std::uint32_t channel_count = reader.u32();
    reader.take(3 * 4 + 2 * 8);
    std::map<std::uint16_t, std::int64_t> counts;
    for (ByteReader each(reader.take(reader.u32())); each.left() > 0;) {
      const std::uint16_t channel = each.u16();
      counts[channel] = static_cast<std::int64_t>(std::min<std::uint64_t>(each.u64(), INT64_MAX / 2));
      if (!each.ok()) break;
    }
    counts_ = std::move(counts);
    return channel_count;
  }

  // The data section.

  struct Walk {
    McapLog* learner = nullptr;
    const std::vector<bool>* wanted = nullptr;
    const Take* take = nullptr;
    std::vector<std::byte> content = {}, records = {}, message = {};
    std::optional<Damage> damage = {};  ///< the first
    bool is_over = false;

    std::optional<Damage> damage_or(Damage other) {
      if (!damage) damage = std::move(other);
      return std::move(damage);
    }
  };

  /// Goes through the file: hands out messages, or learns its topics.
  std::optional<Damage> walk(InputFile& input, Walk state) const {
    input.seek(static_cast<std::int64_t>(mcap_magic.size()));
    std::vector<std::byte> head(record_head);
    while (!state.is_over) {
      const std::int64_t place = input.place();
      if (input.left() == 0)
        return state.damage_or(damage(place, "found the end, expected the record of the data's end"));
      if (!input.read(head)) return state.damage_or(damage(place, "the file is cut within a record"));
      const auto opcode = static_cast<Opcode>(head[0]);
      const std::uint64_t length = ByteReader(std::span(head).subspan(1)).u64();
      if (opcode == Opcode::data_end || opcode == Opcode::footer) break;
      if (std::to_integer<int>(head[0]) == 0) return state.damage_or(damage(place, "found no record"));
      const bool is_cut = length > static_cast<std::uint64_t>(input.left());
      if (is_cut && opcode != Opcode::chunk)
        return state.damage_or(
            damage(place, fmt::format("found a record of {} bytes with {} left", length, input.left())));
      const auto there = std::min<std::uint64_t>(length, static_cast<std::uint64_t>(input.left()));
      if (!is_used(opcode) || (opcode == Opcode::chunk && passes_over(place, state))) {
        input.seek(input.place() + static_cast<std::int64_t>(there));
        continue;
      }
      if (there > longest_record)
        return state.damage_or(
            damage(place, fmt::format("found a record of {} bytes, expected {} at most", length, longest_record)));
      state.content.resize(static_cast<std::size_t>(there));
      if (!input.read(state.content)) return state.damage_or(damage(place, "the file cannot be read"));
      if (opcode == Opcode::chunk) {
        take_chunk(place, is_cut, state);
      } else {
        take_record(opcode, state.content, place, state);
      }
      if (is_cut) break;
    }
    return std::move(state.damage);
  }

  static bool is_used(Opcode opcode) {
    return opcode == Opcode::schema || opcode == Opcode::channel || opcode == Opcode::message ||
           opcode == Opcode::chunk;
  }

  bool is_wanted(std::uint16_t channel, const Walk& state) const {
    const auto found = channels_.find(channel);
    return found != channels_.end() && static_cast<std::size_t>(found->second.topic) < state.wanted->size() &&
           (*state.wanted)[static_cast<std::size_t>(found->second.topic)];
  }

  /// Whether the index says that nothing in a chunk is asked for.
  bool passes_over(std::int64_t place, const Walk& state) const {
    const auto found = chunks_.find(place);
    return state.take && found != chunks_.end() &&
           std::none_of(found->second.begin(), found->second.end(),
                        [&](std::uint16_t channel) { return is_wanted(channel, state); });
  }

  void take_chunk(std::int64_t place, bool is_cut, Walk& state) const {
    const Chunk chunk = chunk_of(state.content);
    Compression compression = Compression::none;
    std::string wrong;
    if (!chunk.ok && !is_cut) wrong = "it has no complete head";
    if (wrong.empty() && !compression_of(chunk.compression, compression))
      wrong = fmt::format("it is compressed by {}, expected lz4 or zstd", in_quotes(chunk.compression));
    if (wrong.empty() && chunk.size > longest_record)
      wrong = fmt::format("it is to have {} bytes, expected {} at most", chunk.size, longest_record);
    if (wrong.empty()) {
      wrong = decompress(compression, chunk.records, static_cast<std::size_t>(chunk.size), state.records);
      if (wrong.empty() && state.records.size() != chunk.size)
        wrong = fmt::format("it decompresses to {} bytes, expected {}", state.records.size(), chunk.size);
      if (wrong.empty() && chunk.crc != 0 && crc32(state.records) != chunk.crc) wrong = "its checksum is wrong";
      if (is_cut) wrong = "the file is cut within it";
    }
    if (!wrong.empty() && !state.damage) state.damage = damage(place, fmt::format("a chunk is damaged: {}", wrong));
    if (wrong.empty() || is_cut) take_records(place, state);
  }

  void take_records(std::int64_t place, Walk& state) const {
    for (ByteReader reader(state.records); reader.left() > 0 && !state.is_over;) {
      const auto opcode = static_cast<Opcode>(reader.u8());
      const auto content = reader.take(reader.u64());
      if (!reader.ok()) {
        if (!state.damage) state.damage = damage(place, "a chunk ends within a record");
        return;
      }
      take_record(opcode, content, place, state);
    }
  }

  void take_record(Opcode opcode, std::span<const std::byte> content, std::int64_t place, Walk& state) const {
    if (opcode == Opcode::schema && state.learner) state.learner->take_schema(content);
    if (opcode == Opcode::channel && state.learner) state.learner->take_channel(content);
    if (opcode != Opcode::message) return;
    ByteReader reader(content);
    const std::uint16_t channel = reader.u16();
    reader.u32();
    const std::uint64_t log_time = reader.u64();
    reader.u64();
    if (!reader.ok()) return;
    if (state.learner) ++state.learner->counts_[channel];
    if (!state.take || !is_wanted(channel, state)) return;
    const Place& at = channels_.at(channel);
    Record record{.topic = at.topic,
                  .received = static_cast<Stamp>(std::min<std::uint64_t>(log_time, INT64_MAX)),
                  .place = place,
                  .form = at.form,
                  .bytes = reader.take(reader.left())};
    if (is_zstd(record.bytes)) {  // CDR begins otherwise
      const std::string wrong = decompress(Compression::zstd, record.bytes, longest_record, state.message);
      if (!wrong.empty()) {
        if (!state.damage) state.damage = damage(place, fmt::format("a message is damaged: {}", wrong));
        return;
      }
      record.bytes = state.message;
    }
    if (!(*state.take)(record)) state.is_over = true;
  }

  std::filesystem::path file_;
  std::map<std::uint16_t, Schema> schemas_;
  std::map<std::uint16_t, Place> channels_;                 ///< their topics
  std::map<std::uint16_t, std::int64_t> counts_;            ///< messages, by channel
  std::map<std::int64_t, std::set<std::uint16_t>> chunks_;  ///< channels in a chunk, by its place
};

}  // namespace

std::unique_ptr<Log> open_mcap(const std::filesystem::path& file, const MessageLogOptions& options) {
  return std::make_unique<McapLog>(file, options);
}

}  // namespace rhec::logs
