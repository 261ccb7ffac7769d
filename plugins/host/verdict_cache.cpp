#include "verdict_cache.hpp"

#include <dlfcn.h>
#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdlib>
#include <fstream>
#include <system_error>
#include <vector>

#include "rhec/plugins/kit/fingerprint.hpp"

namespace rhec {
namespace {

namespace fs = std::filesystem;

constexpr const char* kFormat = "1";

/// The file of the library that contains this function, as it is now.
std::string own_identity() {
  Dl_info info{};
  if (dladdr(reinterpret_cast<const void*>(&own_identity), &info) == 0 || info.dli_fname == nullptr) return {};
  const auto stamp = stamp_of(info.dli_fname);
  return stamp ? fmt::format("{}, {}", RHEC_BUILD_FINGERPRINT, text_of(*stamp)) : std::string();
}

fs::path folder_of_user() {
  const char* cache = secure_getenv("XDG_CACHE_HOME");
  if (cache != nullptr && fs::path(cache).is_absolute()) return fs::path(cache) / "rhec" / "plugins";
  const char* home = secure_getenv("HOME");
  if (home == nullptr || !fs::path(home).is_absolute()) return {};
  return fs::path(home) / ".cache" / "rhec" / "plugins";
}

/// Whether what lies there can only have been written by this user or by the system's.
bool is_trusted(const fs::path& folder) {
  struct stat status {};
  if (stat(folder.c_str(), &status) != 0) return false;
  return (status.st_uid == geteuid() || status.st_uid == 0) && (status.st_mode & (S_IWGRP | S_IWOTH)) == 0;
}

std::string content_of(const fs::path& file) {
  std::ifstream stream(file, std::ios::binary);
  std::string text;
  std::array<char, 4096> part{};
  constexpr std::size_t most = std::size_t{1} << 20;
  while (text.size() < most && (stream.read(part.data(), part.size()) || stream.gcount() > 0))
    text.append(part.data(), static_cast<std::size_t>(stream.gcount()));
  return text;
}

/// Writes all of a text, and says whether that went well.
bool write_all(int descriptor, std::string_view text) {
  while (!text.empty()) {
    const ssize_t count = ::write(descriptor, text.data(), text.size());
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) return false;
    text.remove_prefix(static_cast<std::size_t>(count));
  }
  return true;
}

/// What a file of the cache says beside the verdict.
struct Kept {
  Verdict verdict;
  std::string format, host, plugin, hash;
  std::optional<FileStamp> stamp;
  bool is_whole = false;
};

std::optional<Kept> read_kept(const fs::path& file) {
  Kept kept;
  for (const auto& [key, value] : report_lines(content_of(file))) {
    if (key == "format") {
      kept.format = value;
    } else if (key == "host") {
      kept.host = value;
    } else if (key == "plugin") {
      kept.plugin = value;
    } else if (key == "hash") {
      kept.hash = value;
    } else if (key == "stamp") {
      kept.stamp = stamp_from(value);
    } else if (key == "end") {
      kept.is_whole = true;
    } else if (!take_line(key, value, kept.verdict)) {
      return {};
    }
  }
  if (kept.format != kFormat || !kept.is_whole || !kept.stamp) return {};
  return kept;
}

}  // namespace

VerdictCache::VerdictCache(const fs::path& folder)
    : folder_(folder.empty() ? folder_of_user() : folder), host_(own_identity()) {
  if (host_.empty()) folder_.clear();
}

fs::path VerdictCache::file_of(const fs::path& plugin) const {
  return folder_ / (text_hash(plugin.string()) + "_" + plugin.stem().string() + ".txt");
}

bool VerdictCache::same(const NeededLibrary& library) {
  const auto [place, is_new] = stamps_.try_emplace(library.path);
  if (is_new) place->second = stamp_of(library.path);
  return place->second == library.stamp;
}

std::optional<Verdict> VerdictCache::find(const fs::path& plugin) {
  if (folder_.empty() || !is_trusted(folder_)) return {};
  auto kept = read_kept(file_of(plugin));
  if (!kept || kept->host != host_ || kept->plugin != plugin.string()) return {};
  const auto stamp = stamp_of(plugin);
  if (!stamp) return {};
  const bool touched = *stamp != *kept->stamp;
  if (touched && content_hash(plugin) != kept->hash) return {};
  Verdict& verdict = kept->verdict;
  verdict.record.path = plugin;
  const bool holds = std::all_of(verdict.libraries.begin(), verdict.libraries.end(),
                                 [&](const NeededLibrary& library) { return library.path == plugin || same(library); });
  if (!holds) return {};
  if (touched) write(verdict, *stamp, kept->hash);
  return std::move(verdict);
}

void VerdictCache::keep(const Verdict& verdict, const FileStamp& examined) const {
  if (folder_.empty()) return;
  const std::string hash = content_hash(verdict.record.path);
  if (hash.empty() || stamp_of(verdict.record.path) != examined) return;
  write(verdict, examined, hash);
}

void VerdictCache::write(const Verdict& verdict, const FileStamp& stamp, const std::string& hash) const {
  std::error_code problem;
  const fs::path parent = folder_.parent_path();
  fs::create_directories(parent, problem);
  if (mkdir(folder_.c_str(), S_IRWXU) != 0 && errno != EEXIST) return;
  if (!is_trusted(folder_)) return;
  const std::string text = report_line("format", kFormat) + report_line("host", host_) +
                           report_line("plugin", verdict.record.path.string()) + report_line("hash", hash) +
                           report_line("stamp", text_of(stamp)) + lines_of(verdict) + report_line("end", "");
  std::string aside = (folder_ / ".verdict_XXXXXX").string();
  const int descriptor = mkostemp(aside.data(), O_CLOEXEC);
  if (descriptor < 0) return;
  const bool written = write_all(descriptor, text);
  const bool closed = close(descriptor) == 0;
  if (written && closed) fs::rename(aside, file_of(verdict.record.path), problem);
  if (!written || !closed || problem) fs::remove(aside, problem);
}

}  // namespace rhec
