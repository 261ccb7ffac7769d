#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

#include "rhec/core/base/export.hpp"
#include "rhec/logs/cdr/message_definitions.hpp"

namespace rhec::logs {

/// Bytes of a number in CDR; 0 for what is none.
RHEC_EXPORT std::size_t size_of(Kind kind) noexcept;

/// A place in a message in CDR: XCDR1 (classic CDR) of either byte order, or plain XCDR2. Throws RecordError where a
/// message ends too early, or has a length that it has no room for.
class RHEC_EXPORT CdrCursor {
 public:
  /// Reads the four bytes that say how the message is encoded.
  explicit CdrCursor(std::span<const std::byte> message);

  std::size_t place() const noexcept { return place_; }
  void go_to(std::size_t place) noexcept { place_ = place; }
  std::size_t left() const noexcept { return bytes_.size() - place_; }

  /// Moves on to where a number of this kind lies.
  void align(Kind kind);
  double number(Kind kind);
  void skip_numbers(Kind kind, std::uint64_t count);
  std::string_view text();
  void skip_text() { text(); }
  /// The length of a sequence whose items take `least` bytes each, or more.
  std::uint64_t length(std::size_t least);
  void skip_byte() { skip_numbers(Kind::u8, 1); }

 private:
  template <class T>
  T raw(std::size_t place) const noexcept;
  std::span<const std::byte> bytes_;  ///< behind the first four
  std::size_t place_ = 0, widest_ = 8;
  bool is_swapped_ = false;
};

}  // namespace rhec::logs
