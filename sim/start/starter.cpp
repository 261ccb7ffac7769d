#include "rhec/sim/start/starter.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <optional>
#include <utility>

#include "rhec/core/base/error.hpp"
#include "rhec/core/config/option_values.hpp"
#include "rhec/plugins/equations/equations.hpp"
#include "rhec/plugins/robot/noise_section.hpp"
#include "rhec/sim/files/json.hpp"

namespace rhec::sim {
namespace {

/// A text as YAML has it: in quotes where it would be read as something else, as {x}, #x or null would.
std::string scalar(const std::string& text) {
  const auto is_plain = [](char c) {
    return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_' || c == '-' || c == '.' || c == '/';
  };
  const bool begins = !text.empty() && text.front() != '-';
  if (begins && std::all_of(text.begin(), text.end(), is_plain) && text != "null" && text != "Null" && text != "NULL")
    return text;
  return Json(text).dump();
}

/// For a comment.
std::string on_one_line(std::string text) {
  std::replace_if(
      text.begin(), text.end(), [](unsigned char c) { return std::iscntrl(c) != 0; }, ' ');
  return text;
}

/// Lines of YAML whose comments stand below each other.
class CommentedLines {
 public:
  void add(const std::string& line, const std::string& comment = {}) { lines_.emplace_back(line, comment); }
  std::string text() const {
    std::size_t width = 0;
    for (const auto& [line, comment] : lines_)
      if (!comment.empty() && line.size() <= widest) width = std::max(width, line.size());
    std::string text;
    for (const auto& [line, comment] : lines_)
      text += comment.empty() ? line + "\n" : fmt::format("{:<{}}  # {}\n", line, width, comment);
    return text;
  }

