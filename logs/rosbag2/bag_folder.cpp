#include <unistd.h>

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <fstream>
#include <map>
#include <optional>
#include <tuple>
#include <utility>

#include "rhec/logs/mcap/mcap_log.hpp"
#include "rhec/logs/rosbag2/rosbag2.hpp"
#include "rhec/logs/storage/compression.hpp"
#include "rhec/logs/storage/input_file.hpp"
#include "rhec/plugins/yaml/yaml.hpp"

namespace rhec::logs {
namespace {

namespace fs = std::filesystem;

/// A file of its own in the folder for temporary ones, removed with this.
class TemporaryFile {
 public:
  explicit TemporaryFile(const std::string& name) {
    std::string pattern = (fs::temp_directory_path() / ("rhec_XXXXXX_" + name)).string();
    const int handle = mkstemps(pattern.data(), static_cast<int>(name.size()) + 1);
    if (handle < 0) throw Error(fmt::format("{}: cannot be written: {}", pattern, std::strerror(errno)));
    ::close(handle);
    path_ = pattern;
  }
  ~TemporaryFile() {
    std::error_code ignored;  // the system clears this folder, too
    fs::remove(path_, ignored);
  }
  TemporaryFile(const TemporaryFile&) = delete;
  TemporaryFile& operator=(const TemporaryFile&) = delete;
  const fs::path& path() const noexcept { return path_; }

 private:
  fs::path path_;
};

std::unique_ptr<Log> open_plain(const fs::path& file, const MessageLogOptions& options) {
  std::array<std::byte, 16> head{};
  InputFile input(file);
  if (input.left() >= std::ssize(head)) input.read(head);
  return begins_with(head, "SQLite format 3") ? open_db3(file, options) : open_mcap(file, options);
}

/// The files of a bag one after the other, as one log. Topics are joined by name and type.
class JoinedLog final : public Log {
 public:
  JoinedLog(const std::string& name, std::vector<std::unique_ptr<Log>> parts) : Log(name), parts_(std::move(parts)) {
    for (const auto& part : parts_) {
      std::vector<int> places;
      for (const Topic& topic : part->topics()) places.push_back(add(topic));
      places_.push_back(std::move(places));
    }
  }
  void keep(std::shared_ptr<const void> what) { kept_.push_back(std::move(what)); }
  /// Why a part is not complete: its file is compressed, and damaged.
  void note_damage(std::size_t part, Damage damage) { damages_[part] = std::move(damage); }

  std::unique_ptr<FieldReader> reader(int topic, const FieldRequest& request) const override {
    return std::make_unique<Reader>(*this, topic, request);
  }
  std::vector<std::string> fields_of(const Record& record) const override {
    const auto [part, place] = place_of(record.topic);
    Record inner = record;
    inner.topic = place;
    return parts_[part]->fields_of(inner);
  }
  std::optional<Damage> read(const std::vector<bool>& wanted, const Take& take) const override {
    std::optional<Damage> damage;
    bool is_over = false;
    for (now_ = 0; now_ < parts_.size() && !is_over; ++now_) {
      const std::vector<int>& places = places_[now_];
      std::vector<bool> of_part(places.size());
      for (std::size_t i = 0; i < places.size(); ++i) of_part[i] = wanted[static_cast<std::size_t>(places[i])];
      std::optional<Damage> found = parts_[now_]->read(of_part, [&](const Record& record) {
        Record outer = record;
        outer.topic = places[static_cast<std::size_t>(record.topic)];
        is_over = !take(outer);
        return !is_over;
      });
      if (is_over) break;
      // What a file that was cut lacks in the end is no other damage.
      if (const auto noted = damages_.find(now_); noted != damages_.end()) found = noted->second;
      if (!damage) damage = std::move(found);
    }
    return damage;
  }
  Damage damage_at(const Record& record, const RecordError& error) const override {
    const auto [part, place] = place_of(record.topic);
    Record inner = record;
    inner.topic = place;
    Damage damage = parts_[part]->damage_at(inner, error);
    if (parts_.size() > 1) damage.what = fmt::format("{} (file {} of {})", damage.what, now_ + 1, parts_.size());
    return damage;
  }

 private:
  /// Reads each record by what its own file says of it.
  class Reader final : public FieldReader {
   public:
    Reader(const JoinedLog& log, int topic, const FieldRequest& request) : log_(log) {
      for (const std::vector<int>& places : log.places_) {
        const auto found = std::ranges::find(places, topic);
        const std::size_t part = readers_.size();
        readers_.push_back(found == places.end()
                               ? nullptr
                               : log.parts_[part]->reader(static_cast<int>(found - places.begin()), request));
      }
    }
    Stamp read(const Record& record, double* values) override { return readers_[log_.now_]->read(record, values); }

