// ROS's own language of messages: "TYPE[LENGTH] NAME DEFAULT", or "TYPE NAME=CONSTANT", one on a line.
#include <fmt/format.h>

#include <charconv>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "definition_text.hpp"
#include "rhec/core/base/error.hpp"
#include "rhec/logs/cdr/message_definitions.hpp"
#include "rhec/logs/signals/log.hpp"

namespace rhec::logs {
namespace {

/// The package of a type, for types that are named without one.
std::string package_of(const std::string& type) { return type.substr(0, type.find('/')); }

std::string resolved(std::string_view name, const std::string& owner) {
  if (name == "Header") return "std_msgs/msg/Header";
  if (name.find('/') == std::string_view::npos) return full_type_name(package_of(owner) + "/" + std::string(name));
  return full_type_name(name);
}

class MsgParser {
 public:
  MsgParser(std::string type, Definitions& definitions) : definitions_(definitions) { begin(std::move(type)); }

  void take(std::string_view line, int number) {
    line = trimmed_text(line.substr(0, line.find('#')));
    if (line.starts_with("====")) {
      is_separated_ = true;
      return;
    }
    if (is_separated_ && line.starts_with("MSG:")) {
      is_separated_ = false;
      return begin(full_type_name(trimmed_text(line.substr(4))));
    }
    if (line.empty()) return;
    const std::size_t blank = line.find_first_of(" \t");
    if (blank == std::string_view::npos) throw error(number, line);
    const std::string_view type = line.substr(0, blank);
    std::string_view rest = trimmed_text(line.substr(blank));
    const std::size_t end = rest.find_first_of(" \t=");
    const std::string_view name = rest.substr(0, end);
    const std::string_view behind = end == std::string_view::npos ? "" : trimmed_text(rest.substr(end));
    if (behind.starts_with('=')) return;  // a constant
    if (name.empty()) throw error(number, line);
    FieldDefinition field{.name = std::string(name)};
    if (!read_type(type, field)) throw error(number, line);
    definitions_[type_].fields.push_back(std::move(field));
  }

 private:
  void begin(std::string type) {
    type_ = std::move(type);
    definitions_[type_] = {.name = type_, .fields = {}};
  }

  Error error(int number, std::string_view line) const {
    return Error(
        fmt::format("definition of {}, line {}: found {}, expected 'type name'", type_, number, in_quotes(line)));
  }

  /// "string<=10[<=5]", "geometry_msgs/Point[3]", "float64[]"
  bool read_type(std::string_view text, FieldDefinition& field) const {
    const std::size_t open = text.find('[');
    if (open != std::string_view::npos) {
      if (!text.ends_with(']')) return false;
      const std::string_view length = text.substr(open + 1, text.size() - open - 2);
      field.shape = length.empty() || length.starts_with("<=") ? Shape::sequence : Shape::array;
      if (field.shape == Shape::array && !read_length(length, field.length)) return false;
      text = text.substr(0, open);
    }
    text = text.substr(0, text.find("<="));
    if (text.empty()) return false;
    if (const auto kind = kind_of(text)) {
      field.kind = *kind;
      field.is_octet = text == "byte";
    } else {
      field.kind = Kind::structure;
      field.type = resolved(text, type_);
    }
    return true;
  }

  Definitions& definitions_;
  std::string type_;
  bool is_separated_ = false;
};

}  // namespace

void parse_ros2msg(const std::string& type, std::string_view text, Definitions& definitions) {
  MsgParser parser(type, definitions);
  for (int number = 1; !text.empty(); ++number) {
    const std::size_t end = text.find('\n');
    parser.take(text.substr(0, end), number);
    text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
  }
}

}  // namespace rhec::logs
