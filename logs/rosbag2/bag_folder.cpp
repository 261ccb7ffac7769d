#include <unistd.h>

#include <fmt/format.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <fstream>
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

  std::unique_ptr<FieldReader> reader(int topic, const FieldRequest& request) const override {
    const auto [part, place] = first_[static_cast<std::size_t>(topic)];
    return parts_[part]->reader(place, request);
  }
  std::vector<std::string> fields_of(const Record& record) const override {
    const auto [part, place] = first_[static_cast<std::size_t>(record.topic)];
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
      if (!damage) damage = std::move(found);
      if (is_over) break;
    }
    return damage;
  }
  Damage damage_at(const Record& record, const RecordError& error) const override {
    const auto [part, place] = first_[static_cast<std::size_t>(record.topic)];
    Record inner = record;
    inner.topic = place;
    Damage damage = parts_[part]->damage_at(inner, error);
    if (parts_.size() > 1) damage.what = fmt::format("{} (file {} of {})", damage.what, now_ + 1, parts_.size());
    return damage;
  }

 private:
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
  mutable std::size_t now_ = 0;
};

/// Decompresses a file, block by block.
void decompress_file(const fs::path& from, const fs::path& to) {
  InputFile input(from);
  std::ofstream output(to, std::ios::binary);
  ZstdStream stream;
  std::vector<std::byte> block(std::size_t{1} << 17), bytes;
  while (input.left() > 0) {
    block.resize(static_cast<std::size_t>(std::min<std::int64_t>(std::ssize(block), input.left())));
    const std::int64_t place = input.place();
    const std::string wrong = input.read(block) ? stream.decompress(block, bytes) : "it cannot be read";
    if (!wrong.empty())
      throw Error(fmt::format("{}: byte {}: {}; decompress it by `zstd -d`, which may save what is before",
                              from.string(), place, wrong));
    output.write(reinterpret_cast<const char*>(bytes.data()), std::ssize(bytes));
    if (!output)
      throw Error(
          fmt::format("{}: cannot be decompressed into {}; is there room?", from.string(), to.parent_path().string()));
  }
}

struct BagFile {
  std::unique_ptr<Log> log;
  std::shared_ptr<const void> kept;  ///< a temporary file that lives as long
};

BagFile open_file(const fs::path& file, const MessageLogOptions& options) {
  std::array<std::byte, 8> head{};
  InputFile input(file);
  if (input.left() >= std::ssize(head)) input.read(head);
  if (!is_zstd(head)) return {open_plain(file, options), nullptr};
  const auto temporary = std::make_shared<const TemporaryFile>(file.stem().string());
  decompress_file(file, temporary->path());
  return {open_plain(temporary->path(), options), temporary};
}

std::vector<fs::path> files_of(const fs::path& folder) {
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
  for (const fs::path& file : files) {
    BagFile opened = open_file(file, options);
    logs.push_back(std::move(opened.log));
    if (opened.kept) kept.push_back(std::move(opened.kept));
  }
  auto log = std::make_unique<JoinedLog>(name, std::move(logs));
  for (auto& each : kept) log->keep(std::move(each));
  return log;
}

}  // namespace

std::unique_ptr<Log> open_bag_folder(const fs::path& folder, const MessageLogOptions& options) {
  return joined(folder.string(), files_of(folder), options);
}

std::unique_ptr<Log> open_compressed(const fs::path& file, const MessageLogOptions& options) {
  return joined(file.string(), {file}, options);
}

}  // namespace rhec::logs
