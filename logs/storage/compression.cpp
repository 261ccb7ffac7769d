#include "rhec/logs/storage/compression.hpp"

#include <fmt/format.h>
#include <lz4frame.h>
#include <zstd.h>

#include <algorithm>
#include <array>
#include <memory>

#include "rhec/core/base/error.hpp"

namespace rhec::logs {
namespace {

constexpr std::size_t first_room = std::size_t{1} << 16;

struct FreeLz4 {
  void operator()(LZ4F_dctx* context) const noexcept { LZ4F_freeDecompressionContext(context); }
};
struct FreeZstd {
  void operator()(ZSTD_DCtx* context) const noexcept { ZSTD_freeDCtx(context); }
};

/// What a step of a decompressor has done.
struct Step {
  std::size_t consumed = 0, produced = 0;
  bool is_complete = false;
  const char* failure = nullptr;
};

/// Gives a decompressor room until its input is used up.
template <class Decompress>
std::string run(std::span<const std::byte> block, std::size_t most, std::vector<std::byte>& bytes,
                const Decompress& decompress_step) {
  std::size_t used = 0;
  bytes.resize(std::min(most, std::max({first_room, bytes.capacity(), 2 * block.size()})));
  for (bool is_complete = false;;) {
    const Step step = decompress_step(block, bytes.data() + used, bytes.size() - used);
    std::string failure = step.failure ? step.failure : "";
    if (failure.empty()) {
      used += step.produced;
      block = block.subspan(step.consumed);
      is_complete = step.is_complete;
      if (used < bytes.size() && !(block.empty() && is_complete)) {
        if (step.produced > 0 || step.consumed > 0) continue;
        failure = "it ends within a frame";
      } else if (!(block.empty() && is_complete) && bytes.size() < most) {
        bytes.resize(std::min(most, 2 * bytes.size()));
        continue;
      } else if (!(block.empty() && is_complete)) {
        failure = fmt::format("it decompresses to more than the {} bytes that were announced", most);
      }
    }
    bytes.resize(used);  // what was good is kept
    return failure;
  }
}

std::string decompress_lz4(std::span<const std::byte> block, std::size_t most, std::vector<std::byte>& bytes) {
  LZ4F_dctx* made = nullptr;
  if (LZ4F_isError(LZ4F_createDecompressionContext(&made, LZ4F_VERSION))) return "no memory for LZ4";
  const std::unique_ptr<LZ4F_dctx, FreeLz4> context(made);
  return run(block, most, bytes, [&](std::span<const std::byte> in, std::byte* out, std::size_t room) {
    Step step{.consumed = in.size(), .produced = room};
    const std::size_t result = LZ4F_decompress(context.get(), out, &step.produced, in.data(), &step.consumed, nullptr);
    if (LZ4F_isError(result)) step.failure = LZ4F_getErrorName(result);
    step.is_complete = result == 0;
    return step;
  });
}

std::string decompress_zstd(std::span<const std::byte> block, std::size_t most, std::vector<std::byte>& bytes) {
  thread_local const std::unique_ptr<ZSTD_DCtx, FreeZstd> context(ZSTD_createDCtx());
  if (!context) return "no memory for zstd";
  ZSTD_DCtx_reset(context.get(), ZSTD_reset_session_only);
  return run(block, most, bytes, [&](std::span<const std::byte> in, std::byte* out, std::size_t room) {
    ZSTD_inBuffer from{in.data(), in.size(), 0};
    ZSTD_outBuffer to{out, room, 0};
    const std::size_t result = ZSTD_decompressStream(context.get(), &to, &from);
    return Step{from.pos, to.pos, result == 0, ZSTD_isError(result) ? ZSTD_getErrorName(result) : nullptr};
  });
}

constexpr std::uint32_t polynomial = 0xEDB88320u;

/// Eight tables: the CRC of a byte that is followed by 0 to 7 zeros, for eight bytes at a time.
constexpr auto crc_tables = [] {
  std::array<std::array<std::uint32_t, 256>, 8> tables{};
  for (std::uint32_t byte = 0; byte < 256; ++byte) {
    std::uint32_t crc = byte;
    for (int bit = 0; bit < 8; ++bit) crc = (crc >> 1) ^ ((crc & 1u) != 0 ? polynomial : 0u);
    tables[0][byte] = crc;
  }
  for (std::size_t table = 1; table < 8; ++table)
    for (std::size_t byte = 0; byte < 256; ++byte) {
      const std::uint32_t before = tables[table - 1][byte];
      tables[table][byte] = (before >> 8) ^ tables[0][before & 0xFFu];
    }
  return tables;
}();

}  // namespace

bool compression_of(std::string_view name, Compression& compression) noexcept {
  if (name.empty() || name == "none") {
    compression = Compression::none;
  } else if (name == "lz4") {
    compression = Compression::lz4;
  } else if (name == "zstd") {
    compression = Compression::zstd;
  } else {
    return false;
  }
  return true;
}

bool is_zstd(std::span<const std::byte> bytes) noexcept {
  constexpr std::array magic{std::byte{0x28}, std::byte{0xB5}, std::byte{0x2F}, std::byte{0xFD}};
  return bytes.size() > magic.size() && std::equal(magic.begin(), magic.end(), bytes.begin());
}

std::string decompress(Compression compression, std::span<const std::byte> block, std::size_t most,
                       std::vector<std::byte>& bytes) {
  if (compression == Compression::lz4) return decompress_lz4(block, most, bytes);
  if (compression == Compression::zstd) return decompress_zstd(block, most, bytes);
  if (block.size() > most)
    return fmt::format("it has {} bytes, more than the {} that were announced", block.size(), most);
  bytes.assign(block.begin(), block.end());
  return {};
}

ZstdStream::ZstdStream() : context_(ZSTD_createDCtx()) {
  if (!context_) throw Error("no memory for zstd");
}
ZstdStream::~ZstdStream() { ZSTD_freeDCtx(static_cast<ZSTD_DCtx*>(context_)); }

std::string ZstdStream::decompress(std::span<const std::byte> block, std::vector<std::byte>& bytes) {
  bytes.clear();
  ZSTD_inBuffer from{block.data(), block.size(), 0};
  for (bool is_full = false; from.pos < from.size || is_full;) {
    const std::size_t used = bytes.size();
    bytes.resize(used + first_room);
    ZSTD_outBuffer to{bytes.data() + used, first_room, 0};
    const std::size_t result = ZSTD_decompressStream(static_cast<ZSTD_DCtx*>(context_), &to, &from);
    bytes.resize(used + to.pos);
    if (ZSTD_isError(result)) return ZSTD_getErrorName(result);
    is_within_frame_ = result != 0;
    is_full = to.pos == first_room;
  }
  return {};
}

void compress_zstd(std::span<const std::byte> bytes, std::vector<std::byte>& block) {
  block.resize(ZSTD_compressBound(bytes.size()));
  const std::size_t size = ZSTD_compress(block.data(), block.size(), bytes.data(), bytes.size(), ZSTD_CLEVEL_DEFAULT);
  if (ZSTD_isError(size)) throw Error(fmt::format("zstd: {}", ZSTD_getErrorName(size)));
  block.resize(size);
}

std::uint32_t crc32(std::span<const std::byte> bytes, std::uint32_t before) noexcept {
  std::uint32_t crc = ~before;
  const auto* at = reinterpret_cast<const unsigned char*>(bytes.data());
  std::size_t left = bytes.size();
  for (; left >= 8; left -= 8, at += 8) {
    const std::uint32_t low = crc ^ (at[0] | static_cast<std::uint32_t>(at[1]) << 8 |
                                     static_cast<std::uint32_t>(at[2]) << 16 | static_cast<std::uint32_t>(at[3]) << 24);
    crc = crc_tables[7][low & 0xFFu] ^ crc_tables[6][(low >> 8) & 0xFFu] ^ crc_tables[5][(low >> 16) & 0xFFu] ^
          crc_tables[4][low >> 24] ^ crc_tables[3][at[4]] ^ crc_tables[2][at[5]] ^ crc_tables[1][at[6]] ^
          crc_tables[0][at[7]];
  }
  for (; left > 0; --left, ++at) crc = (crc >> 8) ^ crc_tables[0][(crc ^ *at) & 0xFFu];
  return ~crc;
}

}  // namespace rhec::logs
