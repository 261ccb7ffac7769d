#include "rhec/logs/signals/log.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "rhec/core/config/option_values.hpp"

namespace rhec::logs {

int Log::topic(std::string_view name) const {
  const auto found = std::find_if(topics_.begin(), topics_.end(), [&](const Topic& each) { return each.name == name; });
  if (found != topics_.end()) return static_cast<int>(found - topics_.begin());
  if (topics_.size() == 1 && topics_.front().name.empty())
    throw Error(fmt::format("{} is a table, and has no topic '{}'; expected the name of a column", name_, name));
  std::vector<std::string> known;
  for (const Topic& each : topics_) known.push_back(each.name);
  if (name.empty())
    throw Error(fmt::format("{} has topics; expected 'topic:field'; its topics are {}", name_, fmt::join(known, ", ")));
  throw Error(fmt::format("{} has no topic '{}'{}", name_, name, suggestion_for(name, known)));
}

std::string Log::unit_of(int, std::string_view) const { return {}; }

SignalName parse_signal_name(std::string_view text) {
  const std::size_t colon = text.find(':');
  if (colon != std::string_view::npos && text.starts_with('/'))
    return {std::string(text.substr(0, colon)), std::string(text.substr(colon + 1))};
  if (text.starts_with('/')) return {std::string(text), ""};
  return {"", std::string(text)};
}

std::string suggestion_for(std::string_view name, const std::vector<std::string>& known) {
  const std::string near = nearest(name, known);
  if (!near.empty()) return fmt::format("; did you mean '{}'?", near);
  if (known.empty()) return "; there is none";
  constexpr std::size_t most = 30;
  const std::vector<std::string> first(known.begin(), known.begin() + std::min(most, known.size()));
  return fmt::format("; expected one of {}{}", fmt::join(first, ", "), known.size() > most ? ", ..." : "");
}

std::string in_quotes(std::string_view text) {
  constexpr std::size_t most = 60;
  std::string shown = "'";
  for (const char c : text.substr(0, most)) shown += c >= ' ' && c <= '~' ? c : '?';
  return shown + (text.size() > most ? "...'" : "'");
}

}  // namespace rhec::logs
