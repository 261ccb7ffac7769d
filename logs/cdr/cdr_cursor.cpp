#include "rhec/logs/cdr/cdr_cursor.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>

#include "rhec/logs/signals/log.hpp"

namespace rhec::logs {
namespace {

constexpr std::size_t preamble = 4;

// Identifiers of representations, of DDS-XTypes 1.3, 7.6.3.1.2.
constexpr unsigned cdr_big = 0x0000, cdr_little = 0x0001, plain_cdr2_big = 0x0006, plain_cdr2_little = 0x0007;

template <class T>
T swapped(T value) noexcept {
  auto bytes = std::bit_cast<std::array<std::byte, sizeof(T)>>(value);
  std::reverse(bytes.begin(), bytes.end());
  return std::bit_cast<T>(bytes);
}

}  // namespace

std::size_t size_of(Kind kind) noexcept {
  constexpr std::array<std::size_t, 15> sizes{1, 1, 1, 2, 2, 4, 4, 8, 8, 4, 8, 0, 0, 0, 0};
  return sizes[static_cast<std::size_t>(kind)];
}

CdrCursor::CdrCursor(std::span<const std::byte> message) {
  if (message.size() < preamble)
    throw RecordError(fmt::format("found a message of {} bytes, expected CDR, which has 4 at least", message.size()));
  const unsigned form = std::to_integer<unsigned>(message[0]) << 8 | std::to_integer<unsigned>(message[1]);
  if (form != cdr_big && form != cdr_little && form != plain_cdr2_big && form != plain_cdr2_little)
    throw RecordError(
        fmt::format("found a message that begins with {:#06x}, expected plain CDR (0x0000, 0x0001, 0x0006 "
                    "or 0x0007)",
                    form));
  const bool is_little = form == cdr_little || form == plain_cdr2_little;
  is_swapped_ = is_little != (std::endian::native == std::endian::little);
  if (form == plain_cdr2_big || form == plain_cdr2_little) widest_ = 4;
  bytes_ = message.subspan(preamble);
}

void CdrCursor::align(Kind kind) {
  const std::size_t to = std::min(size_of(kind), widest_);
  if (to > 1) place_ = (place_ + to - 1) / to * to;
  if (place_ > bytes_.size()) place_ = bytes_.size();
}

template <class T>
T CdrCursor::raw(std::size_t place) const noexcept {
  T value;
  std::memcpy(&value, bytes_.data() + place, sizeof(T));
  return is_swapped_ ? swapped(value) : value;
}

double CdrCursor::number(Kind kind) {
  align(kind);
  const std::size_t at = place_;
  skip_numbers(kind, 1);
  switch (kind) {
    case Kind::boolean:
      return raw<std::uint8_t>(at) != 0 ? 1.0 : 0.0;
    case Kind::u8:
      return raw<std::uint8_t>(at);
    case Kind::i8:
      return raw<std::int8_t>(at);
    case Kind::u16:
      return raw<std::uint16_t>(at);
    case Kind::i16:
      return raw<std::int16_t>(at);
    case Kind::u32:
      return raw<std::uint32_t>(at);
    case Kind::i32:
      return raw<std::int32_t>(at);
    case Kind::u64:
      return static_cast<double>(raw<std::uint64_t>(at));
    case Kind::i64:
      return static_cast<double>(raw<std::int64_t>(at));
    case Kind::f32:
      return static_cast<double>(raw<float>(at));
    case Kind::f64:
      return raw<double>(at);
    default:
      return 0.0;
  }
}

void CdrCursor::skip_numbers(Kind kind, std::uint64_t count) {
  if (count == 0) return;
  align(kind);
  const std::size_t size = size_of(kind);
  if (count > left() / size)
    throw RecordError(fmt::format("found the end of the message, expected {} more bytes", count * size));
  place_ += static_cast<std::size_t>(count) * size;
}

std::string_view CdrCursor::text() {
  const std::uint64_t size = length(1);  // with the zero at its end
  const auto* begin = reinterpret_cast<const char*>(bytes_.data() + place_);
  place_ += static_cast<std::size_t>(size);
  return {begin, static_cast<std::size_t>(size > 0 ? size - 1 : 0)};
}

std::uint64_t CdrCursor::length(std::size_t least) {
  align(Kind::u32);
  const std::size_t at = place_;
  skip_numbers(Kind::u32, 1);
  const std::uint64_t length = raw<std::uint32_t>(at);
  if (length > left() / least)
    throw RecordError(
        fmt::format("found a length of {} with {} bytes left; expected a message of the type that the log "
                    "names",
                    length, left()));
  return length;
}

}  // namespace rhec::logs
