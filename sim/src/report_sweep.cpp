#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <optional>
#include <set>
#include <tuple>
#include <utility>

#include "report_parts.hpp"
#include "report_runs.hpp"
#include "report_statistics.hpp"
#include "rhec/core/base/error.hpp"

namespace rhec::sim {
namespace {

// What a page has room for.
constexpr std::size_t most_bytes = 3'200'000;
constexpr std::size_t most_choices = 60;  ///< maps of a sweep over any keys, before some of them are averaged over
constexpr std::size_t most_others = 200;
constexpr int digits = 5;
constexpr std::size_t bytes_of_number = 8;

const std::string none = "null";

/// A key as it is in one group: JSON, "null" where it is not there.
const std::string& value_of(const RunGroup& group, const std::string& key) {
  const auto found = group.keys.find(key);
  return found == group.keys.end() ? none : found->second;
}

std::optional<double> number_in(const std::string& json) {
  double value = 0.0;
  const auto [end, failure] = std::from_chars(json.data(), json.data() + json.size(), value);
  if (failure != std::errc() || end != json.data() + json.size()) return std::nullopt;
  return value;
}

/// Numbers by size, before texts in their order; what is not there comes first.
bool comes_before(const std::string& a, const std::string& b) {
  const auto rank = [](const std::string& json) {
    return std::tuple(json != none, !number_in(json), number_in(json).value_or(0.0));
  };
  return std::tuple_cat(rank(a), std::tie(a)) < std::tuple_cat(rank(b), std::tie(b));
}

/// Keys that vary together: the values of any one of them tell those of the others.
struct VariedKey {
  std::string key;  ///< the one that speaks for all
  std::vector<std::string> all;
  std::vector<std::string> values;
  bool is_numeric() const {
    return std::all_of(values.begin(), values.end(), [](const std::string& v) { return number_in(v).has_value(); });
  }
};

/// The values of one axis, choice or setting, as JSON texts.
using Setting = std::vector<std::string>;

/// The outcomes that are one cell of a map: of one group, or of several that are averaged over.
using Cell = std::vector<const RunGroup*>;

struct Map {
  Setting setting;
  bool is_blocking = false;
  std::map<std::pair<std::string, std::string>, Cell> cells;  ///< by the values on the axes
  const RunGroup *reference = nullptr, *unblocked = nullptr;
  std::int64_t runs() const {
    std::int64_t sum = 0;
    for (const auto& [place, cell] : cells)
      for (const RunGroup* group : cell) sum += std::ssize(group->outcomes);
    return sum;
  }
};

struct Axis {
  std::string key, label;
  std::vector<std::string> values;
};

class SweepReport {
 public:
  explicit SweepReport(const std::filesystem::path& file) : file_(file), runs_(read_sweep_runs(file)) {}

  Json document() {
    notes_ = Json::array();
    find_varied_keys();
    find_parameters();
    if (is_blocking_sweep()) {
      make_blocking_maps();
    } else {
      make_general_maps();
    }
    choose_measures();
    write();
    return std::move(document_);
  }

 private:
  // ---- which keys vary

  void find_varied_keys() {
    std::map<std::string, std::set<std::string>> values;
    for (const RunGroup& group : runs_.groups)
      for (const auto& [key, value] : group.keys) values[key].insert(value);
    std::map<std::string, std::size_t> present;
    for (const RunGroup& group : runs_.groups)
      for (const auto& [key, value] : group.keys) ++present[key];
    // Keys that divide the groups alike are one.
    std::map<std::vector<std::size_t>, std::size_t> known;
    for (auto& [key, of_key] : values) {
      if (present[key] < runs_.groups.size()) of_key.insert(none);
      if (of_key.size() < 2) continue;
      varies_.insert(key);
      if (key.starts_with("blocking.")) continue;
      std::map<std::string, std::size_t> numbers;
      std::vector<std::size_t> division;
      for (const RunGroup& group : runs_.groups)
        division.push_back(numbers.try_emplace(value_of(group, key), numbers.size()).first->second);
      const auto [entry, is_new] = known.try_emplace(std::move(division), varied_.size());
      if (is_new) varied_.push_back({key, {}, {}});
      varied_[entry->second].all.push_back(key);
    }
    for (VariedKey& key : varied_) {
      // A name says more than what goes with it.
      for (const std::string& other : key.all)
        if (other.ends_with(".name") && !key.key.ends_with(".name")) key.key = other;
      key.values = sorted_values(key.key);
    }
  }

