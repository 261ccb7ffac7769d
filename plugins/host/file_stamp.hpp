#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

namespace rhec {

/// What tells without reading it that a file is still the same one.
struct FileStamp {
  std::uint64_t device = 0, inode = 0, size = 0;
  std::int64_t modified = 0, changed = 0;  ///< times of the content and of the inode [ns]

  bool operator==(const FileStamp&) const = default;
};

/// The stamp of a file, links followed; none if it cannot be looked at.
std::optional<FileStamp> stamp_of(const std::filesystem::path& file);

/// A stamp as words, and back; none if the text is no stamp.
std::string text_of(const FileStamp& stamp);
std::optional<FileStamp> stamp_from(std::string_view text);

/// A hash of a file's content (FNV-1a of 64 bits) as 16 hexadecimal digits; empty if it cannot be read.
std::string content_hash(const std::filesystem::path& file);

/// The same hash of a text.
std::string text_hash(std::string_view text);

}  // namespace rhec
