#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "rhec/sim/figures/svg.hpp"
#include "rhec/sim/files/json.hpp"
#include "rhec/sim/tuning/innovations.hpp"
#include "rhec/sim/tuning/log_tuning.hpp"

#include "scenario_text.hpp"

namespace rhec::sim {
namespace {

Json interval_json(const std::pair<double, double>& interval) {
  return Json(std::vector<double>{interval.first, interval.second});
}

// Sizes of the drawing [pixels].
constexpr double page_width = 1080.0, margin = 20.0, panel_height = 170.0, gap = 46.0, head = 64.0;
constexpr int columns = 4;
constexpr const char* panel_text = R"(font-size="11" fill="#5f6368")";
constexpr const char* head_text = R"(font-size="12" font-weight="bold" fill="#222")";

// A log likelihood this far below its maximum is the lower end of a panel, or farther where the likelihood is rough.
constexpr double least_depth = 8.0;

/// So deep that half of a slice's points are seen.
double depth_of(const TunedNumber& number) {
  std::vector<double> drops;
  for (const auto& [value, drop] : number.slice) drops.push_back(-drop);
  std::sort(drops.begin(), drops.end());
  return drops.empty() ? least_depth : std::max(least_depth, 1.2 * drops[drops.size() / 2]);
}

void draw_slice(Svg& svg, const TunedNumber& number, Point corner, double panel_width) {
  const double deepest = depth_of(number);
  const double left = corner.x, top = corner.y, bottom = top + panel_height;
  double lower = number.value, upper = number.value;
  for (const auto& [value, drop] : number.slice) {
    if (drop < -deepest) continue;
    lower = std::min(lower, value);
    upper = std::max(upper, value);
  }
  const bool shows_error = std::isfinite(number.error) && number.is_told && !number.is_at_bound;
  if (shows_error) {
    lower = std::min(lower, std::max(number.value - 2.0 * number.error, number.tunable.lower));
    upper = std::max(upper, std::min(number.value + 2.0 * number.error, number.tunable.upper));
  }
  if (!(upper > lower)) upper = lower + 1.0, lower -= 1.0;
  const double pad = 0.05 * (upper - lower);
  lower -= pad, upper += pad;
  const auto x = [&](double value) { return left + (value - lower) / (upper - lower) * panel_width; };
  const auto y = [&](double drop) { return top + 8.0 - drop / deepest * (panel_height - 8.0); };

  svg.text({left, top - 20.0}, number.tunable.name, head_text);
  std::string line = fmt::format("{:.4g}", number.value);
  if (shows_error) line += fmt::format(" +- {:.2g}", number.error);
  if (!number.tunable.unit.empty()) line += " " + number.tunable.unit;
  line += fmt::format(", was {:.4g}", number.tunable.start);
  if (deepest > least_depth) line += fmt::format("; height {:.0f}", deepest);
  if (!number.is_told) line += "; not told";
  if (number.is_at_bound) line += "; at its bound";
  svg.text({left, top - 6.0}, line, panel_text);
  svg.begin_clip({left, top}, panel_width, panel_height);
  if (shows_error)
    svg.rectangle({x(number.value - number.error), top},
                  x(number.value + number.error) - x(number.value - number.error), panel_height, R"(fill="#eceff3")");
  svg.line({x(number.tunable.start), top}, {x(number.tunable.start), bottom},
           R"(stroke="#7a8088" stroke-dasharray="4 3")");
  svg.line({x(number.value), top}, {x(number.value), bottom}, R"(stroke="#d1341f" stroke-width="1")");
  std::vector<Point> curve;
  for (const auto& [value, drop] : number.slice) curve.push_back({x(value), y(drop)});
  svg.polyline(curve, R"(stroke="#2563c4" stroke-width="1.6")");
  svg.dots(curve, R"(stroke="#2563c4" stroke-width="4.5")");
  svg.end_group();
  svg.rectangle({left, top}, panel_width, panel_height, R"(fill="none" stroke="#9aa0a6" stroke-width="1")");
  const Ticks ticks = nice_ticks(lower, upper, 4);
  for (std::size_t i = 0; i < ticks.values.size(); ++i) {
    if (ticks.values[i] < lower || ticks.values[i] > upper) continue;
    svg.line({x(ticks.values[i]), bottom}, {x(ticks.values[i]), bottom + 4.0}, R"(stroke="#9aa0a6")");
    svg.text({x(ticks.values[i]), bottom + 16.0}, ticks.labels[i],
             R"(font-size="11" fill="#5f6368" text-anchor="middle")");
  }
}

}  // namespace

std::string tuned_yaml(const LogTuning& tuning, const std::string& origin) {
  std::string text =
      fmt::format("# Found by 'rhec tune' {}: {} {}, log likelihood {:.1f} before, {:.1f} after.\n", origin,
                  tuning.fixes, tuning.entries_name, tuning.log_likelihood_before, tuning.log_likelihood_after);
  for (const TunedNumber& number : tuning.numbers) {
    text += fmt::format("#   {}: {:.4g}", number.tunable.name, number.value);
    if (std::isfinite(number.error) && number.is_told && !number.is_at_bound)
      text += fmt::format(" +- {:.2g}", number.error);
    text += fmt::format(" {}, was {:.4g}{}{}\n", number.tunable.unit, number.tunable.start,
                        number.is_told ? "" : "; not told by the log", number.is_at_bound ? "; at its bound" : "");
  }
  for (const std::string& remark : tuning.remarks) text += "# " + remark + "\n";
  return text + scenario_text(tuning.settings);
}

std::string summary_json(const LogTuning& tuning) {
  Json json;
  json["variant"] = tuning.variant;
  json["filter"] = tuning.filter;
  json[tuning.entries_name] = tuning.fixes;
  json["log_likelihood"] = {{"before", tuning.log_likelihood_before}, {"after", tuning.log_likelihood_after}};
  const auto degrees = [](double value) { return value < normal_degrees ? Json(value) : Json(nullptr); };
  Json& tails = json["degrees_of_freedom"] = Json::object();
  tails["before"] = degrees(tuning.degrees_before);
  tails["after"] = degrees(tuning.degrees_after);
  Json& numbers = json["numbers"] = Json::object();
  for (const TunedNumber& number : tuning.numbers) {
    Json& entry = numbers[number.tunable.name] = Json::object();
    entry["keys"] = number.tunable.keys;
    entry["unit"] = number.tunable.unit;
    entry["before"] = number.tunable.start;
    entry["after"] = number.value;
    entry["standard_error"] = number.error;
    entry["hessian_error"] = number.hessian_error;
    entry["told"] = number.is_told;
    entry["at_bound"] = number.is_at_bound;
    Json& slice = entry["slice"] = Json::array();
    for (const auto& [value, drop] : number.slice) slice.push_back(interval_json({value, drop}));
  }
  Json& laws = json["laws"] = Json::array();
  for (const TriedLaw& law : tuning.laws) {
    Json& entry = laws.emplace_back() = Json::object();
    entry["key"] = law.key;
    entry["law"] = law.law;
    entry["gain"] = law.gain;
    entry["gain_error"] = law.gain_error;
    entry["taken"] = law.is_taken;
  }
  Json& estimators = json["estimators"] = Json::array();
  for (const TriedEstimator& tried : tuning.estimators) {
    Json& entry = estimators.emplace_back() = Json::object();
    entry["name"] = tried.name;
    entry["median_" + tuning.unit] = tried.median;
    entry["rmse_capped_" + tuning.unit] = tried.rmse;
    entry["taken"] = tried.is_taken;
  }
  Json& confounded = json["confounded"] = Json::array();
  for (const ConfoundedPair& pair : tuning.confounded) {
    Json& entry = confounded.emplace_back() = Json::object();
    entry["first"] = pair.first;
    entry["second"] = pair.second;
    entry["correlation"] = pair.correlation;
  }
  json["remarks"] = tuning.remarks;
  Json& judged = json["judged"] = Json::array();
  for (const Compared& figure : tuning.judged) {
    Json& entry = judged.emplace_back() = Json::object();
    entry["name"] = figure.name;
    entry["unit"] = figure.unit;
    entry["before"] = figure.before;
    entry["before_95"] = interval_json(figure.before_interval);
    entry["after"] = figure.after;
    entry["after_95"] = interval_json(figure.after_interval);
    entry["change_95"] = interval_json(figure.change_interval);
  }
  Json& sensors = json["sensors"] = Json::array();
  for (const TunedSensor& sensor : tuning.sensors)
    sensors.push_back({{"name", sensor.name},
                       {"expected", sensor.expected},
                       {"nis_before", sensor.before},
                       {"nis_after", sensor.after}});
  json["evaluations"] = tuning.evaluations;
  json["stopped"] = tuning.stopped;
  json["seconds"] = tuning.seconds;
  return json.dump(2) + "\n";
}

std::string tuning_svg(const LogTuning& tuning) {
  const auto count = static_cast<int>(tuning.numbers.size());
  const int rows = (count + columns - 1) / columns;
  const double panel_width = (page_width - 2.0 * margin - (columns - 1) * gap * 0.5) / columns;
  Svg svg(page_width, head + rows * (panel_height + gap + 22.0) + margin);
  svg.text({margin, 24.0}, fmt::format("Log likelihood of the {} about what was found", tuning.entries_name),
           R"(font-size="15" font-weight="bold" fill="#222")");
  svg.text(
      {margin, 42.0},
      fmt::format("one number at a time, the others held; red: found, grey: its standard error with the others free, "
                  "dashed: before; a panel is {:g} high where it says nothing else",
                  least_depth),
      panel_text);
  for (int i = 0; i < count; ++i) {
    const int row = i / columns, column = i % columns;
    draw_slice(svg, tuning.numbers[static_cast<std::size_t>(i)],
               {margin + column * (panel_width + 0.5 * gap), head + 24.0 + row * (panel_height + gap + 22.0)},
               panel_width);
  }
  return svg.document();
}

}  // namespace rhec::sim
