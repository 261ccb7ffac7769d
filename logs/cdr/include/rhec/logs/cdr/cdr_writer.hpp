#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <string_view>
#include <vector>

#include "rhec/core/base/export.hpp"
#include "rhec/logs/signals/log.hpp"

namespace rhec::logs {

/// Writes a message in CDR (XCDR1, little-endian): its fields one after the other, in the order of its definition.
class RHEC_EXPORT CdrWriter {
 public:
  CdrWriter() { clear(); }
  /// Begins a new message.
  void clear();

  void flag(bool value) { raw(static_cast<std::uint8_t>(value)); }
  void u8(std::uint8_t value) { raw(value); }
  void i8(std::int8_t value) { raw(value); }
  void u16(std::uint16_t value) { raw(value); }
  void i32(std::int32_t value) { raw(value); }
  void u32(std::uint32_t value) { raw(value); }
  void f32(float value) { raw(value); }
  void f64(double value) { raw(value); }
  void text(std::string_view value);
  void length(std::size_t count) { u32(static_cast<std::uint32_t>(count)); }
  /// builtin_interfaces/Time
  void stamp(Stamp stamp);
  /// std_msgs/Header
  void header(Stamp when, std::string_view frame) {
    stamp(when);
    text(frame);
  }
  void numbers(std::span<const double> values) {
    for (const double value : values) f64(value);
  }

  std::span<const std::byte> bytes() const noexcept { return bytes_; }

 private:
  static constexpr std::size_t preamble = 4;  ///< says how the message is encoded
  template <class T>
  void raw(T value) {
    const std::size_t place = bytes_.size() - preamble;
    const std::size_t aligned = (place + sizeof(T) - 1) / sizeof(T) * sizeof(T) + preamble;
    bytes_.resize(aligned + sizeof(T));
    std::memcpy(bytes_.data() + aligned, &value, sizeof(T));
  }
  std::vector<std::byte> bytes_;
};

}  // namespace rhec::logs
