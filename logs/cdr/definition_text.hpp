#pragma once

#include <array>
#include <charconv>
#include <cstdint>
#include <optional>
#include <string_view>
#include <system_error>
#include <utility>

#include "rhec/logs/cdr/message_definitions.hpp"

namespace rhec::logs {

inline std::string_view trimmed_text(std::string_view text) {
  const std::size_t first = text.find_first_not_of(" \t\r");
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(" \t\r") - first + 1);
}

/// The words of both languages for kinds that are no structures.
inline std::optional<Kind> kind_of(std::string_view word) {
  constexpr std::array<std::pair<std::string_view, Kind>, 25> words{{
      {"bool", Kind::boolean},  {"boolean", Kind::boolean},    {"byte", Kind::u8},
      {"char", Kind::u8},       {"octet", Kind::u8},           {"uint8", Kind::u8},
      {"int8", Kind::i8},       {"uint16", Kind::u16},         {"int16", Kind::i16},
      {"uint32", Kind::u32},    {"int32", Kind::i32},          {"uint64", Kind::u64},
      {"int64", Kind::i64},     {"float32", Kind::f32},        {"float64", Kind::f64},
      {"string", Kind::text},   {"wstring", Kind::wide_text},  {"short", Kind::i16},
      {"long", Kind::i32},      {"float", Kind::f32},          {"double", Kind::f64},
      {"wchar", Kind::u16},     {"unsigned short", Kind::u16}, {"unsigned long", Kind::u32},
      {"long long", Kind::i64},
  }};
  for (const auto& [name, kind] : words)
    if (name == word) return kind;
  if (word == "unsigned long long") return Kind::u64;
  if (word == "long double" || word == "float128") return Kind::long_double;
  return std::nullopt;
}

inline bool read_length(std::string_view text, std::uint64_t& length) {
  const auto [end, failure] = std::from_chars(text.data(), text.data() + text.size(), length);
  constexpr std::uint64_t most = std::uint64_t{1} << 32;
  return failure == std::errc() && end == text.data() + text.size() && length <= most;
}

}  // namespace rhec::logs
