#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "rhec/sim/files/json.hpp"
#include "rhec/sim/files/number_text.hpp"
#include "rhec/sim/horizons/horizon_log.hpp"

namespace rhec::sim {
namespace {

constexpr int version = 1;
// Number of cells of the slip map: as many as a figure shows.
constexpr double most_cells = 6000.0;
// Margin of the map around path and track [m].
constexpr double map_margin = 5.0;
constexpr double most_path_points = 2000.0, least_path_step = 0.5;

/// Null means unbounded, as in a configuration.
Json bound(double value) { return std::isfinite(value) ? Json(value) : Json(nullptr); }

Json json_of(const std::vector<Variable>& variables) {
  Json list = Json::array();
  for (const Variable& variable : variables)
    list.push_back({{"name", variable.name},
                    {"unit", variable.unit},
                    {"meaning", variable.meaning},
                    {"is_angle", variable.is_angle},
                    {"lower", bound(variable.lower)},
                    {"upper", bound(variable.upper)},
                    {"scale", variable.scale},
                    {"nominal", variable.nominal}});
  return list;
}

/// The outputs that are position coordinates, i.e. that depend on one coordinate of the vehicle but not on the other.
Json position_outputs(const Model& model) {
  const Roles& roles = model.description().roles;
  const int nx = model.state_count(), ny = model.output_count();
  if (roles.position_x < 0 || roles.position_y < 0) return nullptr;
  std::vector<double> state(nx, 0.0), outputs(ny), jacobian(static_cast<std::size_t>(nx) * ny);
  model.observe({.count = 1, .states = state.data(), .outputs = outputs.data(), .jacobians = jacobian.data()});
  int x = -1, y = -1;
  for (int j = 0; j < ny; ++j) {
    const double by_x = jacobian[static_cast<std::size_t>(roles.position_x) * ny + j],
                 by_y = jacobian[static_cast<std::size_t>(roles.position_y) * ny + j];
    if (x < 0 && std::abs(by_x - 1.0) < 1e-6 && std::abs(by_y) < 1e-6) x = j;
    if (y < 0 && std::abs(by_y - 1.0) < 1e-6 && std::abs(by_x) < 1e-6) y = j;
  }
  return x < 0 || y < 0 ? Json(nullptr) : Json({x, y});
}

Json json_of(const Robot& robot) {
  const ModelDescription& about = robot.bounded_description();
  Json json;
  json["name"] = about.name;
  json["source"] = about.source;
  json["states"] = json_of(about.states);
  json["inputs"] = json_of(about.inputs);
  json["parameters"] = json_of(about.parameters);
  json["outputs"] = json_of(about.outputs);
  json["roles"] = {{"position_x", about.roles.position_x},
                   {"position_y", about.roles.position_y},
                   {"heading", about.roles.heading},
                   {"speed", about.roles.speed},
                   {"speed_factor", about.roles.speed_factor}};
  json["position_outputs"] = position_outputs(*robot.model());
  return json;
}

Json json_of(const PluginChoice& choice) {
  Json json = {{"name", choice.name}};
  json["options"] = choice.options.is_null() ? Json::object() : sim::json_of(choice.options);
  std::string text = choice.name;
  for (const auto& [key, value] : json["options"].items())
    text += fmt::format(", {} {}", key, value.is_string() ? value.get<std::string>() : value.dump());
  json["text"] = text;
  return json;
}

Json settings_of(const Robot& robot, bool has_controller) {
  Json json;
  json["step"] = robot.step();
  json["estimator"] = robot.estimator_options().name;
  json["estimation_horizon"] = robot.estimator_options().horizon;
  const std::vector<std::shared_ptr<const Blocking>> blockings = robot.make_blockings();
  Json& list = json["blocking"] = Json::array();
  for (int j = 0; j < robot.model()->parameter_count(); ++j) {
    Json blocking = {{"parameter", robot.model()->description().parameters[j].name}};
    if (robot.has_blockings()) {
      blocking.update(json_of(robot.blocking_choice(j)));
      blocking["is_one_block"] = blockings[j]->is_one_block();
      blocking["transition"] = blockings[j]->transition() == Transition::ramp ? "ramp" : "step";
    } else {
      const std::string priors = robot.priors_text(j);
      blocking.update({{"name", "prior"},
                       {"options", Json::object()},
                       {"text", "a value at each node, prior " + priors},
                       {"is_one_block", false},
                       {"transition", "ramp"}});
    }
    list.push_back(std::move(blocking));
  }
  json["solvers"]["rhe"] = json_of(robot.solver_choice("rhe"));
  json["solvers"]["rhc"] = has_controller ? json_of(robot.solver_choice("rhc")) : Json(nullptr);
  return json;
}

Json json_or_null(const Settings& settings) { return settings.is_null() ? Json(nullptr) : sim::json_of(settings); }

/// Appends `"key":` and the output of `write`.
template <class Function>
void append_member(std::string& text, const char* key, const Function& write) {
  if (text.back() != '{') text += ',';
  text += '"';
  text += key;
  text += "\":";
  write();
}

template <class Function>
void append_column(std::string& text, int count, int decimals, const Function& value_of) {
  text += '[';
  for (int i = 0; i < count; ++i) {
    if (i > 0) text += ',';
    append_number(value_of(i), decimals, text);
  }
  text += ']';
}

struct Box {
  double left = std::numeric_limits<double>::infinity(), right = -left, bottom = left, top = -left;
  void add(double x, double y) {
    left = std::min(left, x);
    right = std::max(right, x);
    bottom = std::min(bottom, y);
    top = std::max(top, y);
  }
};

std::vector<PathPoint> points_of(const Path& path) {
  const double step = std::max(least_path_step, path.length() / most_path_points);
  std::vector<PathPoint> points;
  const int count = static_cast<int>(path.length() / step);
  for (int i = 0; i <= count; ++i) points.push_back(path.point_at(i * step));
  if (count * step < path.length()) points.push_back(path.point_at(path.length()));
  return points;
}

/// Slip of the ground in the area of the run, at the centres of square cells, row by row from the bottom.
void append_slip(const RunLog& log, const Scenario& scenario, const std::vector<PathPoint>& path, std::string& text) {
  const ModelDescription& about = scenario.robot().model()->description();
  Box box;
  for (const PathPoint& point : path) box.add(point.x, point.y);
  for (const Sample& sample : log.samples) {
    const double x = sample.true_state[about.roles.position_x], y = sample.true_state[about.roles.position_y];
    if (std::isfinite(x) && std::isfinite(y)) box.add(x, y);
  }
  const double width = box.right - box.left + 2.0 * map_margin, height = box.top - box.bottom + 2.0 * map_margin;
  const double cell = std::sqrt(width * height / most_cells);
  const int nx = std::max(1, static_cast<int>(width / cell)), ny = std::max(1, static_cast<int>(height / cell));
  const double dx = width / nx, dy = height / ny, x0 = box.left - map_margin + 0.5 * dx,
               y0 = box.bottom - map_margin + 0.5 * dy;
  const auto np = about.parameters.size();
  std::vector<double> values(static_cast<std::size_t>(nx) * ny * np);
  for (int iy = 0; iy < ny; ++iy)
    for (int ix = 0; ix < nx; ++ix)
      scenario.terrain().sample(x0 + ix * dx, y0 + iy * dy,
                                values.data() + (static_cast<std::size_t>(iy) * nx + ix) * np);
  text += '[';
  for (std::size_t j = 0; j < np; ++j) {
    if (j > 0) text += ',';
    text += '{';
    append_member(text, "parameter", [&] { append_quoted(about.parameters[j].name, text); });
    for (const auto& [key, value] : {std::pair{"x0", x0}, std::pair{"y0", y0}, std::pair{"dx", dx}, std::pair{"dy", dy},
                                     std::pair{"nx", double(nx)}, std::pair{"ny", double(ny)}})
      append_member(text, key, [&, value = value] { append_number(value, 6, text); });
    // Resolves a thousandth of the typical magnitude; more would only enlarge the file.
    const int decimals = std::max(0, decimals_for(about.parameters[j].scale) - 1);
    append_member(text, "values",
                  [&] { append_column(text, nx * ny, decimals, [&](int i) { return values[i * np + j]; }); });
    text += '}';
  }
  text += ']';
}

}  // namespace

std::string horizons_text(const HorizonLog& horizons, const RunLog& log, const Scenario& scenario) {
  const Robot& robot = scenario.robot();
  Json settings = settings_of(robot, true);
  settings["control_horizon"] = nullptr;
  settings["speed"] = scenario.options().speed;
  settings["seed"] = scenario.options().seed;
  settings["path"] = json_or_null(scenario.options().path);
  settings["terrain"] = json_or_null(scenario.options().terrain);
  std::string text = "{";
  append_member(text, "form", [&] { text += "\"rhec horizons\""; });
  append_member(text, "version", [&] { text += std::to_string(version); });
  append_member(text, "kind", [&] { text += "\"run\""; });
  append_member(text, "name", [&] { append_quoted(scenario.options().name, text); });
  append_member(text, "samples", [&] { text += std::to_string(log.samples.size()); });
  append_member(text, "variants", [&] { text += "[null]"; });
  append_member(text, "model", [&] { text += json_of(robot).dump(); });
  append_member(text, "settings", [&] { text += settings.dump(); });
  const std::vector<PathPoint> path = points_of(scenario.path());
  append_member(text, "path", [&] {
    text += "{\"x\":";
    append_column(text, static_cast<int>(path.size()), 4, [&](int i) { return path[i].x; });
    text += ",\"y\":";
    append_column(text, static_cast<int>(path.size()), 4, [&](int i) { return path[i].y; });
    text += '}';
  });
  append_member(text, "slip", [&] { append_slip(log, scenario, path, text); });
  text += "}\n";
  return text + horizons.nodes_line(0) + horizons.records();
}

namespace {

/// Of a recorded drive. A variant has a name and a robot.
template <class Variants>
std::string log_horizons_text(const std::vector<HorizonLog>& horizons, Json head, const std::string& name,
                              const Variants& variants, const HoldOut& hold_out,
                              const std::vector<std::string>& suffixes) {
  Json json;
  json["form"] = "rhec horizons";
  json["version"] = version;
  json["kind"] = "log";
  json["name"] = name;
  json.update(head);
  json["hold_out"] = {{"every", hold_out.every}, {"phase", hold_out.phase}};
  json["variants"] = Json::array();
  for (const auto& variant : variants)
    for (const std::string& suffix : suffixes) {
      Json about = {{"name", variant.name + suffix}};
      about["settings"] = settings_of(variant.robot, false);
      json["variants"].push_back(std::move(about));
    }
  json["model"] = json_of(variants.front().robot);
  std::string text = json.dump() + "\n";
  for (std::size_t i = 0; i < horizons.size(); ++i)
    text += horizons[i].nodes_line(static_cast<int>(i)) + horizons[i].records();
  return text;
}

}  // namespace

std::string horizons_text(const std::vector<HorizonLog>& horizons, const RecordedLog& log, const LogScenario& scenario,
                          const HoldOut& hold_out, const std::vector<std::string>& suffixes) {
  return log_horizons_text(horizons, {{"fixes", log.fixes.size()}}, scenario.name(), scenario.variants(), hold_out,
                           suffixes);
}

std::string horizons_text(const std::vector<HorizonLog>& horizons, const ReplayInput& input,
                          const std::vector<std::string>& suffixes) {
  return log_horizons_text(horizons, Json::object(), input.scenario.name(), input.scenario.variants(), input.hold_out,
                           suffixes);
}

}  // namespace rhec::sim
