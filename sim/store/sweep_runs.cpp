#include "rhec/sim/store/sweep_runs.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <unordered_map>
#include <utility>

#include "rhec/core/base/error.hpp"
#include "rhec/sim/files/json.hpp"
#include "rhec/sim/store/sweep_store.hpp"
#include "sqlite_database.hpp"

namespace rhec::sim {
namespace {

constexpr int patience = 60000;  // for a sweep that is writing [ms]

/// A configuration without its top-level key `seed`, by which runs are paired. The text is canonical: no blanks, keys
/// sorted and unique.
std::string without_seed(const std::string& text) {
  constexpr std::string_view key = "\"seed\":";
  int depth = 0;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (c == '"') {
      if (depth == 1 && text.compare(i, key.size(), key) == 0) {
        std::size_t end = text.find_first_of(",}", i);
        if (end == std::string::npos) return text;
        std::size_t first = i;
        if (text[end] == ',') {
          ++end;
        } else if (text[i - 1] == ',') {
          --first;
        }
        return text.substr(0, first) + text.substr(end);
      }
      for (++i; i < text.size() && text[i] != '"'; ++i) i += text[i] == '\\';
    } else {
      depth += (c == '{' || c == '[') - (c == '}' || c == ']');
    }
  }
  return text;
}

void flatten(const Json& json, const std::string& prefix, std::map<std::string, std::string>& keys) {
  for (const auto& [key, value] : json.items()) {
    const std::string path = prefix.empty() ? key : fmt::format("{}.{}", prefix, key);
    if (value.is_object() && !value.empty()) {
      flatten(value, path, keys);
    } else {
      keys[path] = value.dump();
    }
  }
}

class Measures {
 public:
  explicit Measures(std::vector<std::string>& names) : names_(names) {}
  void put(const std::string& name, const Json& value, std::vector<double>& values) {
    const auto [entry, is_new] = places_.try_emplace(name, names_.size());
    if (is_new) names_.push_back(name);
    if (values.size() <= entry->second) values.resize(entry->second + 1, std::numeric_limits<double>::quiet_NaN());
    if (value.is_number()) values[entry->second] = value.get<double>();
  }

 private:
  std::vector<std::string>& names_;
  std::unordered_map<std::string, std::size_t> places_;
};

void require_sweep(SqliteDatabase& database) {
  const std::int64_t application = database.number("PRAGMA application_id"),
                     version = database.number("PRAGMA user_version");
  if (application != SweepStore::application_id)
    throw Error(fmt::format("{}: is a database, but not one of rhec's sweeps; expected one that 'rhec sweep' made",
                            database.file().string()));
  if (version != SweepStore::version)
    throw Error(
        fmt::format("{}: has version {} of the schema, and this program reads version {}; use the program that "
                    "made it, or make the sweep again with 'rhec sweep'",
                    database.file().string(), version, SweepStore::version));
  database.require_whole();
  database.require_tables({"runs"});
}

}  // namespace

SweepRuns read_sweep_runs(const std::filesystem::path& file) {
  SqliteDatabase database(file, SqliteDatabase::Access::read);
  database.set_patience(patience);
  require_sweep(database);
  SweepRuns runs;
  Measures measures(runs.measures);
  std::unordered_map<std::string, std::size_t> known;
  std::map<std::string, std::int64_t> programs;
  SqliteStatement select = database.prepare(
      "SELECT identity, configuration, seed, status, mae, mae_after_start, solve_time_us, nees, program FROM runs");
  while (select.step()) {
    ++runs.total;
    const std::string status = select.text(3);
    ++runs.statuses[status];
    ++programs[select.text(8)];
    const auto [entry, is_new] = known.try_emplace(without_seed(select.text(1)), runs.groups.size());
    const auto parsed = [&](int column, const char* name) {
      std::optional<Json> json = Json::parse_if_valid(select.text(column));
      if (json && json->is_object()) return std::move(*json);
      throw Error(fmt::format("{}: run {}: {} is no map of JSON; delete the run and start the sweep again",
                              file.string(), select.text(0), name));
    };
    if (is_new) {
      RunGroup& group = runs.groups.emplace_back();
      Json configuration = parsed(1, "configuration");
      configuration.erase("seed");
      flatten(configuration, "", group.keys);
    }
    SeedOutcome outcome;
    if (!select.is_null(2)) outcome.seed = select.integer(2);
    if (status == "completed") {
      const Json times = parsed(6, "solve_time_us"), errors = parsed(4, "mae"), later = parsed(5, "mae_after_start");
      for (const auto& [name, value] : errors.items()) measures.put("mae." + name, value, outcome.values);
      for (const char* who : {"rhe", "rhc"})
        for (const char* number : {"median", "p99"})
          if (times.contains(who))
            measures.put(fmt::format("{}.{}", who, number), times.at(who).value(number, Json()), outcome.values);
      for (const auto& [name, value] : later.items()) measures.put("mae_after_start." + name, value, outcome.values);
      measures.put("nees", select.is_null(7) ? Json() : Json(select.number(7)), outcome.values);
    }
    runs.groups[entry->second].outcomes.push_back(std::move(outcome));
  }
  if (runs.total == 0)
    throw Error(fmt::format("{}: has no runs yet; start 'rhec sweep' with it, and come back", file.string()));
  for (const auto& [program, count] : programs) runs.programs.push_back(program);
  return runs;
}

}  // namespace rhec::sim