 private:
  static constexpr std::size_t widest = 44;
  std::vector<std::pair<std::string, std::string>> lines_;
};

std::string with_unit(const Variable& variable) {
  const std::string what = variable.meaning.empty() ? variable.name : variable.meaning;
  return variable.unit == "1" || variable.unit.empty() ? what : fmt::format("{} [{}]", what, variable.unit);
}

/// Three digits, as one would type them.
std::string short_number(double value) { return fmt::format("{:.3g}", value); }

std::string bounds_text(double lower, double upper) {
  const auto number = [](double value) { return std::isfinite(value) ? fmt::format("{:.6g}", value) : "null"; };
  return fmt::format("[{}, {}]", number(lower), number(upper));
}

std::shared_ptr<Model> make_vehicle(const Host& host, const StarterWishes& wishes, const std::string& outputs) {
  Settings options = wishes.options.is_null() ? Settings::map() : wishes.options;
  options.set("outputs", Settings::scalar(outputs));
  return host.make_model(wishes.vehicle, options);
}

/// Whether an output is meant by a word: its name, or a part of that, such as the gps of x_gps and y_gps.
bool is_meant(const std::string& output, const std::string& word) {
  return !word.empty() && ("_" + output + "_").find("_" + word + "_") != std::string::npos;
}

/// The outputs that are measured, in the model's order.
std::vector<Variable> chosen_sensors(const StarterWishes& wishes, const ModelDescription& about) {
  const std::vector<std::string> known = names_of(about.outputs);
  for (const std::string& name : wishes.sensors) {
    if (std::ranges::any_of(known, [&](const std::string& output) { return is_meant(output, name); })) continue;
    const std::string near = nearest(name, known);
    throw Error(fmt::format("the vehicle '{}' has no sensor '{}'; {}", wishes.vehicle, name,
                            near.empty() ? fmt::format("it could have {}", fmt::join(known, ", "))
                                         : fmt::format("did you mean '{}'?", near)));
  }
  std::vector<Variable> chosen;
  for (const Variable& output : about.outputs) {
    const bool is_named =
        std::ranges::any_of(wishes.sensors, [&](const std::string& word) { return is_meant(output.name, word); });
    if (wishes.sensors.empty() ? output.usual : is_named) chosen.push_back(output);
  }
  return chosen;
}

/// Option by option: what was asked for, or the default.
void add_options(const Host& host, const StarterWishes& wishes, CommentedLines& lines) {
  for (const OptionRow& option : host.options(PluginKind::model, wishes.vehicle)) {
    if (option.name == "outputs") continue;
    const Settings* given = wishes.options.find(option.name);
    const std::string value = given ? scalar(given->text()) : option.default_value;
    if (value.empty()) continue;
    lines.add(fmt::format("  {}: {}", option.name, value), option.meaning);
  }
}

void add_model(const Host& host, const StarterWishes& wishes, const ModelDescription& about,
               const std::vector<Variable>& sensors, CommentedLines& lines) {
  lines.add("model:");
  if (is_equations_file(wishes.vehicle)) {
    const std::filesystem::path file =
        std::filesystem::absolute(wishes.vehicle).lexically_relative(std::filesystem::absolute(wishes.folder));
    lines.add(fmt::format("  equations: {}", scalar(file.string())), "relative to this file");
  } else {
    lines.add(fmt::format("  name: {}", wishes.vehicle), fmt::format("rhec plugins {}", wishes.vehicle));
  }
  add_options(host, wishes, lines);
  std::vector<std::string> others;
  for (const Variable& output : about.outputs)
    if (std::none_of(sensors.begin(), sensors.end(), [&](const Variable& one) { return one.name == output.name; }))
      others.push_back(output.name);
  lines.add(fmt::format("  outputs: [{}]", fmt::join(names_of(sensors), ", ")),
            others.empty() ? "what is measured: all that this vehicle could have"
                           : fmt::format("what is measured; it could have {}, too", fmt::join(others, ", ")));
  lines.add("");
}

void add_noise(const std::vector<Variable>& sensors, const std::vector<Variable>& inputs, CommentedLines& lines) {
  lines.add("noise:", "standard deviations: of data sheets, or found in a log by 'rhec tune'");
  for (const auto& [section, variables] : {std::pair("outputs", &sensors), std::pair("inputs", &inputs)}) {
    lines.add(fmt::format("  {}:", section));
    const std::vector<double> sigmas = default_sigmas(*variables);
    for (std::size_t j = 0; j < variables->size(); ++j)
      lines.add(fmt::format("    {}: {}", (*variables)[j].name, short_number(sigmas[j])), with_unit((*variables)[j]));
  }
  lines.add("");
}

void add_bounds(const ModelDescription& about, CommentedLines& lines) {
  lines.add("bounds:", "[lower, upper]; null for none");
  for (const std::vector<Variable>* variables : {&about.states, &about.inputs, &about.parameters})
    for (const Variable& variable : *variables)
      if (std::isfinite(variable.lower) || std::isfinite(variable.upper))
        lines.add(fmt::format("  {}: {}", variable.name, bounds_text(variable.lower, variable.upper)),
                  with_unit(variable));
  lines.add("");
}

bool has_bounds(const ModelDescription& about) {
  const auto bounded = [](const Variable& variable) {
    return std::isfinite(variable.lower) || std::isfinite(variable.upper);
  };
  return std::any_of(about.states.begin(), about.states.end(), bounded) ||
         std::any_of(about.inputs.begin(), about.inputs.end(), bounded) ||
         std::any_of(about.parameters.begin(), about.parameters.end(), bounded);
}

std::string robot_text(const Host& host, const StarterWishes& wishes, const ModelDescription& about,
                       const std::vector<Variable>& sensors) {
  CommentedLines lines;
  lines.add(
      fmt::format("# {}: what the robot is, and how it is estimated and controlled. 'rhec options' lists every key.",
                  on_one_line(wishes.name)));
  lines.add("step: 0.2", "[s] between the estimator's nodes, and between the controller's inputs");
  lines.add("");
  add_model(host, wishes, about, sensors, lines);
  add_noise(sensors, about.inputs, lines);
  if (has_bounds(about)) add_bounds(about, lines);
  lines.add("estimator:");
  lines.add("  name: rhe", "rhe | ekf | bank; 'rhec options estimator'");
  lines.add("  horizon: 15", "intervals of the window; also a time, '3 s'");
  if (!about.parameters.empty()) {
    lines.add("  initial:");
    std::vector<std::string> values;
    for (const Variable& parameter : about.parameters)
      values.push_back(fmt::format("{}: {}", parameter.name, short_number(parameter.nominal)));
    lines.add(fmt::format("    parameters: {{{}}}", fmt::join(values, ", ")),
              "before anything is known: nothing slips");
    if (about.roles.heading >= 0)
      lines.add(fmt::format("    # state: {{{}: 0}}", about.states[static_cast<std::size_t>(about.roles.heading)].name),
                "where it heads [rad], if you know; else it is lost until a sensor or its motion tells");
  }
  lines.add("");
  lines.add("controller:");
  lines.add("  horizon: 15", "intervals of the plan; 'rhec options controller'");
  lines.add("  solver: {name: gn_rti, iterations: 5, residual: 0.01}");
  return lines.text();
}

/// Ground speed that suits the vehicle: that of its inputs' scale.
double usual_speed(const ModelDescription& about) {
  constexpr double otherwise = 1.0, quickest = 8.0;
  const Roles& roles = about.roles;
  if (roles.speed >= 0) return std::min(quickest, about.inputs[static_cast<std::size_t>(roles.speed)].scale);
  if (roles.speed_state >= 0)
    return std::min(quickest, about.states[static_cast<std::size_t>(roles.speed_state)].scale);
  return otherwise;
}

/// How far a parameter varies over the simulated ground: a part of its range, on the side of more slip for a ratio.
std::pair<double, double> ground_range(const Variable& parameter) {
  const double nominal = parameter.nominal;
  if (nominal == 1.0) return {std::max(0.7, parameter.lower), 1.0};
  const auto part = [&](double bound, double otherwise) {
    return std::isfinite(bound) ? nominal + 0.3 * (bound - nominal) : otherwise;
  };
  return {part(parameter.lower, nominal - 0.1 * parameter.scale),
          part(parameter.upper, nominal + 0.1 * parameter.scale)};
}

std::string scenario_text(const StarterWishes& wishes, const ModelDescription& about) {
  const double speed = usual_speed(about);
  CommentedLines lines;
  lines.add(fmt::format("# Drives {} over simulated ground that slips: rhec run {}", on_one_line(wishes.name),
                        on_one_line((wishes.folder / StarterFiles::scenario_name).string())));
  lines.add(fmt::format("robot: {}", StarterFiles::robot_name), "its keys are as if they stood here");
  lines.add(fmt::format("name: {}", scalar(wishes.name)));
  lines.add(fmt::format("speed: {}", short_number(speed)), "over ground [m/s]");
  lines.add("seed: 1", "of ground and noise");
  lines.add("");
  lines.add("path:", "figure8 | zigzag | headland | file");
  lines.add("  name: figure8");
  lines.add(fmt::format("  radius: {}", short_number(std::max(5.0, 3.0 * speed))), "[m]");
  lines.add("  laps: 1");
  if (about.parameters.empty()) return lines.text();
  lines.add("");
  lines.add("terrain:", "the true slip, as a function of the place");
  lines.add("  name: gaussian", "gaussian | patches | constant | raster | split");
  lines.add("  correlation_length: 10", "[m]");
  lines.add("  ranges:");
  for (const Variable& parameter : about.parameters) {
    const auto [lower, upper] = ground_range(parameter);
    lines.add(fmt::format("    {}: [{}, {}]", parameter.name, short_number(lower), short_number(upper)),
              with_unit(parameter));
  }
  return lines.text();
}

std::string why_no_drive(const ModelDescription& about) {
  const Roles& roles = about.roles;
  if (roles.position_x >= 0 && roles.position_y >= 0 && roles.heading >= 0) return {};
  return fmt::format(
      "the vehicle '{}' does not say which of its states are position and heading, so it cannot follow a path; it can "
      "be "
      "estimated from a log",
      about.name);
}

}  // namespace

ModelDescription starter_vehicle(const Host& host, const StarterWishes& wishes) {
  return make_vehicle(host, wishes, "all")->description();
}

StarterFiles starter_files(const Host& host, const StarterWishes& wishes) {
  const ModelDescription about = starter_vehicle(host, wishes);
  StarterFiles files;
  files.robot = robot_text(host, wishes, about, chosen_sensors(wishes, about));
  files.why_no_scenario = why_no_drive(about);
  if (files.why_no_scenario.empty()) files.scenario = scenario_text(wishes, about);
  return files;
}

}  // namespace rhec::sim
