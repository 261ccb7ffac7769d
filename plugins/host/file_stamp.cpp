#include "file_stamp.hpp"

#include <fmt/format.h>
#include <sys/stat.h>

#include <array>
#include <charconv>
#include <fstream>

namespace rhec {
namespace {

class Fnv1a {
 public:
  void add(const char* bytes, std::size_t count) {
    for (std::size_t i = 0; i < count; ++i) value_ = (value_ ^ static_cast<unsigned char>(bytes[i])) * 0x100000001b3u;
  }
  std::string text() const { return fmt::format("{:016x}", value_); }

 private:
  std::uint64_t value_ = 0xcbf29ce484222325u;
};

std::int64_t nanoseconds(const timespec& time) {
  return std::int64_t{time.tv_sec} * 1'000'000'000 + std::int64_t{time.tv_nsec};
}

/// Takes a number and the space behind it from the front of a text.
template <class Number>
bool take(std::string_view& text, Number& number) {
  const auto [end, problem] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (problem != std::errc()) return false;
  text.remove_prefix(static_cast<std::size_t>(end - text.data()));
  if (!text.empty() && text.front() == ' ') text.remove_prefix(1);
  return true;
}

}  // namespace

std::optional<FileStamp> stamp_of(const std::filesystem::path& file) {
  struct stat status {};
  if (stat(file.c_str(), &status) != 0) return {};
  return FileStamp{status.st_dev, status.st_ino, static_cast<std::uint64_t>(status.st_size),
                   nanoseconds(status.st_mtim), nanoseconds(status.st_ctim)};
}

std::string text_of(const FileStamp& stamp) {
  return fmt::format("{} {} {} {} {}", stamp.device, stamp.inode, stamp.size, stamp.modified, stamp.changed);
}

std::optional<FileStamp> stamp_from(std::string_view text) {
  FileStamp stamp;
  const bool whole = take(text, stamp.device) && take(text, stamp.inode) && take(text, stamp.size) &&
                     take(text, stamp.modified) && take(text, stamp.changed);
  if (!whole || !text.empty()) return {};
  return stamp;
}

std::string content_hash(const std::filesystem::path& file) {
  std::ifstream stream(file, std::ios::binary);
  if (!stream) return {};
  Fnv1a hash;
  std::array<char, 1 << 16> part{};
  while (stream.read(part.data(), part.size()) || stream.gcount() > 0)
    hash.add(part.data(), static_cast<std::size_t>(stream.gcount()));
  return stream.bad() ? std::string() : hash.text();
}

std::string text_hash(std::string_view text) {
  Fnv1a hash;
  hash.add(text.data(), text.size());
  return hash.text();
}

}  // namespace rhec
