#pragma once

#include <cstddef>
#include <filesystem>
#include <fstream>
#include <span>
#include <string_view>

#include "rhec/core/base/export.hpp"

namespace rhec::logs {

/// A file that appears under its name when it is complete: until `close` it is written beside it, and without that it
/// is removed. All but the destructor throw Error if it cannot be written.
class RHEC_EXPORT WholeFile {
 public:
  /// Makes the folders that it is in, where they are missing.
  explicit WholeFile(const std::filesystem::path& file);
  ~WholeFile();
  WholeFile(const WholeFile&) = delete;
  WholeFile& operator=(const WholeFile&) = delete;

  const std::filesystem::path& path() const noexcept { return file_; }
  void write(std::span<const std::byte> bytes);
  void write(std::string_view text) { write(std::as_bytes(std::span(text))); }
  void close();

 private:
  std::filesystem::path file_, part_;
  std::ofstream stream_;
  bool is_closed_ = false;
};

}  // namespace rhec::logs