   private:
    const JoinedLog& log_;
    std::vector<std::unique_ptr<FieldReader>> readers_;  ///< by part; null where it does not have the topic
  };

  /// In the part that is read now, or else in the first that has the topic.
  std::pair<std::size_t, int> place_of(int topic) const {
    if (now_ < places_.size())
      if (const auto found = std::ranges::find(places_[now_], topic); found != places_[now_].end())
        return {now_, static_cast<int>(found - places_[now_].begin())};
    return first_[static_cast<std::size_t>(topic)];
  }

  int add(const Topic& topic) {
    const std::size_t part = places_.size();
    const int inner = parts_[part]->topic(topic.name);
    for (std::size_t i = 0; i < topics_.size(); ++i) {
      if (topics_[i].name != topic.name || topics_[i].type != topic.type) continue;
      if (topic.count >= 0 && topics_[i].count >= 0) topics_[i].count += topic.count;
      return static_cast<int>(i);
    }
    topics_.push_back(topic);
    first_.emplace_back(part, inner);
    return static_cast<int>(topics_.size()) - 1;
  }

  std::vector<std::unique_ptr<Log>> parts_;
  std::vector<std::vector<int>> places_;            ///< by part and its topic, the topic here
  std::vector<std::pair<std::size_t, int>> first_;  ///< by topic, a part that has it, and its topic there
  std::vector<std::shared_ptr<const void>> kept_;
  std::map<std::size_t, Damage> damages_;  ///< by part
  mutable std::size_t now_ = 0;
};

/// How much a file may take when it is decompressed: not all the room that there is, and no more than messages can be
/// compressed.
std::uintmax_t most_decompressed(const fs::path& from, const fs::path& folder) {
  constexpr std::uintmax_t ratio = 1000, small = std::uintmax_t{1} << 26;
  std::error_code unknown;
  const fs::space_info space = fs::space(folder, unknown);
  const std::uintmax_t by_ratio = ratio * fs::file_size(from) + small;
  return unknown ? by_ratio : std::min(by_ratio, space.available / 10 * 9);
}

/// Decompresses a file, block by block. Returns why that ended early, if it did: what was good before is written.
std::optional<Damage> decompress_file(const fs::path& from, const fs::path& to) {
  InputFile input(from);
  std::ofstream output(to, std::ios::binary);
  ZstdStream stream;
  const std::uintmax_t most = most_decompressed(from, to.parent_path());
  std::uintmax_t written = 0;
  std::vector<std::byte> block(std::size_t{1} << 17), bytes;
  while (input.left() > 0) {
    block.resize(static_cast<std::size_t>(std::min<std::int64_t>(std::ssize(block), input.left())));
    const std::int64_t place = input.place();
    const std::string wrong = input.read(block) ? stream.decompress(block, bytes) : "it cannot be read";
    written += bytes.size();
    if (written > most)
      throw Error(
          fmt::format("{}: it decompresses to more than the {} MB that it may take in {}; decompress it by `zstd -d` "
                      "where there is "
                      "room, or name a folder with more by TMPDIR",
                      from.string(), most / 1000000, to.parent_path().string()));
    output.write(reinterpret_cast<const char*>(bytes.data()), std::ssize(bytes));
    if (!output)
      throw Error(
          fmt::format("{}: cannot be decompressed into {}; is there room?", from.string(), to.parent_path().string()));
    const bool is_cut = input.left() == 0 && stream.is_within_frame();
    if (!wrong.empty() || is_cut)
      return Damage{fmt::format("{}: byte {}: {}; what is before it is used", from.string(), place,
                                wrong.empty() ? "the file is cut" : wrong)};
  }
  return std::nullopt;
}

struct BagFile {
  std::unique_ptr<Log> log;
  std::shared_ptr<const void> kept;  ///< a temporary file that lives as long
  std::optional<Damage> damage;      ///< of its compression
};

BagFile open_file(const fs::path& file, const MessageLogOptions& options) {
  std::array<std::byte, 8> head{};
  InputFile input(file);
  if (input.left() >= std::ssize(head)) input.read(head);
  if (!is_zstd(head)) return {open_plain(file, options), nullptr, {}};
  const auto temporary = std::make_shared<const TemporaryFile>(file.stem().string());
  std::optional<Damage> damage = decompress_file(file, temporary->path());
  MessageLogOptions named = options;
  named.name = file.string();
  return {open_plain(temporary->path(), named), temporary, std::move(damage)};
}

struct NumberedFile {
  std::string bag;  ///< what is before "_3.mcap"
  std::int64_t number = 0;
  fs::path path;
};

/// Files of bags in a folder, in their order.
std::vector<NumberedFile> numbered_files(const fs::path& folder) {
  std::vector<NumberedFile> files;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder)) {
    fs::path plain = entry.path().filename();
    if (plain.extension() == ".zstd") plain = plain.stem();
    if (!entry.is_regular_file() || (plain.extension() != ".mcap" && plain.extension() != ".db3")) continue;
    NumberedFile file{plain.stem().string(), 0, entry.path()};
    const std::size_t digits = file.bag.find_last_not_of("0123456789") + 1;
    if (digits > 1 && file.bag[digits - 1] == '_' &&
        std::from_chars(file.bag.data() + digits, file.bag.data() + file.bag.size(), file.number).ec == std::errc())
      file.bag.resize(digits - 1);
    files.push_back(std::move(file));
  }
  std::ranges::sort(files, [](const NumberedFile& a, const NumberedFile& b) {
    return std::tie(a.bag, a.number, a.path) < std::tie(b.bag, b.number, b.path);
  });
  return files;
}

