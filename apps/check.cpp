#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "commands.hpp"
#include "crash_report.hpp"
#include "formula_views.hpp"
#include "rhec/core/base/error.hpp"
#include "rhec/plugins/equations/equations.hpp"
#include "rhec/plugins/host/host.hpp"
#include "rhec/plugins/robot/scenario_file.hpp"
#include "rhec/plugins/yaml/yaml.hpp"
#include "rhec/sim/check/model_check.hpp"
#include "rhec/sim/check/term_check.hpp"
#include "rhec/sim/loop/scenario.hpp"
#include "rhec/sim/world/truth_estimator.hpp"

namespace rhec::apps {
namespace {

using sim::Verdict;

struct CheckArguments {
  std::string model;
  std::vector<std::string> assignments;
  std::vector<std::filesystem::path> plugin_path;
  std::vector<std::string> vehicles;  ///< of a term
  int seed = 1;
  std::optional<double> speed;
  bool json = false, trace = false;
  std::vector<std::string> values;  ///< of a traced point
  GraphFile graph;
};

bool is_file(const std::string& name) {
  return name.ends_with(".yaml") || name.ends_with(".yml") || name.find('/') != std::string::npos;
}

/// A vehicle's equations are a file, too, but no scenario.
bool is_vehicle(const std::string& name) {
  return is_equations_file(name) && load_yaml(name).find("equations") != nullptr;
}
/// A robot with nothing but its model configured.
RobotOptions robot_of_model(const CheckArguments& arguments) {
  Settings model;
  apply_assignments(model, arguments.assignments);
  if (model.find("name"))
    throw model.find("name")->error("the model is named as the command's argument; expected its options");
  model.set("name", Settings::scalar(arguments.model, {arguments.model, 0}));
  RobotOptions options;
  options.model = std::move(model);
  return options;
}

/// The robot of a scenario, and its speed.
RobotOptions robot_of_scenario(const CheckArguments& arguments, std::optional<double>& speed) {
  Settings settings = load_scenario(arguments.model);
  apply_assignments(settings, arguments.assignments);
  const Settings* given = settings.find("speed");
  Settings robot = Settings::map(settings.origin());
  for (const auto& [key, value] : settings.members())
    if (key != "log" && key != "variants") robot.add(key, value);  // keys of recorded drives
  auto options =
      sim::ScenarioOptions::table().parse(settings.kind() == Settings::Kind::map ? robot : settings, "scenario");
  if (given && !speed) speed = options.speed;
  return options;
}

void print_findings(const std::vector<sim::Finding>& findings) {
  std::size_t name = 5;
  for (const sim::Finding& finding : findings) name = std::max(name, finding.check.size());
  fmt::print("{:<{}}  VERDICT  FOUND\n", "CHECK", name);
  for (const sim::Finding& finding : findings) {
    fmt::print("{:<{}}  {:<7}  {}{}\n", finding.check, name, word_of(finding.verdict),
               finding.where.empty() ? "" : finding.where + ": ", finding.found);
    if (!finding.advice.empty()) fmt::print("{:<{}}           -> {}\n", "", name, finding.advice);
  }
}

std::string sigma_text(double sigma) { return std::isfinite(sigma) ? fmt::format("{:.3g}", sigma) : "-"; }

/// The first few of a list, and how many more there are.
std::string some_of(const std::vector<std::string>& texts) {
  constexpr std::size_t few = 6;
  if (texts.empty()) return "-";
  const std::size_t shown = std::min(few, texts.size());
  const auto text =
      fmt::format("{}", fmt::join(texts.begin(), texts.begin() + static_cast<std::ptrdiff_t>(shown), "; "));
  return shown == texts.size() ? text : fmt::format("{}; and {} more", text, texts.size() - shown);
}

void print_drives(const sim::ModelCheck& check) {
  if (check.drives.empty()) return;
  fmt::print("\n{:<10} {:>9} {:>10}", "DRIVE", "RANK", "CONDITION");
  std::vector<std::size_t> widths;
  for (const std::string& parameter : check.parameters) {
    const std::string head = "sigma " + parameter;
    widths.push_back(std::max<std::size_t>(head.size(), 12));
    fmt::print(" {:>{}}", head, widths.back());
  }
  fmt::print("  NOT DETERMINED (in scales)\n");
  for (const sim::DriveInformation& drive : check.drives) {
    if (!drive.unusable.empty()) {
      fmt::print("{:<10} {}\n", drive.name, drive.unusable);
      continue;
    }
    fmt::print("{:<10} {:>9} {:>10.2g}", drive.name, fmt::format("{}/{}", drive.rank, drive.unknowns), drive.condition);
    for (std::size_t j = 0; j < widths.size(); ++j)
      fmt::print(" {:>{}}", sigma_text(drive.parameter_sigma[j]), widths[j]);
    fmt::print("  {}\n", some_of(drive.undetermined));
  }
}

std::string time_text(const sim::Spread& spread) {
  return std::isfinite(spread.median) ? fmt::format("{:.0f}/{:.0f}", spread.median, spread.p99) : "-";
}

void print_times(const sim::ModelCheck& check) {
  if (check.times.empty()) return;
  fmt::print("\n{:<10} {:>14} {:>14} {:>14} {:>14}   median/p99 of one stage [ns]\n", "TIME", "VALUES", "JACOBIANS",
             "HESSIANS", "OUTPUTS");
  for (const sim::EvaluationTimes& times : check.times)
    fmt::print("{:<10} {:>14} {:>14} {:>14} {:>14}\n", times.instruction_set, time_text(times.values),
               time_text(times.jacobians), time_text(times.hessians), time_text(times.outputs));
}

void print_vehicles(const sim::TermCheck& check) {
  if (check.vehicles.empty()) return;
  std::size_t name = 7;
  for (const sim::TermOnVehicle& each : check.vehicles) name = std::max(name, each.vehicle.size());
  fmt::print("\n{:<{}} {:>7} {:>6} {:>5} {:>14} {:>14} {:>14}   median/p99 of one stage [ns]\n", "VEHICLE", name,
             "LIMITS", "COSTS", "DATA", "VALUES", "JACOBIANS", "HESSIANS");
  for (const sim::TermOnVehicle& each : check.vehicles)
    fmt::print("{:<{}} {:>7} {:>6} {:>5} {:>14} {:>14} {:>14}\n", each.vehicle, name, each.limits, each.costs,
               each.data, time_text(each.values), time_text(each.jacobians), time_text(each.hessians));
}

/// Where a formula is looked at: where a simulated drive starts, or at the origin; straight ahead at the speed.
sim::FormulaPoint start_of(const Host& host, const CheckArguments& arguments, bool is_scenario, const Robot& robot,
                           Model& model, std::optional<double> speed) {
  const ModelDescription& about = robot.bounded_description();
  sim::FormulaPoint point = sim::straight_point(model, about, speed);
  if (is_scenario) {
    Settings settings = load_scenario(arguments.model);
    apply_assignments(settings, arguments.assignments);
    if (settings.find("path")) {
      const Path path = sim::Scenario(host, settings).path();
      const PathPoint start = path.point_at(0.0);
      about.roles.place(start.x, start.y, start.heading, point.states.data());
    }
  }
  apply_values(arguments.values, about, point);
  return point;
}

/// A term of the section that a configuration would have for it.
Settings section_of_term(const CheckArguments& arguments) {
  Settings options;
  apply_assignments(options, arguments.assignments);
  if (const Settings* name = options.find("name"))
    throw name->error("the term is named as the command's argument; expected its options");
  Settings section = sim::section_of_term(arguments.model);
  apply_assignments(section, arguments.assignments);
  return section;
}

void print_term(const sim::TermCheck& found) {
  print_findings(found.findings);
  print_vehicles(found);
  fmt::print("\n{}: {} failed, {} warnings\n", found.term, found.count(Verdict::fail), found.count(Verdict::warn));
}

int check_term(const Host& host, const CheckArguments& arguments) {
  if (arguments.graph)
    throw Error("--graph: it draws the formula of a model; of a term --trace prints it node by node");
  if (arguments.speed) throw Error("--speed: it is for a model, which is driven; a term is not");
  const Settings section = section_of_term(arguments);
  std::vector<std::shared_ptr<const Model>> vehicles;
  for (const std::string& name : arguments.vehicles) vehicles.push_back(host.make_model(name));
  if (arguments.trace) {
    if (vehicles.size() != 1)
      throw Error("--trace: a term is traced on one vehicle; name it, as in --vehicle bicycle_slip");
    const auto vehicle = host.make_model(arguments.vehicles.front());
    const sim::TermGraph graph = sim::graph_of_term(host, section, *vehicle);
    sim::FormulaPoint point = sim::straight_point(*vehicle, vehicle->description(), {});
    apply_values(arguments.values, graph.about, point);
    return show_trace(graph.formula, graph.about, point, "limits and costs", arguments.json);
  }
  const sim::TermCheck found =
      sim::check_term(host, section, vehicles, {.seed = static_cast<std::uint64_t>(arguments.seed)});
  if (arguments.json) {
    fmt::print("{}\n", sim::check_json(found));
  } else {
    print_term(found);
  }
  return found.verdict() == Verdict::fail ? exit_not_solved : exit_fine;
}

/// The terms of a scenario's controller, on its vehicle.
std::vector<sim::TermCheck> check_terms(const Host& host, const CheckArguments& arguments, const Settings& controller,
                                        const Robot& robot) {
  std::vector<sim::TermCheck> checks;
  const Settings* terms = controller.find("terms");
  if (!terms || terms->kind() != Settings::Kind::list) return checks;
  for (const Settings& section : terms->items())
    checks.push_back(
        sim::check_term(host, section, {robot.model()}, {.seed = static_cast<std::uint64_t>(arguments.seed)}));
  return checks;
}

int check(const CheckArguments& arguments) {
  const Host host = examined_host(arguments.plugin_path);
  if (sim::is_name_of_term(host, arguments.model)) return check_term(host, arguments);
  if (!arguments.vehicles.empty())
    throw Error(fmt::format("--vehicle: it is for a term, which is looked at on it; '{}' is none", arguments.model));
  sim::ModelCheckOptions options;
  options.seed = static_cast<std::uint64_t>(arguments.seed);
  options.speed = arguments.speed;
  const bool is_scenario = is_file(arguments.model) && !is_vehicle(arguments.model);
  const RobotOptions robot_options =
      is_scenario ? robot_of_scenario(arguments, options.speed) : robot_of_model(arguments);
  const Robot robot(host, robot_options, sim::scenario_estimators());
  if (arguments.graph) return show_graph(*robot.model(), *arguments.graph, arguments.json);
  if (arguments.trace) {
    const PluginChoice choice = robot.model_choice();
    const std::shared_ptr<Model> model = host.make_model(choice.name, choice.options);
    return show_trace(*model, start_of(host, arguments, is_scenario, robot, *model, options.speed), arguments.json);
  }
  const sim::ModelCheck found = sim::check_model(host, robot, options);
  const std::vector<sim::TermCheck> terms = check_terms(host, arguments, robot_options.controller, robot);
  if (arguments.json) {
    fmt::print("{}\n", sim::check_json(found, terms));
  } else {
    print_findings(found.findings);
    print_drives(found);
    print_times(found);
    fmt::print("\n{}: {} failed, {} warnings\n", found.model, found.count(Verdict::fail), found.count(Verdict::warn));
    for (const sim::TermCheck& term : terms) {
      fmt::print("\nTERM {}\n", term.term);
      print_term(term);
    }
  }
  const bool fails = found.verdict() == Verdict::fail ||
                     std::ranges::any_of(terms, [](const auto& term) { return term.verdict() == Verdict::fail; });
  return fails ? exit_not_solved : exit_fine;
}

}  // namespace

void add_check(Program& program) {
  auto arguments = std::make_shared<CheckArguments>();
  Command command = program.add(
      "check",
      "Looks at a model, or a term, before its first run: derivatives, scales, NaN, what can be estimated, time.",
      "The exit code is 3 where a check fails, or a traced number is not finite; warnings are no failure. "
      "docs/check.md\n"
      "explains each check.\n\n"
      "Examples:\n"
      "  rhec check bicycle_slip\n"
      "  rhec check bicycle_slip --set wheelbase=2.8 --set gps_offset=0\n"
      "  rhec check my_vehicle.yaml\n"
      "  rhec check scenarios/figure8.yaml --set bounds.delta='[-1.5, 1.5]'\n"
      "  rhec check my_model --plugin-path build/my_model --json\n"
      "  rhec check corridor --set left=3\n"
      "  rhec check my_term.yaml --vehicle my_vehicle.yaml\n"
      "  rhec check my_vehicle.yaml --trace --at v=0 --at delta=0.3\n"
      "  rhec check scenarios/figure8.yaml --graph",
      [arguments] { return check(*arguments); });
  command
      .add("model", arguments->model,
           "a model plugin, a vehicle's equations (*.yaml), or a scenario (*.yaml), whose model is looked at with its "
           "noise, bounds, step, horizon and blocking, and the terms of its controller; or a term plugin, or a term's "
           "equations (*.yaml)")
      .value("MODEL")
      .required();
  add_assignments(command, arguments->assignments, "an option of the model or the term, or a key of the scenario");
  command.add("--seed", arguments->seed, "of random points").not_negative().shows_default();
  command
      .add("--speed", arguments->speed,
           "ground speed of the drives [m/s]; else the scenario's, or what the inputs' scales make")
      .positive();
  command
      .add_list(
          "--vehicle", arguments->vehicles,
          "of a term: a model plugin or a vehicle's equations to look at it on; may be given several times; without "
          "it all model plugins that are found")
      .value("MODEL");
  command.add_flag("--json", arguments->json, "print JSON");
  const Argument trace = command.add_flag("--trace", arguments->trace,
                                          "instead of the checks, print every node of the formula of the model, or of "
                                          "the term on one --vehicle, at the start "
                                          "of the drive, and the first that is not finite");
  command
      .add_list("--at", arguments->values,
                "with --trace: the value of a state, an input or a parameter; may be given several times")
      .value("VARIABLE=NUMBER")
      .needs(trace);
  command
      .add_optional(
          "--graph", arguments->graph,
          "instead of the checks, print operations, depth and sparsity of the model's formula, and draw it if a "
          "file is named")
      .value("[FILE.svg]");
  add_plugin_path(command, arguments->plugin_path);
}

}  // namespace rhec::apps
