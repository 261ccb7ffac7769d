#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>

#include "rhec/sim/figures/run_picture.hpp"
#include "rhec/sim/numbers/spread.hpp"
#include "rhec/sim/replay/replay_summary.hpp"

namespace rhec::sim {
namespace {

/// A cell; a missing value is an empty one.
void append(double value, std::string& text) {
  if (std::isfinite(value)) {
    fmt::format_to(std::back_inserter(text), ",{:.10g}", value);
  } else {
    text += ',';
  }
}

void append_header(const char* prefix, const std::vector<Variable>& variables, std::string& text) {
  for (const Variable& variable : variables) text += fmt::format(",{}{}", prefix, variable.name);
}

/// A JSON number, or null.
Json number(double value) { return std::isfinite(value) ? Json(value) : Json(); }

Json json_of(const AccuracySummary& accuracy) {
  Json json = {{"sensor", accuracy.sensor},           {"count", accuracy.count},
               {"unpredicted", accuracy.unpredicted}, {"median", number(accuracy.median)},
               {"rms", number(accuracy.rms)},         {"largest", number(accuracy.most)}};
  for (const SensorSummary::Output& output : accuracy.outputs) json["rms_" + output.name] = number(output.rms);
  return json;
}

Json json_of(const SensorSummary& sensor) {
  Json json = {{"used", sensor.used},
               {"rejected", sensor.rejected},
               {"nis", number(sensor.nis)},
               {"nis_expected", sensor.expected}};
  Json& outputs = json["outputs"];
  for (const SensorSummary::Output& output : sensor.outputs)
    outputs[output.name] = {{"rms", number(output.rms)},
                            {"expected", number(output.expected)},
                            {"correlation", number(output.correlation)}};
  return json;
}

Json json_of(const DriveResult& result, const Robot& robot) {
  Json json;
  Json& sensors = json["innovations"] = Json::object();
  for (const SensorSummary& sensor : summarise_innovations(result.all, robot)) sensors[sensor.name] = json_of(sensor);
  if (result.withheld.withheld_sensor >= 0) json["held_out"] = json_of(summarise_predictions(result.withheld, robot));
  const Estimator::Counts& counts = result.all.counts;
  json["nodes"] = counts.nodes;
  json["solves"] = counts.estimates;
  json["fallbacks"] = counts.fallbacks;
  json["measurements"] = {{"late", counts.late},       {"dropped", counts.dropped},
                          {"missing", counts.missing}, {"rejected", counts.rejected},
                          {"rebased", counts.rebased}, {"clocks_set", counts.clocks_set}};
  std::map<std::string, std::int64_t> levels;
  for (const DriveEstimate& estimate : result.all.estimates) ++levels[name_of(estimate.health)];
  json["health"] = levels;
  json["seconds"] = result.all.seconds;
  const Spread times = result.all.solve_us.empty() ? Spread{0.0, 0.0, 0.0} : spread_of(result.all.solve_us);
  json["solve_time_us"] = {{"median", times.median}, {"p99", times.p99}, {"max", times.max}};
  return json;
}

Curve curve_of(const DriveReplay& replay, Eigen::Index index, std::string label, CurveRole role) {
  Curve curve;
  curve.label = std::move(label);
  curve.role = role;
  for (const DriveEstimate& estimate : replay.estimates) {
    curve.times.push_back(estimate.time);
    curve.values.push_back(estimate.values[index]);
    if (role == CurveRole::estimate) curve.sigmas.push_back(estimate.sigmas[index]);
  }
  return curve;
}

/// The measurements of the sensor that sees positions.
std::vector<Point> fixes_of(const Robot& robot, const DriveReplay& replay, const logs::Drive& drive) {
  const Sensor& sensor = replay.sensors[static_cast<std::size_t>(sensor_to_withhold(robot, replay.sensors))];
  std::vector<Point> fixes;
  for (const logs::DriveEvent& event : drive.events) {
    if (!event.is_output || sensor.outputs.size() < 2) continue;
    const double* values = drive.values_of(event);
    const double x = values[sensor.outputs[0]], y = values[sensor.outputs[1]];
    if (!std::isnan(x) && !std::isnan(y)) fixes.push_back({x, y});
  }
  return fixes;
}

}  // namespace

std::string drive_estimates_csv(const std::vector<DriveResult>& results, const Robot& robot) {
  const ModelDescription& about = robot.estimated_description();
  std::string text = "variant,time";
  for (const char* prefix : {"", "sigma_"}) {
    append_header(prefix, about.states, text);
    append_header(prefix, about.parameters, text);
  }
  text += ",fallback,health,findings\n";
  for (const DriveResult& result : results)
    for (const DriveEstimate& estimate : result.all.estimates) {
      fmt::format_to(std::back_inserter(text), "{},{:.10g}", result.all.name, estimate.time);
      for (const double value : estimate.values) append(value, text);
      for (const double value : estimate.sigmas) append(value, text);
      fmt::format_to(std::back_inserter(text), ",{:d},{},{}\n", estimate.fallback, name_of(estimate.health),
                     estimate.findings);
    }
  return text;
}

std::string measurements_csv(const DriveResult& result, const Robot& robot, const logs::Drive& drive) {
  std::string text = "time,received";
  const std::vector<Variable>& outputs = robot.model()->description().outputs;
  append_header("", outputs, text);
  std::vector<std::size_t> stating;
  for (std::size_t j = 0; j < outputs.size(); ++j)
    if (std::ranges::any_of(drive.signals, [&](const logs::SignalCount& each) {
          return each.is_output && each.stated > 0 && each.variable == outputs[j].name;
        })) {
      stating.push_back(j);
      text += ",sigma_" + outputs[j].name;
    }
  text += ",held_out\n";
  std::vector<bool> is_held_out(drive.events.size());
  for (const DrivePrediction& prediction : result.withheld.predictions) is_held_out[prediction.event] = true;
  for (std::size_t i = 0; i < drive.events.size(); ++i) {
    const logs::DriveEvent& event = drive.events[i];
    if (!event.is_output) continue;
    fmt::format_to(std::back_inserter(text), "{:.10g},{:.10g}", event.time, event.arrival);
    for (int j = 0; j < drive.outputs; ++j) append(drive.values_of(event)[j], text);
    const double* sigmas = drive.sigmas_of(event);
    for (const std::size_t j : stating) append(sigmas ? sigmas[j] : std::nan(""), text);
    fmt::format_to(std::back_inserter(text), ",{:d}\n", bool{is_held_out[i]});
  }
  return text;
}

std::string innovations_csv(const std::vector<DriveResult>& results, const Robot& robot) {
  const std::vector<Variable>& outputs = robot.model()->description().outputs;
  std::string text = "variant,time,sensor,accepted,nis";
  append_header("", outputs, text);
  append_header("sigma_", outputs, text);
  text += '\n';
  for (const DriveResult& result : results)
    for (const DriveInnovation& innovation : result.all.innovations) {
      const Sensor& sensor = result.all.sensors[static_cast<std::size_t>(innovation.sensor)];
      fmt::format_to(std::back_inserter(text), "{},{:.10g},{},{:d}", result.all.name, innovation.time, sensor.name,
                     innovation.accepted);
      append(innovation.nis, text);
      for (const auto* entries : {&innovation.values, &innovation.sigmas})
        for (int j = 0; j < std::ssize(outputs); ++j) append(of_output(*entries, innovation, result.all, j), text);
      text += '\n';
    }
  return text;
}

std::string predictions_csv(const std::vector<DriveResult>& results, const Robot& robot) {
  std::string text = "variant,time,distance";
  const DriveReplay& first = results.front().withheld;
  if (first.withheld_sensor >= 0)
    for (const int j : first.sensors[static_cast<std::size_t>(first.withheld_sensor)].outputs)
      text += fmt::format(",residual_{}", robot.model()->description().outputs[static_cast<std::size_t>(j)].name);
  text += '\n';
  for (const DriveResult& result : results)
    for (const DrivePrediction& prediction : result.withheld.predictions) {
      fmt::format_to(std::back_inserter(text), "{},{:.10g}", result.all.name, prediction.time);
      append(prediction.distance, text);
      for (const double residual : prediction.residuals) append(residual, text);
      text += '\n';
    }
  return text;
}

std::string drive_times_csv(const std::vector<DriveResult>& results) {
  std::string text = "variant,sample,rhe_us\n";
  for (const DriveResult& result : results)
    for (std::size_t i = 0; i < result.all.solve_us.size(); ++i)
      fmt::format_to(std::back_inserter(text), "{},{},{:.3f}\n", result.all.name, i, result.all.solve_us[i]);
  return text;
}

std::string drive_summary_json(const std::vector<DriveResult>& results, const std::string& name, const Robot& robot,
                               const logs::Drive& drive, const std::string& log, const HoldOut& hold_out) {
  Json json;
  json["name"] = name;
  json["log"] = log;
  json["start"] = 1e-9 * static_cast<double>(drive.start);
  if (drive.origin)
    json["origin"] = Json(std::vector<double>{drive.origin->latitude, drive.origin->longitude, drive.origin->height});
  json["damage"] = drive.damage ? Json(drive.damage->what) : Json();
  Json& signals = json["signals"] = Json::object();
  for (const logs::SignalCount& each : drive.signals)
    signals[(each.is_output ? "outputs." : "inputs.") + each.variable] = {{"from", each.source},
                                                                          {"values", each.values},
                                                                          {"missing", each.missing},
                                                                          {"left_out", each.left_out},
                                                                          {"stated", each.stated}};
  json["hold_out"] = {{"every", hold_out.every}, {"phase", hold_out.phase}};
  json["variant"] = results.front().all.name;
  Json& variants = json["variants"];
  for (const DriveResult& result : results) variants[result.all.name] = json_of(result, robot);
  return json.dump(2) + "\n";
}

std::string drive_svg(const DriveResult& result, const std::string& title, const Robot& robot, const logs::Drive& drive,
                      const DriveReplay* beside) {
  const ModelDescription& about = robot.estimated_description();
  RunPicture picture;
  picture.title = title;
  picture.subtitle = result.all.name;
  const AccuracySummary accuracy = summarise_predictions(result.withheld, robot);
  if (accuracy.count > 0)
    picture.subtitle +=
        fmt::format("; {} withheld measurements predicted to {:.3g} in the median", accuracy.count, accuracy.median);
  picture.fixes = fixes_of(robot, result.all, drive);
  const Roles& roles = about.roles;
  for (const DriveEstimate& estimate : result.all.estimates)
    if (roles.position_x >= 0 && roles.position_y >= 0)
      picture.estimated.push_back({estimate.values[roles.position_x], estimate.values[roles.position_y]});
  const auto states = std::ssize(about.states);
  for (std::ptrdiff_t j = 0; j < std::ssize(about.parameters); ++j) {
    const Variable& variable = about.parameters[static_cast<std::size_t>(j)];
    Panel panel;
    panel.title = variable.meaning.empty() ? variable.name : fmt::format("{} ({})", variable.name, variable.meaning);
    panel.unit = variable.unit;
    if (beside) panel.curves.push_back(curve_of(*beside, states + j, beside->name, CurveRole::other));
    panel.curves.push_back(curve_of(result.all, states + j, result.all.name + ", 2 sigma", CurveRole::estimate));
    if (std::isfinite(variable.lower) && std::isfinite(variable.upper)) {
      panel.lower = variable.lower;
      panel.upper = variable.upper;
    }
    picture.panels.push_back(std::move(panel));
  }
  Panel errors;
  errors.title = "Prediction of withheld measurements";
  Curve curve;
  curve.label = accuracy.sensor;
  curve.role = CurveRole::other;
  for (const DrivePrediction& prediction : result.withheld.predictions) {
    curve.times.push_back(prediction.time);
    curve.values.push_back(prediction.distance);
  }
  if (!curve.times.empty()) {
    errors.curves.push_back(std::move(curve));
    picture.panels.push_back(std::move(errors));
  }
  return draw_run(picture);
}

}  // namespace rhec::sim
