#include "rhec/logs/storage/input_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "rhec/core/base/error.hpp"

namespace rhec::logs {
namespace {

constexpr std::size_t buffer_size = std::size_t{1} << 18;

}  // namespace

InputFile::InputFile(const std::filesystem::path& file) : path_(file), buffer_(buffer_size) {
  const std::filesystem::file_status status = std::filesystem::status(file);
  if (std::filesystem::exists(status) && !std::filesystem::is_directory(status) &&
      !std::filesystem::is_regular_file(status))  // opening a pipe would wait for a writer
    throw Error(fmt::format("{}: is a device or a pipe, which has no end to look for; expected a file", file.string()));
  stream_.rdbuf()->pubsetbuf(buffer_.data(), static_cast<std::streamsize>(buffer_.size()));
  errno = 0;
  stream_.open(file, std::ios::binary);
  if (!stream_ || std::filesystem::is_directory(file))
    throw Error(fmt::format("{}: cannot be read: {}; give a file", file.string(),
                            errno != 0 ? std::strerror(errno) : "it is a folder"));
  size_ = static_cast<std::int64_t>(std::filesystem::file_size(file));
}

void InputFile::seek(std::int64_t place) {
  place_ = std::clamp<std::int64_t>(place, 0, size_);
  stream_.clear();
  stream_.seekg(place_);
}

bool InputFile::read(std::span<std::byte> bytes) {
  if (std::ssize(bytes) > left()) return false;
  stream_.read(reinterpret_cast<char*>(bytes.data()), std::ssize(bytes));
  if (stream_.gcount() != std::ssize(bytes)) {  // it has become shorter, or the disk fails
    seek(place_);
    return false;
  }
  place_ += std::ssize(bytes);
  return true;
}

bool begins_with(std::span<const std::byte> bytes, std::string_view text) noexcept {
  return bytes.size() >= text.size() && std::memcmp(bytes.data(), text.data(), text.size()) == 0;
}

std::uint64_t ByteReader::number(std::size_t size) noexcept {
  std::uint64_t value = 0;
  const auto bytes = take(size);
  for (std::size_t i = 0; i < bytes.size(); ++i) value |= std::to_integer<std::uint64_t>(bytes[i]) << (8 * i);
  return value;
}

std::span<const std::byte> ByteReader::take(std::uint64_t count) noexcept {
  if (count > bytes_.size()) {
    ok_ = false;
    bytes_ = {};
    return {};
  }
  const auto taken = bytes_.first(static_cast<std::size_t>(count));
  bytes_ = bytes_.subspan(static_cast<std::size_t>(count));
  return taken;
}

std::string_view ByteReader::text() noexcept {
  const auto bytes = take(u32());
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

void ByteWriter::text(std::string_view value) {
  u32(static_cast<std::uint32_t>(value.size()));
  append(std::as_bytes(std::span(value)));
}

}  // namespace rhec::logs
