#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "rhec/sim/figures/svg.hpp"
#include "rhec/sim/files/json.hpp"
#include "rhec/sim/tuning/controller_tuning.hpp"

#include "scenario_text.hpp"

namespace rhec::sim {
namespace {

// Sizes of the drawing [pixels].
constexpr double figure_width = 720.0, figure_height = 520.0, left_margin = 70.0, right_margin = 24.0,
                 top_margin = 64.0, bottom_margin = 56.0;
constexpr const char* small_text = R"(font-size="11" fill="#5f6368")";
// What tracks or steers so many times worse than the scenario is not drawn.
constexpr double worst_shown = 4.0;

bool is_shown(const TriedController& tried) {
  return tried.is_complete && tried.tracking < worst_shown && tried.effort < worst_shown;
}

}  // namespace

std::string tuned_yaml(const ControllerTuning& tuning, const std::string& origin) {
  const TriedController& chosen = tuning.tried[static_cast<std::size_t>(tuning.chosen)];
  std::string text = fmt::format(
      "# Found by 'rhec tune --controller' {}: {:.3f} of the distance from the path for {:.3f} of the inputs' "
      "changes.\n",
      origin, chosen.tracking, chosen.effort);
  for (std::size_t i = 0; i < tuning.numbers.size(); ++i)
    text +=
        fmt::format("#   {}: {:.4g}, was {:.4g}\n", tuning.numbers[i].name, chosen.values[i], tuning.numbers[i].start);
  return text + scenario_text(tuning.settings);
}

std::string summary_json(const ControllerTuning& tuning) {
  Json json;
  Json& numbers = json["numbers"] = Json::object();
  const TriedController& chosen = tuning.tried[static_cast<std::size_t>(tuning.chosen)];
  for (std::size_t i = 0; i < tuning.numbers.size(); ++i) {
    Json& entry = numbers[tuning.numbers[i].name] = Json::object();
    entry["keys"] = tuning.numbers[i].keys;
    entry["before"] = tuning.numbers[i].start;
    entry["after"] = chosen.values[i];
  }
  json["tracking_ratio"] = chosen.tracking;
  json["effort_ratio"] = chosen.effort;
  Json& judged = json["judged"] = Json::array();
  for (const Compared& figure : tuning.judged) {
    Json& entry = judged.emplace_back() = Json::object();
    entry["name"] = figure.name;
    entry["unit"] = figure.unit;
    entry["before"] = figure.before;
    entry["after"] = figure.after;
    entry["ratio_95"] = std::vector<double>{figure.change_interval.first, figure.change_interval.second};
  }
  json["tried"] = tuning.tried.size();
  json["runs"] = tuning.runs;
  json["stopped"] = tuning.stopped;
  json["seconds"] = tuning.seconds;
  return json.dump(2) + "\n";
}

std::string pareto_csv(const ControllerTuning& tuning) {
  std::string text;
  for (const Tunable& number : tuning.numbers) {
    std::string name = number.name;
    std::replace(name.begin(), name.end(), ',', ' ');
    text += name + ",";
  }
  text += "tracking_ratio,effort_ratio,complete,efficient,chosen\n";
  for (std::size_t i = 0; i < tuning.tried.size(); ++i) {
    const TriedController& tried = tuning.tried[i];
    for (const double value : tried.values) text += fmt::format("{:.9g},", value);
    text += fmt::format("{:.9g},{:.9g},{:d},{:d},{:d}\n", tried.tracking, tried.effort, tried.is_complete,
                        tried.is_efficient, static_cast<int>(i) == tuning.chosen);
  }
  return text;
}

std::string pareto_svg(const ControllerTuning& tuning) {
  double most_x = 1.0, most_y = 1.0, least_x = 1.0, least_y = 1.0;
  for (const TriedController& tried : tuning.tried) {
    if (!is_shown(tried)) continue;
    most_x = std::max(most_x, tried.effort), least_x = std::min(least_x, tried.effort);
    most_y = std::max(most_y, tried.tracking), least_y = std::min(least_y, tried.tracking);
  }
  const double pad_x = 0.06 * (most_x - least_x) + 0.01, pad_y = 0.06 * (most_y - least_y) + 0.01;
  least_x -= pad_x, most_x += pad_x, least_y -= pad_y, most_y += pad_y;
  const double inner_width = figure_width - left_margin - right_margin,
               inner_height = figure_height - top_margin - bottom_margin;
  const auto at = [&](const TriedController& tried) {
    return Point{left_margin + (tried.effort - least_x) / (most_x - least_x) * inner_width,
                 top_margin + (most_y - tried.tracking) / (most_y - least_y) * inner_height};
  };
  Svg svg(figure_width, figure_height);
  svg.text({left_margin, 24.0}, "Tracking against effort", R"(font-size="15" font-weight="bold" fill="#222")");
  svg.text({left_margin, 44.0},
           "relative to the scenario's controller, on the seeds that were tuned on; black: the scenario, red: chosen",
           small_text);
  const Ticks x_ticks = nice_ticks(least_x, most_x, 7), y_ticks = nice_ticks(least_y, most_y, 6);
  for (std::size_t i = 0; i < x_ticks.values.size(); ++i) {
    const double x = left_margin + (x_ticks.values[i] - least_x) / (most_x - least_x) * inner_width;
    svg.line({x, top_margin}, {x, top_margin + inner_height}, R"(stroke="#e3e5e8")");
    svg.text({x, top_margin + inner_height + 16.0}, x_ticks.labels[i],
             R"(font-size="11" fill="#5f6368" text-anchor="middle")");
  }
  for (std::size_t i = 0; i < y_ticks.values.size(); ++i) {
    const double y = top_margin + (most_y - y_ticks.values[i]) / (most_y - least_y) * inner_height;
    svg.line({left_margin, y}, {left_margin + inner_width, y}, R"(stroke="#e3e5e8")");
    svg.text({left_margin - 6.0, y + 4.0}, y_ticks.labels[i], R"(font-size="11" fill="#5f6368" text-anchor="end")");
  }
  std::vector<TriedController> front;
  std::vector<Point> others;
  for (const TriedController& tried : tuning.tried) {
    if (!is_shown(tried)) continue;
    if (tried.is_efficient) {
      front.push_back(tried);
    } else {
      others.push_back(at(tried));
    }
  }
  std::sort(front.begin(), front.end(), [](const auto& a, const auto& b) { return a.effort < b.effort; });
  std::vector<Point> line;
  line.reserve(front.size());
  for (const TriedController& tried : front) line.push_back(at(tried));
  svg.dots(others, R"(stroke="#b8c0cc" stroke-width="4.5")");
  svg.polyline(line, R"(stroke="#2563c4" stroke-width="1.5")");
  svg.dots(line, R"(stroke="#2563c4" stroke-width="6")");
  const Point own = at(tuning.tried.front()), chosen = at(tuning.tried[static_cast<std::size_t>(tuning.chosen)]);
  svg.dots({&own, 1}, R"(stroke="#222222" stroke-width="9")");
  if (tuning.chosen > 0) svg.dots({&chosen, 1}, R"(stroke="#d1341f" stroke-width="9")");
  svg.rectangle({left_margin, top_margin}, inner_width, inner_height,
                R"(fill="none" stroke="#9aa0a6" stroke-width="1")");
  svg.text({left_margin + 0.5 * inner_width, figure_height - 14.0}, "root mean square change of the inputs, ratio",
           R"(font-size="12" fill="#222" text-anchor="middle")");
  svg.text({18.0, top_margin + 0.5 * inner_height}, "mean distance from the path, ratio",
           fmt::format("font-size=\"12\" fill=\"#222\" text-anchor=\"middle\" transform=\"rotate(-90 18 {:.0f})\"",
                       top_margin + 0.5 * inner_height));
  return svg.document();
}

}  // namespace rhec::sim
