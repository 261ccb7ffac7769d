#include "sweep_settings.hpp"

#include <algorithm>
#include <charconv>
#include <map>
#include <tuple>
#include <utility>

#include "rhec/sim/files/json.hpp"

namespace rhec::sim {

const std::string& value_of(const RunGroup& group, const std::string& key) {
  const auto found = group.keys.find(key);
  return found == group.keys.end() ? no_value : found->second;
}

std::optional<double> number_in(const std::string& json) {
  double value = 0.0;
  const auto [end, failure] = std::from_chars(json.data(), json.data() + json.size(), value);
  if (failure != std::errc() || end != json.data() + json.size()) return std::nullopt;
  return value;
}

bool comes_before(const std::string& a, const std::string& b) {
  const auto rank = [](const std::string& json) {
    return std::tuple(json != no_value, !number_in(json), number_in(json).value_or(0.0));
  };
  return std::tuple_cat(rank(a), std::tie(a)) < std::tuple_cat(rank(b), std::tie(b));
}

std::string plain_text(const std::string& json) {
  const std::optional<Json> value = Json::parse_if_valid(json);
  return value && value->is_string() ? value->as_text() : json;
}

bool VariedKey::is_numeric() const {
  return std::all_of(values.begin(), values.end(), [](const std::string& v) { return number_in(v).has_value(); });
}

SweepSettings::SweepSettings(const std::vector<RunGroup>& groups) : groups_(groups) {
  find_varied_keys();
  find_parameters();
}

void SweepSettings::find_varied_keys() {
  std::map<std::string, std::set<std::string>> values;
  for (const RunGroup& group : groups_)
    for (const auto& [key, value] : group.keys) values[key].insert(value);
  std::map<std::string, std::size_t> present;
  for (const RunGroup& group : groups_)
    for (const auto& [key, value] : group.keys) ++present[key];
  // Keys that partition the groups identically are merged.
  std::map<std::vector<std::size_t>, std::size_t> known;
  for (auto& [key, of_key] : values) {
    if (present[key] < groups_.size()) of_key.insert(no_value);
    if (of_key.size() < 2) continue;
    varies_.insert(key);
    if (key.starts_with("blocking.")) continue;
    std::map<std::string, std::size_t> numbers;
    std::vector<std::size_t> division;
    for (const RunGroup& group : groups_)
      division.push_back(numbers.try_emplace(value_of(group, key), numbers.size()).first->second);
    const auto [entry, is_new] = known.try_emplace(std::move(division), varied_.size());
    if (is_new) varied_.push_back({key, {}, {}});
    varied_[entry->second].all.push_back(key);
  }
  for (VariedKey& key : varied_) {
    // A name is more descriptive than the keys that vary with it.
    for (const std::string& other : key.all)
      if (other.ends_with(".name") && !key.key.ends_with(".name")) key.key = other;
    key.values = sorted_values(key.key);
  }
}

std::vector<std::string> SweepSettings::sorted_values(const std::string& key) const {
  std::map<std::string, std::int64_t> counts;
  for (const RunGroup& group : groups_) counts[value_of(group, key)] += std::ssize(group.outcomes);
  std::vector<std::string> values;
  values.reserve(counts.size());
  for (const auto& [value, count] : counts) values.push_back(value);
  const bool numbers =
      std::all_of(values.begin(), values.end(), [](const std::string& v) { return number_in(v) || v == no_value; });
  // The value with most runs is the baseline that the others vary.
  std::sort(values.begin(), values.end(), [&](const std::string& a, const std::string& b) {
    if (numbers || counts[a] == counts[b]) return comes_before(a, b);
    return counts[a] > counts[b];
  });
  return values;
}

void SweepSettings::find_parameters() {
  std::set<std::string> keys;
  for (const RunGroup& group : groups_)
    for (const auto& [key, value] : group.keys) keys.insert(key);
  for (const std::string& key : keys)
    if (key.starts_with("blocking.") && key.ends_with(".name"))
      parameters_.push_back(key.substr(9, key.size() - 9 - 5));
}

std::optional<BlocksOfGroup> SweepSettings::blocks_of(const RunGroup& group) const {
  BlocksOfGroup blocks;
  for (const std::string& parameter : parameters_) {
    const std::string prefix = "blocking." + parameter + ".";
    if (value_of(group, prefix + "name") != "\"structured\"") continue;
    const std::string& size = value_of(group, prefix + "size");
    const std::string overlap =
        value_of(group, prefix + "overlap") == no_value ? "0" : value_of(group, prefix + "overlap");
    if (!number_in(size) || !number_in(overlap)) return std::nullopt;
    if (!blocks.parameters.empty() && (size != blocks.size || overlap != blocks.overlap)) return std::nullopt;
    blocks.parameters.push_back(parameter);
    blocks.size = size;
    blocks.overlap = overlap;
  }
  if (blocks.parameters.empty()) return std::nullopt;
  return blocks;
}

bool SweepSettings::is_of_blocking() const {
  std::set<std::string> sizes, overlaps;
  for (const RunGroup& group : groups_)
    if (const auto blocks = blocks_of(group)) {
      sizes.insert(blocks->size);
      overlaps.insert(blocks->overlap);
    }
  return sizes.size() > 1 || overlaps.size() > 1;
}

std::string SweepSettings::rest_of(const RunGroup& group, const std::vector<std::string>& blocked) const {
  std::string text;
  for (const std::string& key : varies_) {
    const bool is_theirs = std::any_of(blocked.begin(), blocked.end(), [&](const std::string& parameter) {
      return key.starts_with("blocking." + parameter + ".");
    });
    if (!is_theirs) text += key + "=" + value_of(group, key) + "\n";
  }
  return text;
}

std::string SweepSettings::blocked_words(const RunGroup& group, const std::vector<std::string>& blocked) const {
  std::string words;
  for (const std::string& parameter : blocked) words += (words.empty() ? "" : " and ") + parameter;
  std::set<std::string> options, others;
  for (const std::string& key : varies_) {
    if (!key.starts_with("blocking.")) continue;
    const std::size_t dot = key.find('.', 9);
    if (dot == std::string::npos) continue;
    const std::string parameter = key.substr(9, dot - 9), option = key.substr(dot + 1);
    const std::string& value = value_of(group, key);
    const bool is_blocked = std::find(blocked.begin(), blocked.end(), parameter) != blocked.end();
    if (is_blocked && option != "name" && option != "size" && option != "overlap" && value != no_value)
      options.insert(option + " " + plain_text(value));
    if (!is_blocked && value != no_value && value != "\"full_horizon\"")
      others.insert(parameter + " " + plain_text(value));
  }
  for (const auto* list : {&options, &others})
    for (const std::string& text : *list) words += ", " + text;
  return words;
}

}  // namespace rhec::sim
