#include <fmt/format.h>
#include <sqlite3.h>

#include <algorithm>
#include <map>
#include <set>
#include <utility>

#include "db3_pages.hpp"
#include "rhec/logs/rosbag2/rosbag2.hpp"
#include "rhec/logs/storage/compression.hpp"

namespace rhec::logs {
namespace {

constexpr int longest_value = 1 << 28;

struct CloseDatabase {
  void operator()(sqlite3* database) const noexcept { sqlite3_close(database); }
};
struct FinishQuery {
  void operator()(sqlite3_stmt* query) const noexcept { sqlite3_finalize(query); }
};
using Database = std::unique_ptr<sqlite3, CloseDatabase>;
using Query = std::unique_ptr<sqlite3_stmt, FinishQuery>;

std::string text_at(sqlite3_stmt* query, int column) {
  const auto* text = sqlite3_column_text(query, column);
  return text ? std::string(reinterpret_cast<const char*>(text),
                            static_cast<std::size_t>(sqlite3_column_bytes(query, column)))
              : std::string();
}

std::span<const std::byte> bytes_at(sqlite3_stmt* query, int column) {
  const auto* bytes = static_cast<const std::byte*>(sqlite3_column_blob(query, column));
  return {bytes, bytes ? static_cast<std::size_t>(sqlite3_column_bytes(query, column)) : 0};
}

std::string in_uri(const std::string& path) {
  std::string text;
  for (const char c : path)
    text += c == '%' || c == '?' || c == '#' ? fmt::format("%{:02X}", static_cast<int>(c)) : std::string(1, c);
  return text;
}

class Db3Log final : public MessageLog {
 public:
  Db3Log(const std::filesystem::path& file, const MessageLogOptions& options)
      : MessageLog(options.name.empty() ? file.string() : options.name, options), file_(file) {
    const Database database = open();
    const std::set<std::string> tables = tables_of(database.get());
    if (!tables.contains("topics") || !tables.contains("messages"))
      throw Error(fmt::format("{}: found SQLite without the tables 'topics' and 'messages'; expected a bag of rosbag2",
                              name()));
    if (tables.contains("message_definitions")) read_definitions(database.get());
    read_topics(database.get());
  }

  std::optional<Damage> read(const std::vector<bool>& wanted, const Take& take) const override {
    const Database database = open();
    std::string of_topics;
    for (const auto& [id, topic] : topic_of_id_)
      if (is_wanted(topic, wanted)) of_topics += fmt::format("{}{}", of_topics.empty() ? "" : ",", id);
    if (of_topics.empty()) return std::nullopt;
    // In the order of the file, which is that of arrival: sorting would take a large bag's memory.
    const Query query =
        prepare(database.get(), fmt::format("SELECT id, topic_id, timestamp, data FROM messages WHERE topic_id IN ({}) "
                                            "ORDER BY id",
                                            of_topics));
    Reading reading{.take = take};
    std::int64_t newest = 0;
    std::string what = "the file is cut";
    Db3Pages pages(file_);
    if (!pages.is_cut_within_page()) {
      int code = SQLITE_OK;
      while ((code = sqlite3_step(query.get())) == SQLITE_ROW) {
        newest = sqlite3_column_int64(query.get(), 0);
        hand_out({newest, sqlite3_column_int64(query.get(), 1), sqlite3_column_int64(query.get(), 2),
                  bytes_at(query.get(), 3)},
                 reading);
        if (reading.is_over) return std::move(reading.damage);
      }
      if (code == SQLITE_DONE) return unfinished();
      what = sqlite3_errmsg(database.get());
    }
    const std::int64_t saved = hand_out_pages(pages, newest, wanted, reading);
    if (reading.is_over) return std::move(reading.damage);
    return damage(newest, what, saved);
  }

  Damage damage_at(const Record& record, const RecordError& error) const override {
    return {fmt::format("{}: message {}: of {}, cannot be read: {}; those before it are used", name(), record.place,
                        topics_[static_cast<std::size_t>(record.topic)].name, error.what())};
  }

 private:
  struct Reading {
    const Take& take;
    std::vector<std::byte> decompressed = {};
    std::optional<Damage> damage = {};
    bool is_over = false;
  };

  static bool is_wanted(const Place& topic, const std::vector<bool>& wanted) {
    const auto index = static_cast<std::size_t>(topic.topic);
    return index < wanted.size() && wanted[index];
  }

  void hand_out(const Db3Row& row, Reading& reading) const {
    const auto topic = topic_of_id_.find(row.topic_id);
    if (topic == topic_of_id_.end()) return;
    Record record{.topic = topic->second.topic,
                  .received = row.timestamp,
                  .place = row.id,
                  .form = topic->second.form,
                  .bytes = row.data};
    if (is_zstd(record.bytes)) {
      const std::string wrong = decompress(Compression::zstd, record.bytes, longest_value, reading.decompressed);
      if (!wrong.empty()) {
        reading.damage = damage(record.place, wrong);
        reading.is_over = true;
        return;
      }
      record.bytes = reading.decompressed;
    }
    reading.is_over = !reading.take(record);
  }

