#include "rhec/plugins/robot/spans.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <string>
#include <string_view>
#include <system_error>

#include <fmt/format.h>

namespace rhec {
namespace {

constexpr double most_intervals = 1e6;
// A time that is a multiple of the step may miss it by rounding.
constexpr double rounding = 1e-6;

}  // namespace

Settings span_in_intervals(const Settings& length, double step) {
  if (length.kind() != Settings::Kind::scalar) return length;
  const std::string& text = length.text();
  if (text.empty() || text.find_first_not_of("-.0123456789") == 0) return length;
  double number = 0.0;
  const auto [end, failed] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (failed != std::errc()) return length;
  std::string_view unit(end, static_cast<std::size_t>(text.data() + text.size() - end));
  while (!unit.empty() && unit.front() == ' ') unit.remove_prefix(1);
  if (unit.empty()) return length;
  if (unit != "s") throw length.mismatch("a number of intervals, or a time in seconds such as '3 s'");
  const double intervals = std::max(0.0, std::ceil(number / step - rounding));
  if (!(number >= 0.0) || !(intervals <= most_intervals))
    throw length.mismatch(fmt::format("a time from 0 s to {:.6g} s, which is {:g} intervals of the step, {:g} s",
                                      most_intervals * step, most_intervals, step));
  return Settings::scalar(fmt::format("{:.0f}", intervals), length.origin());
}

Settings with_span_in_intervals(const Settings& map, std::string_view key, double step) {
  const Settings* const length = map.find(key);
  if (!length) return map;
  Settings result = map;
  result.set(key, span_in_intervals(*length, step));
  return result;
}

Settings all_spans_in_intervals(const Settings& tree, double step) {
  if (tree.kind() == Settings::Kind::map) {
    Settings result = tree;
    for (const auto& [key, value] : tree.members()) {
      if (key.find('.') != std::string::npos) continue;  // no path
      result.set(key, all_spans_in_intervals(value, step));
    }
    return result;
  }
  if (tree.kind() != Settings::Kind::list) return span_in_intervals(tree, step);
  Settings result = Settings::list(tree.origin());
  for (const Settings& item : tree.items()) result.append(all_spans_in_intervals(item, step));
  return result;
}

}  // namespace rhec
