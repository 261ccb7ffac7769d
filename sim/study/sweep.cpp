#include "rhec/sim/study/sweep.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <optional>

#include "rhec/core/base/error.hpp"
#include "rhec/core/config/options.hpp"
#include "rhec/plugins/robot/scenario_file.hpp"
#include "rhec/plugins/yaml/yaml.hpp"

namespace rhec::sim {
namespace {

struct Description {
  std::string name = "sweep", scenario;
  Settings set, grid;

  static const OptionTable<Description>& table() {
    static const auto rows =
        OptionTable<Description>()
            .text("name", &Description::name, "of the sweep, for titles")
            .text("scenario", &Description::scenario, "file of the scenario that all is put over, beside this one")
            .subtree("set", &Description::set, "keys of the scenario that are the same for all runs")
            .subtree("grid", &Description::grid,
                     "keys of the scenario with their values; one block of them, or a list");
    return rows;
  }
};

constexpr const char* scenario_key = "scenario";
constexpr const char* zip_key = "zip";
constexpr double most_runs = 1e15;
constexpr const char* forms_of_values =
    "a list of values, or a range {from, to, step} or {from, to, count}; a key within a section has dots, e.g. "
    "estimator.horizon";

/// A finite number with all digits of its text.
long double precise_number(const Settings& from) {
  const std::optional<double> value = from.number();
  if (!value || !std::isfinite(*value)) throw from.mismatch("a finite number");
  return std::strtold(from.text().c_str(), nullptr);
}

const Settings& required(const Settings& range, std::string_view key) {
  if (const Settings* found = range.find(key)) return *found;
  throw range.error(fmt::format("a range without '{}'; expected {{from, to, step}} or {{from, to, count}}", key));
}

bool is_within(const std::string& inner, const std::string& outer) {
  return inner.size() > outer.size() && inner.starts_with(outer) && inner[outer.size()] == '.';
}

/// Throws if `key`, which is set after `others`, overrides one of them.
void require_independent(const std::string& key, const std::vector<std::string>& others, const Settings& at) {
  for (const std::string& other : others) {
    if (other == key) throw at.error(fmt::format("'{}' is given values twice in one block; keep one of them", key));
    if (is_within(other, key))
      throw at.error(fmt::format(
          "'{}' replaces the whole section, and with it '{}', which is written before it; write it first", key, other));
  }
}

std::string text_of(const Settings& value) {
  return value.kind() == Settings::Kind::scalar ? value.text() : canonical_text(value);
}

}  // namespace

Sweep Sweep::from_file(const std::filesystem::path& file) { return Sweep(load_yaml(file)); }

namespace {

/// A scenario says what it is, too.
void refuse_scenario(const Settings& description) {
  if (description.kind() != Settings::Kind::map) return;
  for (const char* key : {"robot", "model", "path", "speed", "terrain", "log", "signals"})
    if (const Settings* found = description.find(key))
      throw found->error(
          "is that of a scenario: this file is for 'rhec run' or 'rhec estimate'; a sweep names it, 'scenario: FILE', "
          "and changes keys in its 'set' and 'grid'");
}

}  // namespace

Sweep::Sweep(const Settings& description) {
  refuse_scenario(description);
  const Description read = Description::table().parse(description, "sweep");
  name_ = read.name;
  folder_ = std::filesystem::path(description.origin().file).parent_path();
  if (!read.set.is_null() && read.set.kind() != Settings::Kind::map)
    throw read.set.mismatch("a map of keys and values, e.g. {path.laps: 1}");
  set_ = read.set;
  if (const Settings* written = description.find(scenario_key)) {
    Values one;
    one.listed.push_back(*written);
    read_scenarios(one);
    scenario_ = read.scenario;
  } else {
    Settings base = Settings::map(description.origin());
    for (const auto& [key, value] : set_.members()) base.set(key, value);
    bases_.emplace("", std::move(base));
  }
  if (read.grid.kind() == Settings::Kind::list) {
    for (const Settings& block : read.grid.items()) read_block(block);
  } else if (read.grid.kind() == Settings::Kind::map) {
    read_block(read.grid);
  }
  if (blocks_.empty())
    throw(description.find("grid") ? read.grid : description)
        .error("the grid is empty; expected 'grid:' with keys and their values, e.g. grid: {speed: [2, 4]}");
  std::string texts = canonical_text(description);
  for (const auto& [scenario, base] : bases_) texts += scenario + canonical_text(base);
  fingerprint_ = identity_of(texts);
}

void Sweep::read_scenarios(const Values& values) {
  for (const Settings& named : values.listed) {
    const std::filesystem::path file = folder_ / named.as_text();
    if (!std::filesystem::exists(file))
      throw named.error(
          fmt::format("found '{}', expected the file of a scenario; there is no {}", named.text(), file.string()));
    if (bases_.contains(named.text())) continue;
    Settings base = load_scenario(file);
    if (base.kind() != Settings::Kind::map) throw base.mismatch("a scenario, which is a map of keys and values");
    for (const auto& [key, value] : set_.members()) base.set(key, value);
    bases_.emplace(named.text(), std::move(base));
  }
}

// ---- parsing a grid

std::int64_t Sweep::range_count(const Settings& from) {
  const Settings *step = from.find("step"), *count = from.find("count");
  if (step && count) throw from.error("a range with both step and count; keep one of them");
  const long double first = precise_number(required(from, "from")), last = precise_number(required(from, "to"));
  if (count) {
    const int points = count->as_integer();
    if (points < (first == last ? 1 : 2) || (first == last && points > 1))
      throw count->error(fmt::format("a range from {} to {} has {} values; expected {}", from.find("from")->text(),
                                     from.find("to")->text(), points, first == last ? "1" : "2 or more"));
    return points;
  }
  const long double size = step ? precise_number(*step) : 1.0L;
  const Settings& at = step ? *step : from;
  if (size == 0.0L) throw at.error("a step of 0 leads nowhere; expected another number");
  const long double steps = (last - first) / size;
  const auto written = [&] {
    return fmt::format("from {} to {} in steps of {}", from.find("from")->text(), from.find("to")->text(),
                       step ? step->text() : "1");
  };
  if (steps < 0.0L) throw at.error(fmt::format("a range {} is empty; expected a step that leads there", written()));
  if (!(steps < most_runs)) throw at.error(fmt::format("a range {} has more than {:g} values", written(), most_runs));
  if (std::abs(steps - std::round(steps)) > 1e-9L * std::max(1.0L, steps))
    throw at.error(fmt::format("a range {} does not end at {}; expected a step that does, or a count", written(),
                               from.find("to")->text()));
  return static_cast<std::int64_t>(std::llround(steps)) + 1;
}

Sweep::Values Sweep::read_range(const Settings& from) {
  for (const auto& [key, value] : from.members())
    if (key != "from" && key != "to" && key != "step" && key != "count")
      throw value.error(fmt::format("a range has no key '{}'; expected {}", key, forms_of_values));
  Values values;
  values.count = range_count(from);
  values.from = precise_number(*from.find("from"));
  values.to = precise_number(*from.find("to"));
  values.origin = from.origin();
  return values;
}

Sweep::Values Sweep::read_values(const Settings& from) {
  if (from.kind() == Settings::Kind::map && !from.members().empty()) return read_range(from);
  if (from.kind() != Settings::Kind::list) throw from.mismatch(forms_of_values);
  if (from.items().empty()) throw from.error("the list is empty, and so is the grid; expected at least one value");
  Values values;
  values.listed = from.items();
  values.count = std::ssize(values.listed);
  return values;
}

Sweep::Axis Sweep::read_zip(const Settings& from) const {
  if (from.kind() != Settings::Kind::map || from.members().size() < 2)
    throw from.mismatch("a map of two or more keys whose values vary together, or a list of such maps");
  Axis axis;
  for (const auto& [key, written] : from.members()) {
    Values values = read_values(written);
    if (!axis.keys.empty() && values.count != axis.count)
      throw written.error(fmt::format("has {} values and '{}' has {}; expected as many, since they vary together",
                                      values.count, axis.keys.front(), axis.count));
    require_independent(key, axis.keys, written);
    axis.count = values.count;
    axis.keys.push_back(key);
    axis.values.push_back(std::move(values));
  }
  return axis;
}

void Sweep::add_axis(Block& block, Axis axis, const Settings& at) const {
  for (const std::string& key : axis.keys)
    for (const Axis& other : block.axes) require_independent(key, other.keys, at);
  if (static_cast<double>(block.count) * static_cast<double>(axis.count) > most_runs)
    throw at.error(fmt::format("with this key the grid has more than {:g} runs; make it smaller", most_runs));
  block.count *= axis.count;
  block.axes.push_back(std::move(axis));
}

void Sweep::read_block(const Settings& from) {
  if (from.kind() != Settings::Kind::map) throw from.mismatch("a block of a grid: a map of keys and their values");
  if (from.members().empty()) throw from.error("the block is empty; expected keys and their values");
  Block block;
  block.first = count_;
  block.count = 1;
  for (const auto& [key, written] : from.members()) {
    if (key != zip_key) {
      Values values = read_values(written);
      const std::int64_t count = values.count;
      add_axis(block, {{key}, {std::move(values)}, count}, written);
    } else if (written.kind() == Settings::Kind::list) {
      for (const Settings& group : written.items()) add_axis(block, read_zip(group), group);
    } else {
      add_axis(block, read_zip(written), written);
    }
  }
  bool names_scenario = false;
  for (const Axis& axis : block.axes)
    for (std::size_t k = 0; k < axis.keys.size(); ++k) {
      if (axis.keys[k] != scenario_key) continue;
      if (axis.values[k].listed.empty()) throw from.error("'scenario' has a range; expected a list of files");
      read_scenarios(axis.values[k]);
      names_scenario = true;
    }
  // Without a scenario the keys must define one; checking the values verifies this.
  if (!names_scenario) base_of(scenario_);
  count_ += block.count;
  if (static_cast<double>(count_) > most_runs)
    throw from.error(fmt::format("with this block the grid has more than {:g} runs; make it smaller", most_runs));
  blocks_.push_back(std::move(block));
}

// ---- runs

Settings Sweep::Values::at(std::int64_t index) const {
  if (!listed.empty()) return listed[static_cast<std::size_t>(index)];
  // Extended precision, so that the result is the double one would have typed: 0.3, not 0.1 + 0.2.
  const long double share = count > 1 ? static_cast<long double>(index) / static_cast<long double>(count - 1) : 0.0L;
  const long double value = index == count - 1 ? to : from + (to - from) * share;
  return Settings::scalar(fmt::format("{}", static_cast<double>(value)), origin);
}

const Settings& Sweep::base_of(const std::string& scenario) const { return bases_.at(scenario); }

std::pair<const Sweep::Block*, Sweep::Indices> Sweep::place_of(std::int64_t run) const {
  if (run < 0 || run >= count_) throw Error(fmt::format("sweep '{}': there is no run {} of {}", name_, run, count_));
  const auto after =
      std::upper_bound(blocks_.begin(), blocks_.end(), run, [](std::int64_t r, const Block& b) { return r < b.first; });
  const Block& block = *std::prev(after);
  std::int64_t rest = run - block.first;
  Indices indices(block.axes.size());
  for (std::size_t a = block.axes.size(); a-- > 0;) {
    indices[a] = rest % block.axes[a].count;
    rest /= block.axes[a].count;
  }
  return {&block, std::move(indices)};
}

Settings Sweep::settings_of(const Block& block, const Indices& indices) const {
  const std::string* scenario = &scenario_;
  for (std::size_t a = 0; a < indices.size(); ++a)
    for (std::size_t k = 0; k < block.axes[a].keys.size(); ++k)
      if (block.axes[a].keys[k] == scenario_key)
        scenario = &block.axes[a].values[k].listed[static_cast<std::size_t>(indices[a])].text();
  Settings settings = base_of(*scenario);
  for (std::size_t a = 0; a < indices.size(); ++a)
    for (std::size_t k = 0; k < block.axes[a].keys.size(); ++k)
      if (block.axes[a].keys[k] != scenario_key)
        settings.set(block.axes[a].keys[k], block.axes[a].values[k].at(indices[a]));
  return settings;
}

Settings Sweep::settings(std::int64_t run) const {
  const auto [block, indices] = place_of(run);
  return settings_of(*block, indices);
}

std::string Sweep::assignments(std::int64_t run) const {
  const auto [block, indices] = place_of(run);
  std::string text;
  for (std::size_t a = 0; a < indices.size(); ++a)
    for (std::size_t k = 0; k < block->axes[a].keys.size(); ++k)
      text += fmt::format("{}{}={}", text.empty() ? "" : ", ", block->axes[a].keys[k],
                          text_of(block->axes[a].values[k].at(indices[a])));
  return text;
}

}  // namespace rhec::sim
