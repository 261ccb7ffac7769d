#include "scenario_text.hpp"

#include <algorithm>
#include <cctype>

#include <fmt/format.h>

#include "rhec/sim/files/json.hpp"

namespace rhec::sim {
namespace {

constexpr std::size_t line_width = 120;

/// A text that YAML reads as itself needs no quotes.
std::string scalar_text(const std::string& text) {
  const auto is_plain = [](unsigned char c) {
    return std::isalnum(c) != 0 || c == '_' || c == '.' || c == '/' || c == '-' || c == '+';
  };
  const bool plain = !text.empty() && std::all_of(text.begin(), text.end(), is_plain) && text != "null" &&
                     text != "Null" && text != "NULL" && text[0] != '-' && text[0] != '+';
  if (plain || Settings::scalar(text).number()) return text;
  std::string quoted;
  append_quoted(text, quoted);
  return quoted;
}

std::string in_one_line(const Settings& settings) {
  std::string text;
  switch (settings.kind()) {
    case Settings::Kind::null:
      return "null";
    case Settings::Kind::scalar:
      return scalar_text(settings.text());
    case Settings::Kind::list:
      for (const Settings& item : settings.items()) text += (text.empty() ? "" : ", ") + in_one_line(item);
      return "[" + text + "]";
    case Settings::Kind::map:
      for (const auto& [key, value] : settings.members())
        if (!value.is_null()) text += (text.empty() ? "" : ", ") + scalar_text(key) + ": " + in_one_line(value);
      return "{" + text + "}";
  }
  return text;
}

void append(const Settings& map, int depth, std::string& text) {
  const std::string indent(2 * static_cast<std::size_t>(depth), ' ');
  for (const auto& [key, value] : map.members()) {
    if (value.is_null()) continue;
    const std::string line = fmt::format("{}{}: {}\n", indent, scalar_text(key), in_one_line(value));
    const bool is_map = value.kind() == Settings::Kind::map && !value.members().empty();
    if (is_map && (depth == 0 || line.size() > line_width)) {
      text += fmt::format("{}{}:\n", indent, scalar_text(key));
      append(value, depth + 1, text);
    } else {
      text += line;
    }
  }
}

}  // namespace

std::string scenario_text(const Settings& settings) {
  std::string text;
  append(settings, 0, text);
  return text;
}

}  // namespace rhec::sim
