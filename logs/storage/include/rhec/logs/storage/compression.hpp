#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "rhec/core/base/export.hpp"

namespace rhec::logs {

enum class Compression : std::uint8_t { none, lz4, zstd };

/// From the name that formats use: "", "lz4", "zstd". False for another one.
RHEC_EXPORT bool compression_of(std::string_view name, Compression& compression) noexcept;
/// Whether bytes begin a frame of zstd.
RHEC_EXPORT bool is_zstd(std::span<const std::byte> bytes) noexcept;

/// Decompresses one block. `bytes` grows with what is found, never beyond `most`: a size that a file states is not
/// allocated on its word. Returns why that failed, or an empty text; what was decompressed until then is in `bytes`.
RHEC_EXPORT std::string decompress(Compression compression, std::span<const std::byte> block, std::size_t most,
                                   std::vector<std::byte>& bytes);
/// Decompresses what comes in blocks.
class RHEC_EXPORT ZstdStream {
 public:
  ZstdStream();
  ~ZstdStream();
  ZstdStream(const ZstdStream&) = delete;
  ZstdStream& operator=(const ZstdStream&) = delete;
  /// What the next block decompresses to. Returns why that failed, or an empty text.
  std::string decompress(std::span<const std::byte> block, std::vector<std::byte>& bytes);
  /// Whether what has come ends within a frame.
  bool is_within_frame() const noexcept { return is_within_frame_; }

 private:
  void* context_;  ///< zstd's
  bool is_within_frame_ = false;
};
/// Compresses a block by zstd.
RHEC_EXPORT void compress_zstd(std::span<const std::byte> bytes, std::vector<std::byte>& block);

/// CRC-32 (ISO 3309, as zlib's) of bytes that follow those of `before`.
RHEC_EXPORT std::uint32_t crc32(std::span<const std::byte> bytes, std::uint32_t before = 0) noexcept;

}  // namespace rhec::logs