  std::vector<std::string> sorted_values(const std::string& key) const {
    std::map<std::string, std::int64_t> counts;
    for (const RunGroup& group : runs_.groups) counts[value_of(group, key)] += std::ssize(group.outcomes);
    std::vector<std::string> values;
    values.reserve(counts.size());
    for (const auto& [value, count] : counts) values.push_back(value);
    const bool numbers =
        std::all_of(values.begin(), values.end(), [](const std::string& v) { return number_in(v) || v == none; });
    // What has most runs is what the others are variations of.
    std::sort(values.begin(), values.end(), [&](const std::string& a, const std::string& b) {
      if (numbers || counts[a] == counts[b]) return comes_before(a, b);
      return counts[a] > counts[b];
    });
    return values;
  }

  void find_parameters() {
    for (const std::string& key : keys_of_all())
      if (key.starts_with("blocking.") && key.ends_with(".name"))
        parameters_.push_back(key.substr(9, key.size() - 9 - 5));
  }

  std::set<std::string> keys_of_all() const {
    std::set<std::string> keys;
    for (const RunGroup& group : runs_.groups)
      for (const auto& [key, value] : group.keys) keys.insert(key);
    return keys;
  }

  // ---- maps over block length and overlap

  /// Block length and overlap of what is blocked.
  struct Blocks {
    std::vector<std::string> parameters;
    std::string size, overlap;
  };

  std::optional<Blocks> blocks_of(const RunGroup& group) const {
    Blocks blocks;
    for (const std::string& parameter : parameters_) {
      const std::string prefix = "blocking." + parameter + ".";
      if (value_of(group, prefix + "name") != "\"structured\"") continue;
      const std::string& size = value_of(group, prefix + "size");
      const std::string overlap =
          value_of(group, prefix + "overlap") == none ? "0" : value_of(group, prefix + "overlap");
      if (!number_in(size) || !number_in(overlap)) return std::nullopt;
      if (!blocks.parameters.empty() && (size != blocks.size || overlap != blocks.overlap)) return std::nullopt;
      blocks.parameters.push_back(parameter);
      blocks.size = size;
      blocks.overlap = overlap;
    }
    if (blocks.parameters.empty()) return std::nullopt;
    return blocks;
  }

  bool is_blocking_sweep() const {
    std::set<std::string> sizes, overlaps;
    for (const RunGroup& group : runs_.groups)
      if (const auto blocks = blocks_of(group)) {
        sizes.insert(blocks->size);
        overlaps.insert(blocks->overlap);
      }
    return sizes.size() > 1 || overlaps.size() > 1;
  }

  /// All that varies, but for the blocking of some parameters.
  std::string rest_of(const RunGroup& group, const std::vector<std::string>& blocked) const {
    std::string text;
    for (const std::string& key : varies_) {
      const bool is_theirs = std::any_of(blocked.begin(), blocked.end(), [&](const std::string& parameter) {
        return key.starts_with("blocking." + parameter + ".");
      });
      if (!is_theirs) text += key + "=" + value_of(group, key) + "\n";
    }
    return text;
  }

  /// "kappa and mu, neighbour_sigma 0.04"
  std::string blocked_words(const RunGroup& group, const std::vector<std::string>& blocked) const {
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
      if (is_blocked && option != "name" && option != "size" && option != "overlap" && value != none)
        options.insert(option + " " + plain(value));
      if (!is_blocked && value != none && value != "\"full_horizon\"") others.insert(parameter + " " + plain(value));
    }
    for (const auto* list : {&options, &others})
      for (const std::string& text : *list) words += ", " + text;
    return words;
  }

  /// A JSON value as one says it.
  static std::string plain(const std::string& json) {
    const Json value = Json::parse(json, nullptr, false);
    return value.is_string() ? value.get<std::string>() : json;
  }

