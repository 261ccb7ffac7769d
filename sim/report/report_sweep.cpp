#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <utility>

#include "report_parts.hpp"
#include "rhec/core/base/error.hpp"
#include "rhec/sim/numbers/statistics.hpp"
#include "sweep_maps.hpp"

namespace rhec::sim {
namespace {

// Limits of a page.
constexpr std::size_t most_bytes = 3'200'000;
constexpr std::size_t most_others = 200;
constexpr int digits = 5;
constexpr std::size_t bytes_of_number = 8;

class SweepReport {
 public:
  explicit SweepReport(const std::filesystem::path& file)
      : file_(file), runs_(read_sweep_runs(file)), settings_(runs_.groups) {}

  Json document() {
    notes_ = Json::array();
    made_ = (settings_.is_of_blocking() ? blocking_maps : general_maps)(runs_.groups, settings_, notes_);
    choose_measures();
    write();
    return std::move(document_);
  }

 private:
  // ---- selection of what fits on a page

  /// Maps with most runs first; ties are broken by how many runs of the sweep have their setting.
  void sort_maps() {
    std::map<std::pair<std::size_t, std::string>, std::int64_t> counts;
    for (const SweepMap& map : made_.maps)
      for (std::size_t i = 0; i < map.setting.size(); ++i) counts[{i, map.setting[i]}] += map.runs();
    std::vector<std::pair<std::pair<std::int64_t, std::int64_t>, std::size_t>> order;
    for (std::size_t m = 0; m < made_.maps.size(); ++m) {
      std::int64_t common = 0;
      for (std::size_t i = 0; i < made_.maps[m].setting.size(); ++i) common += counts[{i, made_.maps[m].setting[i]}];
      order.push_back({{-made_.maps[m].runs(), -common}, m});
    }
    std::sort(order.begin(), order.end());
    std::vector<SweepMap> sorted;
    sorted.reserve(order.size());
    for (const auto& [rank, m] : order) sorted.push_back(std::move(made_.maps[m]));
    made_.maps = std::move(sorted);
  }

  /// Indices of the measures that fit, most important first.
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
      for (const SweepMap& map : made_.maps) bytes += bytes_of(map, has_pairs(runs_.measures[measure]));
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
    // If a sweep has very many settings, those with most runs.
    used = 0;
    for (const SweepMap& map : made_.maps) {
      for (const std::size_t measure : measures_) used += bytes_of(map, has_pairs(runs_.measures[measure]));
      if (used > most_bytes && shown_maps > 0) break;
      ++shown_maps;
    }
    if (shown_maps < made_.maps.size()) {
      add_note(notes_, "settings",
               fmt::format("{} of {} settings are shown, those with most runs, since the page would become too large.",
                           shown_maps, made_.maps.size()));
      made_.maps.resize(shown_maps);
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

  static std::pair<std::vector<std::string>, std::vector<std::string>> places_of(const SweepMap& map) {
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

  static std::size_t bytes_of(const SweepMap& map, bool pairs) {
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
    for (std::size_t i = 0; i < made_.choice_keys.size(); ++i) {
      const VariedKey& choice = made_.choice_keys[i];
      // Only values that occur in maps; the other runs are in the table.
      std::vector<std::string> values;
      for (const std::string& value : choice.values)
        if (std::any_of(made_.maps.begin(), made_.maps.end(),
                        [&](const SweepMap& map) { return map.setting[i] == value; }))
          values.push_back(value);
      shown_values_.push_back(values);
      if (values.size() < 2) {
        if (values.size() == 1)
          fixed += fmt::format("{}{}: {}", fixed.empty() ? "" : "; ", label_of(choice.key), plain_text(values.front()));
        continue;
      }
      shown_choices_.push_back(i);
      Json of_choice = Json::array();
      for (const std::string& value : values) of_choice.push_back(Json::parse(value));
      list.push_back({{"key", choice.key}, {"label", label_of(choice.key)}, {"values", std::move(of_choice)}});
    }
    if (!fixed.empty()) add_note(notes_, "settings", fmt::format("The same on all maps: {}.", fixed));
    for (const std::size_t i : shown_choices_)
      if (made_.choice_keys[i].all.size() > 1)
        add_note(notes_, "settings",
                 fmt::format("With {} go {}.", made_.choice_keys[i].key, fmt::join(companions(i), ", ")));
  }

  std::vector<std::string> companions(std::size_t choice) const {
    std::vector<std::string> others;
    for (const std::string& key : made_.choice_keys[choice].all)
      if (key != made_.choice_keys[choice].key) others.push_back(key);
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

  /// Over the seeds completed in both.
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
    if (axis >= made_.axes.size()) return nullptr;
    Json list = Json::array();
    for (const std::string& value : values) list.push_back(Json::parse(value));
    return {{"key", made_.axes[axis].key}, {"label", label_of(made_.axes[axis].label)}, {"values", std::move(list)}};
  }

  Json map_of(const SweepMap& map) const {
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

  /// Replaces all-null rows by empty ones; large maps have many.
  static Json without_empty_rows(Json rows) {
    for (Json& row : rows)
      if (std::all_of(row.begin(), row.end(), [](const Json& value) { return value.is_null(); })) row = Json::array();
    return rows;
  }

  template <class Table>
  Json pairs_of(const SweepMap& map, const Table& table) const {
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
    for (const SweepMap& map : made_.maps) list.push_back(map_of(map));
  }

  void others() {
    document_["others"] = nullptr;
    if (made_.others.empty()) return;
    std::vector<std::string> keys;
    for (const VariedKey& key : settings_.varied()) keys.push_back(key.key);
    for (const std::string& key : settings_.varies())
      if (key.starts_with("blocking.")) keys.push_back(key);
    // Keys that differ among the rows.
    std::erase_if(keys, [&](const std::string& key) {
      return std::all_of(made_.others.begin(), made_.others.end(), [&](const RunGroup* group) {
        return value_of(*group, key) == value_of(*made_.others.front(), key);
      });
    });
    Json rows = Json::array();
    for (std::size_t i = 0; i < std::min(made_.others.size(), most_others); ++i) {
      Json values = Json::array(), means = Json::object();
      for (const std::string& key : keys) values.push_back(Json::parse(value_of(*made_.others[i], key)));
      const Cell cell = {made_.others[i]};
      for (const std::size_t measure : measures_)
        means[runs_.measures[measure]] = seen(moments_of(cell, measure).mean(), digits);
      rows.push_back({{"values", std::move(values)},
                      {"runs", completed(cell)},
                      {"lost", lost(cell)},
                      {"means", std::move(means)}});
    }
    if (made_.others.size() > most_others)
      add_note(
          notes_, "settings",
          fmt::format("Of {} further settings {} are in the table.", counted(std::ssize(made_.others)), most_others));
    document_["others"] = {{"keys", keys}, {"rows", std::move(rows)}, {"total", made_.others.size()}};
  }

  std::filesystem::path file_;
  SweepRuns runs_;
  SweepSettings settings_;
  SweepMaps made_;
  std::vector<std::vector<std::string>> shown_values_;  ///< per choice key
  std::vector<std::size_t> shown_choices_;              ///< indices of those in which maps differ
  std::vector<std::size_t> measures_;
  Json document_, notes_;
};

}  // namespace

Json sweep_report(const std::filesystem::path& file) { return SweepReport(file).document(); }

}  // namespace rhec::sim
