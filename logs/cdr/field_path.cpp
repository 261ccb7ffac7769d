#include "field_path.hpp"

#include <fmt/format.h>

#include "definition_text.hpp"
#include "rhec/logs/signals/log.hpp"

namespace rhec::logs {

std::vector<PathStep> parse_path(std::string_view text) {
  std::vector<PathStep> steps;
  const auto refuse = [&] {
    return Error(fmt::format("found the field {}, expected names joined by dots, each with an [index] or a [name]",
                             in_quotes(text)));
  };
  for (std::string_view rest = text;;) {
    const std::size_t end = rest.find_first_of(".[");
    steps.push_back({std::string(rest.substr(0, end)), std::nullopt});
    if (steps.back().name.empty()) throw refuse();
    if (end == std::string_view::npos) return steps;
    rest.remove_prefix(end);
    if (rest.front() == '[') {
      const std::size_t close = rest.find(']');
      if (close == std::string_view::npos || close < 2) throw refuse();
      steps.back().item = std::string(rest.substr(1, close - 1));
      rest.remove_prefix(close + 1);
      if (rest.empty()) return steps;
      if (rest.front() != '.') throw refuse();
    }
    rest.remove_prefix(1);
  }
}

std::optional<std::uint64_t> index_in(const std::string& item) {
  std::uint64_t index = 0;
  if (!read_length(item, index)) return std::nullopt;
  return index;
}

}  // namespace rhec::logs
