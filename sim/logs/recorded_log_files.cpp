#include <fmt/format.h>

#include <cmath>
#include <iterator>

#include "rhec/sim/figures/run_picture.hpp"
#include "rhec/sim/files/json.hpp"
#include "rhec/sim/logs/recorded_log.hpp"
#include "rhec/sim/numbers/spread.hpp"

namespace rhec::sim {
namespace {

Json json_of(const PredictionErrors& errors) {
  Json json = {{"count", errors.count}};
  // Without errors to summarise the result is null, not zero.
  json["median_m"] = errors.count > 0 ? Json(errors.median) : Json();
  json["rmse_capped_m"] = errors.count > 0 ? Json(errors.rmse_capped) : Json();
  return json;
}

Json json_of(const HeldOutSummary& held_out) {
  Json json = json_of(held_out.all);
  json["consistent"] = json_of(held_out.consistent);
  return json;
}

Json json_of(const Replay& replay, const RecordedLog& log) {
  Json json;
  json["held_out"] = json_of(summarise(replay, log));
  json["unpredicted"] = replay.unpredicted;
  json["nodes"] = replay.counts.nodes;
  json["solves"] = replay.counts.estimates;
  json["fallbacks"] = replay.counts.fallbacks;
  json["dropped"] = replay.counts.dropped;
  json["rejected"] = replay.counts.rejected;
  json["rebased"] = replay.counts.rebased;
  json["clocks_set"] = replay.counts.clocks_set;
  json["integration"] = {{"checked", replay.counts.integrated}, {"coarse", replay.counts.coarse}};
  json["seconds"] = replay.seconds;
  const Spread times = replay.solve_us.empty() ? Spread{0.0, 0.0, 0.0} : spread_of(replay.solve_us);
  json["solve_time_us"] = {{"median", times.median}, {"p99", times.p99}, {"max", times.max}};
  return json;
}

}  // namespace

std::string estimates_csv(const std::vector<Replay>& replays, const RecordedLog& log, const LogScenario& scenario) {
  const ModelDescription& about = scenario.variants().front().robot.model()->description();
  std::string text = "variant,time,kind";
  for (const char* prefix : {"", "sigma_"})
    for (const auto* variables : {&about.states, &about.parameters})
      for (const Variable& variable : *variables) text += fmt::format(",{}{}", prefix, variable.name);
  text += ",fix_x,fix_y,residual,held_out,fallback\n";
  auto out = std::back_inserter(text);
  const auto number = [&](double value) {
    // A missing value is an empty field.
    if (std::isfinite(value)) {
      fmt::format_to(out, ",{:.9g}", value);
    } else {
      text += ',';
    }
  };
  for (const Replay& replay : replays) {
    for (const LoggedEstimate& entry : replay.estimates) {
      const bool is_fix = entry.fix >= 0;
      fmt::format_to(out, "{},{:.10g},{}", replay.name, entry.time, is_fix ? "fix" : "node");
      for (const double value : entry.values) number(value);
      for (const double value : entry.sigmas) number(value);
      const Fix none{0.0, std::nan(""), std::nan("")};
      const Fix& fix = is_fix ? log.fixes[static_cast<std::size_t>(entry.fix)] : none;
      number(fix.x);
      number(fix.y);
      number(entry.residual);
      fmt::format_to(out, ",{:d},{:d}\n", entry.held_out, entry.fallback);
    }
  }
  return text;
}

std::string summary_json(const std::vector<Replay>& replays, const RecordedLog& log, const LogScenario& scenario,
                         const HoldOut& hold_out) {
  Json json;
  json["name"] = scenario.name();
  json["dead_reckoning"] = {{"rows", log.rows.size()},
                            {"missing", {{"speed", log.missing_speeds}, {"steering", log.missing_steerings}}}};
  json["fixes"] = {
      {"rows", log.fixes.size()},
      {"missing_coordinates", log.missing_coordinates},
      {"consistent", std::count_if(log.fixes.begin(), log.fixes.end(), [](const Fix& f) { return f.agrees; })}};
  json["hold_out"] = {{"every", hold_out.every}, {"phase", hold_out.phase}, {"error_cap_m", error_cap}};
  // Result of the first variant, the scenario's main one; all variants follow below.
  json["variant"] = replays.front().name;
  json["held_out"] = json_of(summarise(replays.front(), log));
  Json& variants = json["variants"];
  for (const Replay& replay : replays) variants[replay.name] = json_of(replay, log);
  return json.dump(2) + "\n";
}

std::string times_csv(const std::vector<Replay>& replays) {
  std::string text = "variant,node,rhe_us\n";
  for (const Replay& replay : replays)
    for (std::size_t node = 0; node < replay.solve_us.size(); ++node)
      fmt::format_to(std::back_inserter(text), "{},{},{:.3f}\n", replay.name, node, replay.solve_us[node]);
  return text;
}

std::string replay_svg(const Replay& replay, const RecordedLog& log, const LogScenario& scenario,
                       const Replay* beside) {
  const ModelDescription& about = scenario.variants().front().robot.model()->description();
  RunPicture picture;
  picture.title = scenario.name();
  const HeldOutSummary summary = summarise(replay, log);
  picture.subtitle = replay.name;
  if (summary.all.count > 0)
    picture.subtitle +=
        fmt::format("; {} withheld fixes met to {:.3f} m in the median", summary.all.count, summary.all.median);
  for (const Fix& fix : log.fixes) picture.fixes.push_back({fix.x, fix.y});
  for (const LoggedEstimate& entry : replay.estimates)
    if (!entry.held_out)
      picture.estimated.push_back({entry.values[about.roles.position_x], entry.values[about.roles.position_y]});
  const auto nx = static_cast<Eigen::Index>(about.states.size());
  for (std::size_t j = 0; j < about.parameters.size(); ++j) {
    const Variable& variable = about.parameters[j];
    Panel panel;
    panel.title = variable.meaning.empty() ? variable.name : fmt::format("{} ({})", variable.name, variable.meaning);
    panel.unit = variable.unit;
    const auto curve_of = [&](const Replay& of) {
      Curve curve;
      for (const LoggedEstimate& entry : of.estimates) {
        if (entry.held_out) continue;
        curve.times.push_back(entry.time);
        curve.values.push_back(entry.values[nx + static_cast<Eigen::Index>(j)]);
        curve.sigmas.push_back(entry.sigmas[nx + static_cast<Eigen::Index>(j)]);
      }
      return curve;
    };
    if (beside) {
      Curve other = curve_of(*beside);
      other.label = beside->name;
      other.sigmas.clear();
      other.role = CurveRole::other;
      panel.curves.push_back(std::move(other));
    }
    Curve curve = curve_of(replay);
    curve.label = beside ? replay.name + ", 2 sigma" : "estimated, 2 sigma";
    panel.curves.push_back(std::move(curve));
    panel.lower = 0.0;
    panel.upper = 1.5;
    picture.panels.push_back(std::move(panel));
  }
  Panel errors;
  errors.title = "Distance of fixes from the estimate";
  errors.unit = "m";
  Curve held_out, used;
  held_out.label = "withheld";
  held_out.role = CurveRole::other;
  used.label = "used";
  for (const LoggedEstimate& entry : replay.estimates) {
    if (entry.fix < 0) continue;
    Curve& curve = entry.held_out ? held_out : used;
    curve.times.push_back(entry.time);
    curve.values.push_back(entry.residual);
  }
  if (!used.times.empty()) errors.curves.push_back(std::move(used));
  if (!held_out.times.empty()) errors.curves.push_back(std::move(held_out));
  errors.lower = 0.0;
  errors.upper = error_cap;
  picture.panels.push_back(std::move(errors));
  return draw_run(picture);
}

}  // namespace rhec::sim
