#include "sweep_maps.hpp"

#include <algorithm>
#include <optional>
#include <set>
#include <tuple>

#include <fmt/format.h>

#include "report_files.hpp"

namespace rhec::sim {
namespace {

constexpr std::size_t most_choices = 60;  ///< maps of a sweep; beyond that, keys are averaged over

}  // namespace

std::int64_t SweepMap::runs() const {
  std::int64_t sum = 0;
  for (const auto& [place, cell] : cells)
    for (const RunGroup* group : cell) sum += std::ssize(group->outcomes);
  return sum;
}

SweepMaps blocking_maps(const std::vector<RunGroup>& groups, const SweepSettings& settings, Json& notes) {
  SweepMaps made;
  made.axes = {SweepAxis{"size", "block length S", {}}, SweepAxis{"overlap", "overlap o", {}}};
  for (const VariedKey& key : settings.varied()) made.choice_keys.push_back(key);
  // Groups where a parameter has one block, or one per interval, by all other varying keys.
  std::map<std::string, const RunGroup*> full, unblocked;
  const auto others_are = [&](const RunGroup& group, const std::vector<std::string>& blocked, const char* name) {
    return std::all_of(blocked.begin(), blocked.end(), [&](const std::string& parameter) {
      return value_of(group, "blocking." + parameter + ".name") == name;
    });
  };
  std::set<std::vector<std::string>> ways;
  for (const RunGroup& group : groups)
    if (const auto blocks = settings.blocks_of(group)) ways.insert(blocks->parameters);
  const auto key_of = [&](const RunGroup& group, const std::vector<std::string>& blocked) {
    std::string key;
    for (const std::string& parameter : blocked) (key += parameter) += '\n';
    return key + settings.rest_of(group, blocked);
  };
  const auto has_options = [&](const RunGroup& group, const std::vector<std::string>& blocked) {
    return std::any_of(group.keys.begin(), group.keys.end(), [&](const auto& entry) {
      return settings.varies().contains(entry.first) && !entry.first.ends_with(".name") &&
             std::any_of(blocked.begin(), blocked.end(), [&](const std::string& parameter) {
               return entry.first.starts_with("blocking." + parameter + ".");
             });
    });
  };
  for (const RunGroup& group : groups)
    for (const std::vector<std::string>& way : ways) {
      if (others_are(group, way, "\"full_horizon\"")) full[key_of(group, way)] = &group;
      // Prefer the plain one of several unblocked variants.
      if (others_are(group, way, "\"unblocked\"") && !has_options(group, way)) unblocked[key_of(group, way)] = &group;
    }
  std::map<std::string, SweepMap> maps;
  std::map<std::string, std::int64_t> blocked;
  std::set<const RunGroup*> shown;
  for (const RunGroup& group : groups) {
    const auto blocks = settings.blocks_of(group);
    if (!blocks) continue;
    shown.insert(&group);
    const std::string words = settings.blocked_words(group, blocks->parameters),
                      key = key_of(group, blocks->parameters);
    SweepMap& map = maps[fmt::format("{}\n{}", words, key)];
    if (map.cells.empty()) {
      map.is_blocking = true;
      for (const VariedKey& choice : made.choice_keys) map.setting.push_back(value_of(group, choice.key));
      map.setting.push_back(Json(words).dump());
      if (const auto found = full.find(key); found != full.end()) map.reference = found->second;
      if (const auto found = unblocked.find(key); found != unblocked.end()) map.unblocked = found->second;
      shown.insert(map.reference);
      shown.insert(map.unblocked);
    }
    blocked[words] += std::ssize(group.outcomes);
    map.cells[{blocks->size, blocks->overlap}].push_back(&group);
  }
  VariedKey choice{"blocked", {"blocked"}, {}};
  for (const auto& [words, count] : blocked) choice.values.push_back(Json(words).dump());
  std::sort(choice.values.begin(), choice.values.end(), [&](const std::string& a, const std::string& b) {
    return std::pair(-blocked[plain_text(a)], a) < std::pair(-blocked[plain_text(b)], b);
  });
  made.choice_keys.push_back(std::move(choice));
  for (auto& [key, map] : maps) made.maps.push_back(std::move(map));
  for (const RunGroup& group : groups)
    if (!shown.contains(&group)) made.others.push_back(&group);
  if (std::any_of(made.maps.begin(), made.maps.end(), [](const SweepMap& map) { return !map.reference; }))
    add_note(notes, "pairs", "Some settings have no runs with full-horizon blocking to be held against.");
  return made;
}

SweepMaps general_maps(const std::vector<RunGroup>& groups, const SweepSettings& settings, Json& notes) {
  SweepMaps made;
  std::vector<VariedKey> keys = settings.varied();
  for (const std::string& key : settings.varies())
    if (key.starts_with("blocking.")) keys.push_back({key, {key}, settings.sorted_values(key)});
  if (keys.empty()) {
    add_note(notes, "runs", "No key varies but the seed, so that there is one setting alone.");
    keys.push_back({"name", {"name"}, settings.sorted_values("name")});
  }
  // Numeric keys become axes, those with most values first; without any, text keys do.
  std::stable_sort(keys.begin(), keys.end(), [](const VariedKey& a, const VariedKey& b) {
    return std::tuple(!a.is_numeric(), -std::ssize(a.values)) < std::tuple(!b.is_numeric(), -std::ssize(b.values));
  });
  const bool has_second = keys.size() > 1 && (keys[1].is_numeric() || keys.size() == 2);
  const std::size_t axes = has_second ? 2 : 1;
  for (std::size_t i = 0; i < axes; ++i) made.axes.push_back({keys[i].key, keys[i].key, keys[i].values});
  std::size_t choices = 1;
  for (std::size_t i = axes; i < keys.size(); ++i) {
    if (choices * keys[i].values.size() > most_choices) {
      add_note(notes, "settings",
               fmt::format("Means are also over the {} values of {}, since there are too many settings to choose from.",
                           keys[i].values.size(), keys[i].key));
      continue;
    }
    choices *= keys[i].values.size();
    made.choice_keys.push_back(keys[i]);
  }
  std::map<Setting, SweepMap> maps;
  for (const RunGroup& group : groups) {
    Setting setting;
    for (const VariedKey& choice : made.choice_keys) setting.push_back(value_of(group, choice.key));
    SweepMap& map = maps[setting];
    map.setting = setting;
    map.cells[{value_of(group, made.axes[0].key), axes == 2 ? value_of(group, made.axes[1].key) : no_value}].push_back(
        &group);
  }
  for (auto& [setting, map] : maps) made.maps.push_back(std::move(map));
  add_note(notes, "pairs",
           "The sweep does not vary block length and overlap, so there is nothing that settings are held "
           "against seed by seed.");
  return made;
}

}  // namespace rhec::sim
