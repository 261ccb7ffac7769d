#include "rhec/logs/cdr/cdr_writer.hpp"

#include <bit>

namespace rhec::logs {
namespace {

constexpr std::int64_t second = 1'000'000'000;

}  // namespace

void CdrWriter::clear() {
  static_assert(std::endian::native == std::endian::little, "numbers are copied as they lie in memory");
  bytes_.assign({std::byte{0}, std::byte{1}, std::byte{0}, std::byte{0}});
}

void CdrWriter::text(std::string_view value) {
  u32(static_cast<std::uint32_t>(value.size() + 1));
  const std::size_t place = bytes_.size();
  bytes_.resize(place + value.size() + 1);
  if (!value.empty()) std::memcpy(bytes_.data() + place, value.data(), value.size());
}

void CdrWriter::stamp(Stamp stamp) {
  std::int64_t seconds = stamp / second, rest = stamp % second;
  if (rest < 0) {
    --seconds;
    rest += second;
  }
  i32(static_cast<std::int32_t>(seconds));
  u32(static_cast<std::uint32_t>(rest));
}

}  // namespace rhec::logs
