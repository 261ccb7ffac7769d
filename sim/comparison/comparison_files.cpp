#include <algorithm>
#include <cmath>
#include <iterator>

#include <fmt/format.h>

#include "rhec/sim/comparison/comparison.hpp"
#include "rhec/sim/figures/svg.hpp"
#include "rhec/sim/files/json.hpp"
#include "rhec/sim/loop/run_files.hpp"

namespace rhec::sim {
namespace {

Json json_of(const Spread& spread) { return {{"median", spread.median}, {"p99", spread.p99}, {"max", spread.max}}; }

Json json_of(const Backend& backend) {
  Json json;
  json["label"] = backend.label;
  json["solver"] = backend.solver;
  json["options"] = backend.options.is_null() ? Json::object() : sim::json_of(backend.options);
  return json;
}

Json json_of(const SameProblems& same, const BackendAnswers& backend, const std::string& label, bool equal_accuracy) {
  const std::vector<Answer>& answers = backend.answers;
  Json json;
  json["label"] = label;
  json["solved"] = answers.size();
  json["refused"] = backend.refused;
  json["refusal"] = backend.refusal;
  if (equal_accuracy) {
    json["tolerance"] = backend.tolerance ? Json(*backend.tolerance) : Json(nullptr);
    json["accuracy_reached"] = backend.accuracy_reached;
    json["tuning"] = backend.tuning;
  }
  json["statuses"] = backend.statuses;
  json["unusable"] = std::count_if(answers.begin(), answers.end(), [](const Answer& answer) { return !answer.usable; });
  json["iterations"] = json_of(spread_of(answers, &Answer::iterations));
  json["kkt_residual"] = json_of(spread_of(answers, &Answer::kkt));
  json["defect"] = json_of(spread_of(answers, &Answer::defect));
  json["violation"] = json_of(spread_of(answers, &Answer::violation));
  json["gap"] = json_of(spread_of(answers, &Answer::gap));
  json["distance"] = json_of(spread_of(answers, &Answer::distance));
  // The problem to examine first.
  const auto worst = std::max_element(answers.begin(), answers.end(), [](const Answer& a, const Answer& b) {
    return std::isnan(b.gap) ? false : std::isnan(a.gap) || a.gap < b.gap;
  });
  if (worst != answers.end() && !std::isnan(worst->gap)) {
    const SameProblems::Place& place = same.problems[backend.taken[worst - answers.begin()]];
    json["worst"] = {{"seed", place.seed}, {"step", place.step}, {"gap", worst->gap}, {"objective", worst->objective}};
  } else {
    json["worst"] = nullptr;
  }
  json["time_us"] = json_of(spread_of(answers, &Answer::time_us));
  return json;
}

Json json_of(const RunSummary& run, std::int64_t seed) {
  Json json = sim::json_of(run);
  json["time_us"] = json["solve_time_us"];
  json.erase("solve_time_us");
  Json with_seed;
  with_seed["seed"] = seed;
  with_seed.update(json);
  return with_seed;
}

Json json_of(const std::vector<RunSummary>& runs, const std::vector<std::int64_t>& seeds) {
  Json list = Json::array();
  for (std::size_t r = 0; r < runs.size(); ++r) list.push_back(json_of(runs[r], seeds[r]));
  return list;
}

Json errors_of(const std::vector<RunSummary>& runs, const std::vector<RunSummary>& others) {
  Json errors;
  const auto add = [&](const std::string& name, const std::function<double(const ErrorSummary&)>& error) {
    const Mean mean = paired_mean(runs, others, [&](const RunSummary& run) { return error(run.mae); });
    errors[name] = {{"mean", mean.mean}, {"difference", mean.difference}, {"standard_error", mean.standard_error}};
  };
  for (const auto& [name, value] : runs.front().mae.parameters)
    add(name, [key = name](const ErrorSummary& error) { return error.parameters.at(key); });
  add("position", [](const ErrorSummary& error) { return error.position; });
  add("heading", [](const ErrorSummary& error) { return error.heading; });
  add("tracking", [](const ErrorSummary& error) { return error.tracking; });
  return errors;
}

// ---- the picture

constexpr double margin = 24.0, top = 74.0, panel_width = 480.0, panel_height = 300.0, axis_width = 44.0, gap = 52.0;
constexpr double legend_step = 20.0, bottom = 66.0;
constexpr const char* colours[] = {"#d1341f", "#2563c4", "#1b8a5a", "#8a3fb0",
                                   "#b7791f", "#222222", "#0e7490", "#be185d"};
constexpr const char* dashes[] = {"", "7 3", "2 3"};
constexpr const char* grey_text = R"(font-size="11" fill="#5f6368")";

/// Distinguished by colours first, then by dashes.
std::string style_of(std::size_t backend) {
  const std::string dash = dashes[backend / std::size(colours) % std::size(dashes)];
  return fmt::format("stroke=\"{}\" stroke-width=\"1.8\"{}", colours[backend % std::size(colours)],
                     dash.empty() ? "" : fmt::format(" stroke-dasharray=\"{}\"", dash));
}

/// A time with its unit, to three digits.
std::string time_text(double us) {
  const double scale = us < 1e3 ? 1.0 : us < 1e6 ? 1e3 : 1e6;
  const double value = us / scale;
  return fmt::format("{:.{}f} {}", value,
                     value < 9.995   ? 2
                     : value < 99.95 ? 1
                                     : 0,
                     scale == 1.0   ? "µs"
                     : scale == 1e3 ? "ms"
                                    : "s");
}

std::string decade_text(int decade) {
  const int thousands = decade < 3 ? 0 : decade < 6 ? 1 : 2;
  constexpr const char* units[] = {"µs", "ms", "s"};
  return fmt::format("{:g} {}", std::pow(10.0, decade - 3 * thousands), units[thousands]);
}

struct Decades {
  int lower = 0, upper = 1;
};

Decades decades_of(const Comparison& comparison) {
  double least = INFINITY, most = 0.0;
  for (const SameProblems& same : comparison.problems)
    for (const BackendAnswers& backend : same.backends)
      for (const Answer& answer : backend.answers) {
        if (!(answer.time_us > 0.0)) continue;
        least = std::min(least, answer.time_us);
        most = std::max(most, answer.time_us);
      }
  if (!(least < INFINITY)) return {};
  Decades decades{static_cast<int>(std::floor(std::log10(least))), static_cast<int>(std::ceil(std::log10(most)))};
  decades.upper = std::max(decades.upper, decades.lower + 1);
  return decades;
}

void draw_panel(Svg& svg, const SameProblems& same, const Decades& decades, double left, bool has_axis) {
  const auto x_of = [&](double time) {
    return left + (std::log10(time) - decades.lower) / (decades.upper - decades.lower) * panel_width;
  };
  const auto y_of = [](double share) { return top + (1.0 - share) * panel_height; };
  svg.text({left, top - 10.0}, same.kind == "rhe" ? "Estimation (RHE)" : "Control (RHC)",
           R"(font-size="12.5" font-weight="bold" fill="#222")");
  for (int decade = decades.lower; decade <= decades.upper; ++decade) {
    for (int digit = 2; digit < 10 && decade < decades.upper; ++digit) {
      const double x = x_of(digit * std::pow(10.0, decade));
      svg.line({x, top}, {x, top + panel_height}, R"(stroke="#f1f2f4" stroke-width="1")");
    }
    const double x = x_of(std::pow(10.0, decade));
    svg.line({x, top}, {x, top + panel_height}, R"(stroke="#d5d8dc" stroke-width="1")");
    svg.text({x, top + panel_height + 17.0}, decade_text(decade), fmt::format("{} text-anchor=\"middle\"", grey_text));
  }
  for (const double share : {0.0, 0.25, 0.5, 0.75, 0.99}) {
    const double y = y_of(share);
    svg.line({left, y}, {left + panel_width, y}, R"(stroke="#e3e5e8" stroke-width="1")");
    if (has_axis)
      svg.text({left - 7.0, y + 4.0}, fmt::format("{:g} %", 100.0 * share),
               fmt::format("{} text-anchor=\"end\"", grey_text));
  }
  svg.begin_clip({left, top - 2.0}, panel_width, panel_height + 4.0);
  for (std::size_t b = 0; b < same.backends.size(); ++b) {
    std::vector<double> times;
    for (const Answer& answer : same.backends[b].answers) times.push_back(std::max(answer.time_us, 1e-3));
    if (times.empty()) continue;
    std::sort(times.begin(), times.end());
    std::vector<Point> steps{{x_of(times.front()), y_of(0.0)}};
    for (std::size_t i = 0; i < times.size(); ++i) {
      const double before = static_cast<double>(i), count = static_cast<double>(times.size());
      steps.push_back({x_of(times[i]), y_of(before / count)});
      steps.push_back({x_of(times[i]), y_of((before + 1.0) / count)});
    }
    steps.push_back({left + panel_width, y_of(1.0)});
    svg.polyline(thin_track(steps, 0.2), style_of(b));
  }
  svg.end_group();
  svg.rectangle({left, top}, panel_width, panel_height, R"(fill="none" stroke="#9aa0a6" stroke-width="1")");
}

}  // namespace

std::string comparison_json(const Comparison& comparison) {
  Json json;
  json["scenario"] = comparison.scenario;
  json["seeds"] = comparison.seeds;
  json["every"] = comparison.every;
  json["accuracy"] = comparison.accuracy ? Json(*comparison.accuracy) : Json(nullptr);
  json["solvers"] = Json::array();
  for (const Backend& backend : comparison.backends) json["solvers"].push_back(json_of(backend));
  json["reference"] = json_of(comparison.reference);
  json["reference"]["runs"] = json_of(comparison.reference_runs, comparison.seeds);
  json["same_problems"] = Json::object();
  for (const SameProblems& same : comparison.problems) {
    Json& kind = json["same_problems"][same.kind];
    kind["problems"] = same.problems.size();
    kind["without_best"] = same.without_best;
    kind["solvers"] = Json::array();
    for (std::size_t b = 0; b < same.backends.size(); ++b)
      kind["solvers"].push_back(
          json_of(same, same.backends[b], comparison.backends[b].label, comparison.accuracy.has_value()));
  }
  json["closed_loop"] = Json::array();
  const std::vector<RunSummary> nobody;
  for (std::size_t b = 0; b < comparison.loops.size(); ++b) {
    const BackendRuns& loop = comparison.loops[b];
    const std::vector<RunSummary>& first = comparison.loops.front().runs;
    Json& entry = json["closed_loop"].emplace_back();
    entry["label"] = comparison.backends[b].label;
    entry["refusal"] = loop.refusal;
    entry["errors"] = loop.runs.empty() ? Json::object() : errors_of(loop.runs, first);
    entry["runs"] = json_of(loop.runs, comparison.seeds);
  }
  json["all_usable"] = comparison.all_usable();
  return json.dump(2) + "\n";
}

std::string comparison_svg(const Comparison& comparison) {
  const auto panels = static_cast<double>(std::max<std::size_t>(comparison.problems.size(), 1));
  const double width = margin + axis_width + panels * panel_width + (panels - 1.0) * gap + margin;
  const double height = top + panel_height + bottom + legend_step * static_cast<double>(comparison.backends.size());
  Svg svg(width, height);
  svg.text({margin, margin + 8.0}, fmt::format("Solve times: {}", comparison.scenario),
           R"(font-size="18" font-weight="bold" fill="#222")");
  svg.text({width - margin, margin + 8.0}, "share of the same problems that take at most this long",
           R"(font-size="12.5" fill="#5f6368" text-anchor="end")");
  const Decades decades = decades_of(comparison);
  double left = margin + axis_width;
  for (const SameProblems& same : comparison.problems) {
    draw_panel(svg, same, decades, left, left == margin + axis_width);
    left += panel_width + gap;
  }
  double line = top + panel_height + bottom;
  const double label_at = margin + axis_width + 34.0, right = width - margin, column = 92.0;
  const auto end_text = [&](double x, double y, const std::string& text, const char* fill) {
    svg.text({x, y}, text, fmt::format("font-size=\"12\" text-anchor=\"end\" fill=\"{}\"", fill));
  };
  const auto column_end = [&](std::size_t kind, int number) {
    return right - column * (2.0 * (panels - 1.0 - static_cast<double>(kind)) + 1.0 - number);
  };
  for (std::size_t k = 0; k < comparison.problems.size(); ++k) {
    const std::string& kind = comparison.problems[k].kind;
    end_text(column_end(k, 0), line - legend_step, fmt::format("{} median", kind), "#5f6368");
    end_text(column_end(k, 1), line - legend_step, "99 %", "#5f6368");
  }
  for (std::size_t b = 0; b < comparison.backends.size(); ++b) {
    svg.line({margin + axis_width, line - 4.0}, {margin + axis_width + 24.0, line - 4.0}, style_of(b));
    svg.text({label_at, line}, comparison.backends[b].label, R"(font-size="12" fill="#222")");
    for (std::size_t k = 0; k < comparison.problems.size(); ++k) {
      const BackendAnswers& backend = comparison.problems[k].backends[b];
      const Spread times = spread_of(backend.answers, &Answer::time_us);
      if (backend.answers.empty()) {
        end_text(column_end(k, 1), line, "refused", "#222");
        continue;
      }
      end_text(column_end(k, 0), line, time_text(times.median), "#222");
      end_text(column_end(k, 1), line, time_text(times.p99), "#222");
    }
    line += legend_step;
  }
  return svg.document();
}

}  // namespace rhec::sim