  /// What SQLite's tree does not lead to any more. Returns how many messages that are.
  std::int64_t hand_out_pages(Db3Pages& pages, std::int64_t after, const std::vector<bool>& wanted,
                              Reading& reading) const {
    std::int64_t count = 0;
    pages.read(after, [&](const Db3Row& row) {
      const auto topic = topic_of_id_.find(row.topic_id);
      if (topic == topic_of_id_.end() || !is_wanted(topic->second, wanted)) return true;
      ++count;
      hand_out(row, reading);
      return !reading.is_over;
    });
    return count;
  }

  Damage damage(std::int64_t after, std::string_view what, std::int64_t saved = 0) const {
    const std::string found = saved > 0 ? fmt::format(", and {} behind it that were found page by page", saved) : "";
    return {
        fmt::format("{}: behind message {}: {}; the messages up to there are used{}; `ros2 bag reindex` or SQLite's "
                    "`.recover` may save more",
                    name(), after, what, found)};
  }

  /// The file that SQLite undoes an unfinished change with, which would be writing.
  std::filesystem::path journal() const { return file_.string() + "-journal"; }
  bool has_journal() const {
    std::error_code none;
    return std::filesystem::file_size(journal(), none) > 0 && !none;
  }
  std::optional<Damage> unfinished() const {
    if (!has_journal()) return std::nullopt;
    return Damage{
        fmt::format("{}: its recorder was ended while it wrote, as {} shows; the last messages may be missing", name(),
                    journal().filename().string())};
  }

  Database open() const {
    sqlite3* opened = nullptr;
    // Beside a journal SQLite refuses to read what it may not mend, unless it is told that nobody writes any more.
    const std::string place =
        has_journal() ? "file:" + in_uri(std::filesystem::absolute(file_).string()) + "?immutable=1" : file_.string();
    const int flags = SQLITE_OPEN_READONLY | SQLITE_OPEN_NOMUTEX | (has_journal() ? SQLITE_OPEN_URI : 0);
    const int code = sqlite3_open_v2(place.c_str(), &opened, flags, nullptr);
    Database database(opened);
    if (code != SQLITE_OK) throw failure(opened);
    // A file is data: nothing in it is to be run, and nothing in it is as long as SQLite allows.
    sqlite3_db_config(opened, SQLITE_DBCONFIG_TRUSTED_SCHEMA, 0, nullptr);
    // SQLite refuses a file that was cut as a whole, unless it is told that its schema may be written.
    sqlite3_db_config(opened, SQLITE_DBCONFIG_WRITABLE_SCHEMA, 1, nullptr);
    sqlite3_limit(opened, SQLITE_LIMIT_LENGTH, longest_value);
    return database;
  }

  Error failure(sqlite3* database) const {
    if (std::filesystem::exists(file_.string() + "-wal"))
      return Error(
          fmt::format("{0}: {1}; copy it, together with {0}-wal, into a folder that can be written, since what was "
                      "recorded last lies there",
                      name(), sqlite3_errmsg(database)));
    return Error(fmt::format("{}: {}; expected a bag of rosbag2 (.db3)", name(), sqlite3_errmsg(database)));
  }

  Query prepare(sqlite3* database, const std::string& text) const {
    sqlite3_stmt* prepared = nullptr;
    if (sqlite3_prepare_v2(database, text.c_str(), -1, &prepared, nullptr) != SQLITE_OK) throw failure(database);
    return Query(prepared);
  }

  /// Rows of a query that is small.
  template <class Visit>
  void for_each(sqlite3* database, const std::string& text, const Visit& visit) const {
    const Query query = prepare(database, text);
    int code = SQLITE_OK;
    while ((code = sqlite3_step(query.get())) == SQLITE_ROW) visit(query.get());
    if (code != SQLITE_DONE) throw failure(database);
  }

  /// Tables proper: a view may have rows without end.
  std::set<std::string> tables_of(sqlite3* database) const {
    std::set<std::string> tables;
    for_each(database, "SELECT name FROM sqlite_master WHERE type = 'table'",
             [&](sqlite3_stmt* row) { tables.insert(text_at(row, 0)); });
    return tables;
  }

  void read_definitions(sqlite3* database) {
    for_each(database, "SELECT topic_type, encoding, encoded_message_definition FROM message_definitions",
             [&](sqlite3_stmt* row) {
               definitions_[text_at(row, 0)] = {"cdr", text_at(row, 1), text_at(row, 2)};
             });
  }

  void read_topics(sqlite3* database) {
    for_each(database, "SELECT id, name, type, serialization_format FROM topics", [&](sqlite3_stmt* row) {
      const std::string type = text_at(row, 2);
      MessageEncoding encoding{.serialization = text_at(row, 3), .schema_encoding = {}, .schema = {}};
      const auto known = definitions_.find(type);
      if (known != definitions_.end() && !known->second.schema.empty()) {
        encoding.schema_encoding = known->second.schema_encoding;
        encoding.schema = known->second.schema;
      }
      topic_of_id_[sqlite3_column_int64(row, 0)] = add_topic(text_at(row, 1), type, std::move(encoding));
    });
  }

  std::filesystem::path file_;
  std::map<std::string, MessageEncoding> definitions_;
  std::map<std::int64_t, Place> topic_of_id_;
};

}  // namespace

std::unique_ptr<Log> open_db3(const std::filesystem::path& file, const MessageLogOptions& options) {
  return std::make_unique<Db3Log>(file, options);
}

}  // namespace rhec::logs
