#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "rhec/core/base/export.hpp"

namespace rhec::logs {

/// A file of bytes that is read from the front, or from any place of it.
class RHEC_EXPORT InputFile {
 public:
  /// Throws Error if it cannot be opened.
  explicit InputFile(const std::filesystem::path& file);

  const std::filesystem::path& path() const noexcept { return path_; }
  std::int64_t size() const noexcept { return size_; }
  std::int64_t place() const noexcept { return place_; }
  std::int64_t left() const noexcept { return size_ - place_; }
  void seek(std::int64_t place);
  /// Fills `bytes` from the present place on; false, with the place as it was, if there are not so many.
  bool read(std::span<std::byte> bytes);

 private:
  std::filesystem::path path_;
  std::vector<char> buffer_;
  std::ifstream stream_;
  std::int64_t size_ = 0, place_ = 0;
};

/// Whether a text begins what a file holds.
RHEC_EXPORT bool begins_with(std::span<const std::byte> bytes, std::string_view text) noexcept;

/// Numbers and texts, little-endian, cut off the front of bytes. Beyond their end everything is 0 or empty, and `ok` is
/// false from there on.
class RHEC_EXPORT ByteReader {
 public:
  explicit ByteReader(std::span<const std::byte> bytes) noexcept : bytes_(bytes) {}

  bool ok() const noexcept { return ok_; }
  std::size_t left() const noexcept { return bytes_.size(); }
  std::uint8_t u8() noexcept { return static_cast<std::uint8_t>(number(1)); }
  std::uint16_t u16() noexcept { return static_cast<std::uint16_t>(number(2)); }
  std::uint32_t u32() noexcept { return static_cast<std::uint32_t>(number(4)); }
  std::uint64_t u64() noexcept { return number(8); }
  std::span<const std::byte> take(std::uint64_t count) noexcept;
  /// A text with its length before it, in four bytes.
  std::string_view text() noexcept;

 private:
  std::uint64_t number(std::size_t size) noexcept;
  std::span<const std::byte> bytes_;
  bool ok_ = true;
};

/// The same, written.
class RHEC_EXPORT ByteWriter {
 public:
  void u8(std::uint8_t value) { number(value, 1); }
  void u16(std::uint16_t value) { number(value, 2); }
  void u32(std::uint32_t value) { number(value, 4); }
  void u64(std::uint64_t value) { number(value, 8); }
  void text(std::string_view value);
  void append(std::span<const std::byte> bytes) { bytes_.insert(bytes_.end(), bytes.begin(), bytes.end()); }
  std::vector<std::byte>& bytes() noexcept { return bytes_; }
  const std::vector<std::byte>& bytes() const noexcept { return bytes_; }

 private:
  void number(std::uint64_t value, int size) {
    for (int i = 0; i < size; ++i) bytes_.push_back(static_cast<std::byte>(value >> (8 * i)));
  }
  std::vector<std::byte> bytes_;
};

}  // namespace rhec::logs
