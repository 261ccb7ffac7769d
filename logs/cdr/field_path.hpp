#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace rhec::logs {

/// One step of a path such as "pose.position[0].x": a field, and which of its items.
struct PathStep {
  std::string name;
  std::optional<std::string> item;  ///< an index, or a name
};

/// Throws Error for what is no path.
std::vector<PathStep> parse_path(std::string_view text);
/// An index from 0; empty for a name.
std::optional<std::uint64_t> index_in(const std::string& item);

}  // namespace rhec::logs