/// Of a bag whose recorder did not come to its end: metadata.yaml is what it writes last.
std::vector<fs::path> files_without_metadata(const fs::path& folder) {
  const std::vector<NumberedFile> found = numbered_files(folder);
  std::vector<fs::path> files;
  std::vector<std::string> names;
  for (const NumberedFile& file : found) {
    files.push_back(file.path);
    names.push_back(file.path.filename().string());
  }
  if (found.front().bag != found.back().bag)
    throw Error(fmt::format("{}: found a folder without metadata.yaml with files of several bags; name one of them: {}",
                            folder.string(), fmt::join(names, ", ")));
  return files;
}

std::vector<fs::path> files_of(const fs::path& folder) {
  if (!fs::exists(folder / "metadata.yaml")) return files_without_metadata(folder);
  const Settings metadata = load_yaml(folder / "metadata.yaml");
  const Settings* about = metadata.find("rosbag2_bagfile_information");
  const Settings* paths = about ? about->find("relative_file_paths") : nullptr;
  if (!paths || paths->items().empty())
    throw Error(
        fmt::format("{}: found no rosbag2_bagfile_information.relative_file_paths; expected the files of a bag; "
                    "name a file of the bag itself",
                    (folder / "metadata.yaml").string()));
  std::vector<fs::path> files;
  for (const Settings& path : paths->items()) {
    fs::path file = folder / path.as_text();
    // Metadata of a bag that was compressed or decompressed by hand name the other file.
    const fs::path compressed = file.string() + ".zstd";
    if (!fs::exists(file) && fs::exists(compressed)) file = compressed;
    if (!fs::exists(file) && file.extension() == ".zstd") file.replace_extension();
    if (!fs::exists(file))
      throw path.error(fmt::format("there is no file {}; expected it beside metadata.yaml", file.string()));
    files.push_back(std::move(file));
  }
  return files;
}

std::unique_ptr<Log> joined(const std::string& name, const std::vector<fs::path>& files,
                            const MessageLogOptions& options) {
  std::vector<std::unique_ptr<Log>> logs;
  std::vector<std::shared_ptr<const void>> kept;
  std::vector<std::optional<Damage>> damages;
  for (const fs::path& file : files) {
    BagFile opened = open_file(file, options);
    logs.push_back(std::move(opened.log));
    if (opened.kept) kept.push_back(std::move(opened.kept));
    damages.push_back(std::move(opened.damage));
  }
  auto log = std::make_unique<JoinedLog>(name, std::move(logs));
  for (std::size_t part = 0; part < damages.size(); ++part)
    if (damages[part]) log->note_damage(part, *std::move(damages[part]));
  for (auto& each : kept) log->keep(std::move(each));
  return log;
}

}  // namespace

bool has_bag_files(const fs::path& folder) { return !numbered_files(folder).empty(); }

std::unique_ptr<Log> open_bag_folder(const fs::path& folder, const MessageLogOptions& options) {
  return joined(folder.string(), files_of(folder), options);
}

std::unique_ptr<Log> open_compressed(const fs::path& file, const MessageLogOptions& options) {
  return joined(file.string(), {file}, options);
}

}  // namespace rhec::logs