  void make_blocking_maps() {
    axes_ = {Axis{"size", "block length S", {}}, Axis{"overlap", "overlap o", {}}};
    for (const VariedKey& key : varied_) choice_keys_.push_back(key);
    // Where a parameter has one block, or one for every interval, by all else that varies.
    std::map<std::string, const RunGroup*> full, unblocked;
    const auto others_are = [&](const RunGroup& group, const std::vector<std::string>& blocked, const char* name) {
      return std::all_of(blocked.begin(), blocked.end(), [&](const std::string& parameter) {
        return value_of(group, "blocking." + parameter + ".name") == name;
      });
    };
    std::set<std::vector<std::string>> ways;
    for (const RunGroup& group : runs_.groups)
      if (const auto blocks = blocks_of(group)) ways.insert(blocks->parameters);
    const auto key_of = [&](const RunGroup& group, const std::vector<std::string>& blocked) {
      std::string key;
      for (const std::string& parameter : blocked) (key += parameter) += '\n';
      return key + rest_of(group, blocked);
    };
    const auto has_options = [&](const RunGroup& group, const std::vector<std::string>& blocked) {
      return std::any_of(group.keys.begin(), group.keys.end(), [&](const auto& entry) {
        return varies_.contains(entry.first) && !entry.first.ends_with(".name") &&
               std::any_of(blocked.begin(), blocked.end(), [&](const std::string& parameter) {
                 return entry.first.starts_with("blocking." + parameter + ".");
               });
      });
    };
    for (const RunGroup& group : runs_.groups)
      for (const std::vector<std::string>& way : ways) {
        if (others_are(group, way, "\"full_horizon\"")) full[key_of(group, way)] = &group;
        // Of several kinds without blocks, the plain one.
        if (others_are(group, way, "\"unblocked\"") && !has_options(group, way)) unblocked[key_of(group, way)] = &group;
      }
    std::map<std::string, Map> maps;
    std::map<std::string, std::int64_t> blocked;
    std::set<const RunGroup*> shown;
    for (const RunGroup& group : runs_.groups) {
      const auto blocks = blocks_of(group);
      if (!blocks) continue;
      shown.insert(&group);
      const std::string words = blocked_words(group, blocks->parameters), key = key_of(group, blocks->parameters);
      Map& map = maps[fmt::format("{}\n{}", words, key)];
      if (map.cells.empty()) {
        map.is_blocking = true;
        for (const VariedKey& choice : choice_keys_) map.setting.push_back(value_of(group, choice.key));
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
      return std::pair(-blocked[plain(a)], a) < std::pair(-blocked[plain(b)], b);
    });
    choice_keys_.push_back(std::move(choice));
    for (auto& [key, map] : maps) maps_.push_back(std::move(map));
    for (const RunGroup& group : runs_.groups)
      if (!shown.contains(&group)) others_.push_back(&group);
    if (std::any_of(maps_.begin(), maps_.end(), [](const Map& map) { return !map.reference; }))
      add_note(notes_, "pairs", "Some settings have no runs with full-horizon blocking to be held against.");
  }

  // ---- maps over any keys

  void make_general_maps() {
    std::vector<VariedKey> keys = varied_;
    for (const std::string& key : varies_)
      if (key.starts_with("blocking.")) keys.push_back({key, {key}, sorted_values(key)});
    if (keys.empty()) {
      add_note(notes_, "runs", "No key varies but the seed, so that there is one setting alone.");
      keys.push_back({"name", {"name"}, sorted_values("name")});
    }
    // Numbers make axes, those with most values first; where there are none, names do.
    std::stable_sort(keys.begin(), keys.end(), [](const VariedKey& a, const VariedKey& b) {
      return std::tuple(!a.is_numeric(), -std::ssize(a.values)) < std::tuple(!b.is_numeric(), -std::ssize(b.values));
    });
    const bool has_second = keys.size() > 1 && (keys[1].is_numeric() || keys.size() == 2);
    const std::size_t axes = has_second ? 2 : 1;
    for (std::size_t i = 0; i < axes; ++i) axes_.push_back({keys[i].key, keys[i].key, keys[i].values});
    std::size_t choices = 1;
    for (std::size_t i = axes; i < keys.size(); ++i) {
      if (choices * keys[i].values.size() > most_choices) {
        add_note(
            notes_, "settings",
            fmt::format("Means are also over the {} values of {}, since there are too many settings to choose from.",
                        keys[i].values.size(), keys[i].key));
        continue;
      }
      choices *= keys[i].values.size();
      choice_keys_.push_back(keys[i]);
    }
    std::map<Setting, Map> maps;
    for (const RunGroup& group : runs_.groups) {
      Setting setting;
      for (const VariedKey& choice : choice_keys_) setting.push_back(value_of(group, choice.key));
      Map& map = maps[setting];
      map.setting = setting;
      map.cells[{value_of(group, axes_[0].key), axes == 2 ? value_of(group, axes_[1].key) : none}].push_back(&group);
    }
    for (auto& [setting, map] : maps) maps_.push_back(std::move(map));
    add_note(notes_, "pairs",
             "The sweep does not vary block length and overlap, so there is nothing that settings are held "
             "against seed by seed.");
  }

