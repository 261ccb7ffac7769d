#include "rhec/logs/files/open_log.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "rhec/logs/csv/csv_log.hpp"
#include "rhec/logs/mcap/mcap_log.hpp"
#include "rhec/logs/rosbag2/rosbag2.hpp"
#include "rhec/logs/storage/compression.hpp"
#include "rhec/logs/storage/input_file.hpp"

namespace rhec::logs {
namespace {

constexpr const char* known = "expected MCAP, a bag of rosbag2 (.db3, or its folder), or a table with a header (CSV)";

}  // namespace

std::unique_ptr<Log> open_log(const std::filesystem::path& path, const MessageLogOptions& options) {
  if (!std::filesystem::exists(path)) throw Error(fmt::format("{}: there is no such file; {}", path.string(), known));
  if (std::filesystem::is_directory(path)) {
    if (std::filesystem::exists(path / "metadata.yaml") || has_bag_files(path)) return open_bag_folder(path, options);
    throw Error(fmt::format("{}: found a folder without metadata.yaml and files of a bag; {}", path.string(), known));
  }
  InputFile file(path);
  std::vector<std::byte> head(static_cast<std::size_t>(std::min<std::int64_t>(file.size(), 512)));
  file.read(head);
  if (head.empty()) throw Error(fmt::format("{}: found an empty file; {}", path.string(), known));
  if (begins_with(head, "\x89MCAP")) return open_mcap(path, options);
  if (begins_with(head, "SQLite format 3")) return open_db3(path, options);
  if (is_zstd(head)) return open_compressed(path, options);
  if (begins_with(head, "#ROSBAG V"))
    throw Error(
        fmt::format("{0}: found a bag of ROS 1; convert it: pip install rosbags; rosbags-convert --src {0} --dst "
                    "{1}; then give the folder {1}",
                    path.string(), path.stem().string()));
  if (std::any_of(head.begin(), head.end(), [](std::byte each) { return each == std::byte{0}; }))
    throw Error(fmt::format("{}: found bytes that are no text; {}", path.string(), known));
  return open_csv(path);
}

}  // namespace rhec::logs