  // ---- what there is room for

  /// Those with most runs first; among them those whose setting most runs of the sweep have.
  void sort_maps() {
    std::map<std::pair<std::size_t, std::string>, std::int64_t> counts;
    for (const Map& map : maps_)
      for (std::size_t i = 0; i < map.setting.size(); ++i) counts[{i, map.setting[i]}] += map.runs();
    std::vector<std::pair<std::pair<std::int64_t, std::int64_t>, std::size_t>> order;
    for (std::size_t m = 0; m < maps_.size(); ++m) {
      std::int64_t common = 0;
      for (std::size_t i = 0; i < maps_[m].setting.size(); ++i) common += counts[{i, maps_[m].setting[i]}];
      order.push_back({{-maps_[m].runs(), -common}, m});
    }
    std::sort(order.begin(), order.end());
    std::vector<Map> sorted;
    sorted.reserve(order.size());
    for (const auto& [rank, m] : order) sorted.push_back(std::move(maps_[m]));
    maps_ = std::move(sorted);
  }

  /// The places of measures that fit, most important first.
  void choose_measures() {
    sort_maps();
    std::vector<std::size_t> order(runs_.measures.size());
    for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
    std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
      return rank_of(runs_.measures[a]) < rank_of(runs_.measures[b]);
    });
    std::size_t used = 0, shown_maps = 0;
    std::vector<std::string> left_out;
    for (const std::size_t measure : order) {
      std::size_t bytes = 0;
      for (const Map& map : maps_) bytes += bytes_of(map, has_pairs(runs_.measures[measure]));
      if (used + bytes > most_bytes && !measures_.empty()) {
        left_out.push_back(runs_.measures[measure]);
        continue;
      }
      used += bytes;
      measures_.push_back(measure);
    }
    std::sort(measures_.begin(), measures_.end());
    if (!left_out.empty())
      add_note(notes_, "runs",
               fmt::format("Left out, since the page would become too large: {}.", fmt::join(left_out, ", ")));
    // A sweep over very many settings: those with most runs.
    used = 0;
    for (const Map& map : maps_) {
      for (const std::size_t measure : measures_) used += bytes_of(map, has_pairs(runs_.measures[measure]));
      if (used > most_bytes && shown_maps > 0) break;
      ++shown_maps;
    }
    if (shown_maps < maps_.size()) {
      add_note(notes_, "settings",
               fmt::format("{} of {} settings are shown, those with most runs, since the page would become too large.",
                           shown_maps, maps_.size()));
      maps_.resize(shown_maps);
    }
  }

  static int rank_of(const std::string& measure) {
    if (measure.starts_with("mae.")) return 0;
    if (measure == "rhe.median") return 1;
    if (measure == "rhe.p99") return 2;
    if (measure == "rhc.median") return 3;
    if (measure == "mae_after_start.heading") return 5;
    if (measure.starts_with("mae_after_start.")) return 4;
    return 6;
  }
  static bool has_pairs(const std::string& measure) { return measure.starts_with("mae.") || measure == "rhe.median"; }

  static std::pair<std::vector<std::string>, std::vector<std::string>> places_of(const Map& map) {
    std::set<std::string> first, second;
    for (const auto& [place, cell] : map.cells) {
      first.insert(place.first);
      second.insert(place.second);
    }
    std::vector<std::string> one(first.begin(), first.end()), other(second.begin(), second.end());
    std::sort(one.begin(), one.end(), comes_before);
    std::sort(other.begin(), other.end(), comes_before);
    return {std::move(one), std::move(other)};
  }

  static std::size_t bytes_of(const Map& map, bool pairs) {
    const auto [first, second] = places_of(map);
    const std::size_t cells = first.size() * second.size();
    const auto with_pairs =
        pairs && map.reference
            ? static_cast<std::size_t>(std::count_if(map.cells.begin(), map.cells.end(),
                                                     [&](const auto& entry) {
                                                       return entry.second.front()->outcomes.size() > 1 &&
                                                              map.reference->outcomes.size() > 1;
                                                     }))
            : std::size_t{0};
    return bytes_of_number * (cells + 3 * with_pairs);
  }

  // ---- the document

  void write() {
    const auto count = [&](const char* status) {
      const auto found = runs_.statuses.find(status);
      return found == runs_.statuses.end() ? std::int64_t{0} : found->second;
    };
    document_["kind"] = "sweep";
    document_["title"] = file_.stem().string();
    std::string subtitle = fmt::format("{} runs", counted(runs_.total));
    if (runs_.total > count("completed"))
      subtitle += fmt::format(", of which {} were completed", counted(count("completed")));
    document_["subtitle"] = subtitle;
    document_["runs"] = {{"total", runs_.total},
                         {"completed", count("completed")},
                         {"not_completed", count("not completed")},
                         {"refused", count("refused")},
                         {"failed", count("failed")}};
    document_["programs"] = runs_.programs;
    seeds();
    measures();
    choices();
    maps();
    others();
    add_note(notes_, "runs", "Means are over the runs that were completed; how many were not stands beside them.");
    document_["notes"] = std::move(notes_);
  }

  void seeds() {
    std::set<std::int64_t> seeds;
    for (const RunGroup& group : runs_.groups)
      for (const SeedOutcome& outcome : group.outcomes)
        if (outcome.seed) seeds.insert(*outcome.seed);
    document_["seeds"] = {{"count", seeds.size()},
                          {"least", seeds.empty() ? Json() : Json(*seeds.begin())},
                          {"most", seeds.empty() ? Json() : Json(*seeds.rbegin())}};
  }

  void measures() {
    Json& list = document_["measures"] = Json::array();
    for (const std::size_t measure : measures_) {
      const std::string& name = runs_.measures[measure];
      const std::size_t dot = name.find('.');
      const std::string group = name.substr(0, dot), rest = dot == std::string::npos ? "" : name.substr(dot + 1);
      const bool is_time = group == "rhe" || group == "rhc";
      const std::string unit = is_time                                    ? "us"
                               : rest == "position" || rest == "tracking" ? "m"
                               : rest == "heading"                        ? "rad"
                                                                          : "1";
      std::string label = "mean absolute error of " + rest;
      if (group == "mae_after_start") label += ", without the first samples";
      if (is_time)
        label = fmt::format("solve time of the {}, {}", group == "rhe" ? "estimator" : "controller",
                            rest == "p99" ? "99th percentile" : rest);
      if (group == "nees") label = "normalised estimation error squared";
      list.push_back({{"name", name},
                      {"label", label},
                      {"unit", unit},
                      {"group", is_time           ? "time"
                                : group == "nees" ? "other"
                                                  : group}});
    }
  }

  static std::string label_of(const std::string& key) {
    return key.ends_with(".name") ? key.substr(0, key.size() - 5) : key;
  }

  void choices() {
    Json& list = document_["choices"] = Json::array();
    std::string fixed;
    for (std::size_t i = 0; i < choice_keys_.size(); ++i) {
      const VariedKey& choice = choice_keys_[i];
      // Only what maps really have; the other runs are in the table.
      std::vector<std::string> values;
      for (const std::string& value : choice.values)
        if (std::any_of(maps_.begin(), maps_.end(), [&](const Map& map) { return map.setting[i] == value; }))
          values.push_back(value);
      shown_values_.push_back(values);
      if (values.size() < 2) {
        if (values.size() == 1)
          fixed += fmt::format("{}{}: {}", fixed.empty() ? "" : "; ", label_of(choice.key), plain(values.front()));
        continue;
      }
      shown_choices_.push_back(i);
      Json of_choice = Json::array();
      for (const std::string& value : values) of_choice.push_back(Json::parse(value));
      list.push_back({{"key", choice.key}, {"label", label_of(choice.key)}, {"values", std::move(of_choice)}});
    }
    if (!fixed.empty()) add_note(notes_, "settings", fmt::format("The same on all maps: {}.", fixed));
    for (const std::size_t i : shown_choices_)
      if (choice_keys_[i].all.size() > 1)
        add_note(notes_, "settings",
                 fmt::format("With {} go {}.", choice_keys_[i].key, fmt::join(companions(i), ", ")));
  }

  std::vector<std::string> companions(std::size_t choice) const {
    std::vector<std::string> others;
    for (const std::string& key : choice_keys_[choice].all)
      if (key != choice_keys_[choice].key) others.push_back(key);
    return others;
  }

  static const std::vector<double>* values_of(const SeedOutcome& outcome) {
    return outcome.values.empty() ? nullptr : &outcome.values;
  }
  static double value_at(const std::vector<double>& values, std::size_t measure) {
    return measure < values.size() ? values[measure] : std::numeric_limits<double>::quiet_NaN();
  }

  static Moments moments_of(const Cell& cell, std::size_t measure) {
    Moments moments;
    for (const RunGroup* group : cell)
      for (const SeedOutcome& outcome : group->outcomes)
        if (const auto* values = values_of(outcome))
          if (const double value = value_at(*values, measure); !std::isnan(value)) moments.add(value);
    return moments;
  }

  /// Of the seeds that were completed in both.
  static Moments differences_of(const RunGroup& group, const RunGroup& reference, std::size_t measure) {
    std::map<std::int64_t, double> known;
    for (const SeedOutcome& outcome : reference.outcomes)
      if (const auto* values = values_of(outcome); values && outcome.seed)
        known[*outcome.seed] = value_at(*values, measure);
    Moments moments;
    for (const SeedOutcome& outcome : group.outcomes) {
      const auto* values = values_of(outcome);
      const auto found = values && outcome.seed ? known.find(*outcome.seed) : known.end();
      if (found == known.end()) continue;
      if (const double difference = value_at(*values, measure) - found->second; !std::isnan(difference))
        moments.add(difference);
    }
    return moments;
  }

  static std::int64_t completed(const Cell& cell) {
    std::int64_t count = 0;
    for (const RunGroup* group : cell)
      count += std::count_if(group->outcomes.begin(), group->outcomes.end(),
                             [](const SeedOutcome& outcome) { return values_of(outcome) != nullptr; });
    return count;
  }
  static std::int64_t lost(const Cell& cell) {
    std::int64_t count = 0;
    for (const RunGroup* group : cell) count += std::ssize(group->outcomes);
    return count - completed(cell);
  }

  Json single(const RunGroup* group, const char* label) const {
    if (!group) return nullptr;
    const Cell cell = {group};
    Json means = Json::object();
    for (const std::size_t measure : measures_)
      means[runs_.measures[measure]] = seen(moments_of(cell, measure).mean(), digits + 2);
    return {{"label", label}, {"runs", completed(cell)}, {"lost", lost(cell)}, {"means", std::move(means)}};
  }

  Json axis_of(std::size_t axis, const std::vector<std::string>& values) const {
    if (axis >= axes_.size()) return nullptr;
    Json list = Json::array();
    for (const std::string& value : values) list.push_back(Json::parse(value));
    return {{"key", axes_[axis].key}, {"label", label_of(axes_[axis].label)}, {"values", std::move(list)}};
  }

  Json map_of(const Map& map) const {
    const auto places = places_of(map);
    const std::vector<std::string>&first = places.first, &second = places.second;
    const auto table = [&](const auto& value_of_cell) {
      Json rows = Json::array();
      for (const std::string& one : first) {
        Json row = Json::array();
        for (const std::string& other : second) {
          const auto found = map.cells.find({one, other});
          row.push_back(value_of_cell(found == map.cells.end() ? Cell{} : found->second));
        }
        rows.push_back(std::move(row));
      }
      return rows;
    };
    Json json;
    Json& setting = json["setting"] = Json::array();
    for (const std::size_t choice : shown_choices_) {
      const std::vector<std::string>& values = shown_values_[choice];
      setting.push_back(std::find(values.begin(), values.end(), map.setting[choice]) - values.begin());
    }
    json["axes"] = {axis_of(0, first), axis_of(1, second)};
    json["is_blocking"] = map.is_blocking;
    json["runs"] = table([](const Cell& cell) { return completed(cell); });
    json["lost"] = table([](const Cell& cell) { return lost(cell); });
    json["means"] = Json::object();
    for (const std::size_t measure : measures_)
      json["means"][runs_.measures[measure]] =
          table([&](const Cell& cell) { return seen(moments_of(cell, measure).mean(), digits); });
    json["reference"] = single(map.reference, "full-horizon blocking");
    json["unblocked"] = single(map.unblocked, "a value for every interval");
    json["pairs"] = pairs_of(map, table);
    return json;
  }

  /// A row of nothing but nulls is as good as an empty one, and large maps have many.
  static Json without_empty_rows(Json rows) {
    for (Json& row : rows)
      if (std::all_of(row.begin(), row.end(), [](const Json& value) { return value.is_null(); })) row = Json::array();
    return rows;
  }

  template <class Table>
  Json pairs_of(const Map& map, const Table& table) const {
    if (!map.reference) return nullptr;
    const std::size_t any = measures_.front();
    StudentQuantiles quantiles;
    const auto pairs = [&](const Cell& cell, std::size_t measure) {
      return cell.size() == 1 ? differences_of(*cell.front(), *map.reference, measure) : Moments();
    };
    const bool has_some = std::any_of(map.cells.begin(), map.cells.end(),
                                      [&](const auto& entry) { return pairs(entry.second, any).count() > 1; });
    if (!has_some) return nullptr;
    Json json;
    json["count"] = table([&](const Cell& cell) { return pairs(cell, any).count(); });
    for (const std::size_t measure : measures_) {
      const std::string& name = runs_.measures[measure];
      if (!has_pairs(name)) continue;
      json["difference"][name] = without_empty_rows(table([&](const Cell& cell) {
        const Moments moments = pairs(cell, measure);
        return moments.count() > 1 ? seen(moments.mean(), digits - 1) : Json();
      }));
      json["half_width"][name] = without_empty_rows(
          table([&](const Cell& cell) { return seen(pairs(cell, measure).half_width(quantiles), digits - 1); }));
    }
    return json;
  }

  void maps() {
    Json& list = document_["maps"] = Json::array();
    for (const Map& map : maps_) list.push_back(map_of(map));
  }

  void others() {
    document_["others"] = nullptr;
    if (others_.empty()) return;
    std::vector<std::string> keys;
    for (const VariedKey& key : varied_) keys.push_back(key.key);
    for (const std::string& key : varies_)
      if (key.starts_with("blocking.")) keys.push_back(key);
    // Those that differ among the rows.
    std::erase_if(keys, [&](const std::string& key) {
      return std::all_of(others_.begin(), others_.end(), [&](const RunGroup* group) {
        return value_of(*group, key) == value_of(*others_.front(), key);
      });
    });
    Json rows = Json::array();
    for (std::size_t i = 0; i < std::min(others_.size(), most_others); ++i) {
      Json values = Json::array(), means = Json::object();
      for (const std::string& key : keys) values.push_back(Json::parse(value_of(*others_[i], key)));
      const Cell cell = {others_[i]};
      for (const std::size_t measure : measures_)
        means[runs_.measures[measure]] = seen(moments_of(cell, measure).mean(), digits);
      rows.push_back({{"values", std::move(values)},
                      {"runs", completed(cell)},
                      {"lost", lost(cell)},
                      {"means", std::move(means)}});
    }
    if (others_.size() > most_others)
      add_note(notes_, "settings",
               fmt::format("Of {} further settings {} are in the table.", counted(std::ssize(others_)), most_others));
    document_["others"] = {{"keys", keys}, {"rows", std::move(rows)}, {"total", others_.size()}};
  }

  std::filesystem::path file_;
  SweepRuns runs_;
  std::set<std::string> varies_;
  std::vector<VariedKey> varied_;  ///< without the blocking's
  std::vector<std::string> parameters_;
  std::vector<Axis> axes_;
  std::vector<VariedKey> choice_keys_;
  std::vector<std::vector<std::string>> shown_values_;  ///< of each choice key
  std::vector<std::size_t> shown_choices_;              ///< of them, those that maps differ in
  std::vector<Map> maps_;
  std::vector<const RunGroup*> others_;
  std::vector<std::size_t> measures_;
  Json document_, notes_;
};

}  // namespace

Json sweep_report(const std::filesystem::path& file) { return SweepReport(file).document(); }

}  // namespace rhec::sim
