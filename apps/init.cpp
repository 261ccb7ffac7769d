#include <unistd.h>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <iostream>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "commands.hpp"
#include "crash_report.hpp"
#include "output.hpp"
#include "rhec/core/base/error.hpp"
#include "rhec/plugins/host/host.hpp"
#include "rhec/plugins/robot/scenario_file.hpp"
#include "rhec/plugins/yaml/yaml.hpp"
#include "rhec/sim/files/json.hpp"
#include "rhec/sim/files/output_folder.hpp"
#include "rhec/sim/loop/scenario.hpp"
#include "rhec/sim/start/starter.hpp"

namespace rhec::apps {
namespace {

namespace fs = std::filesystem;

struct InitArguments {
  std::string folder, vehicle, sensors;
  std::vector<std::string> assignments;
  bool force = false, json = false;
  std::vector<fs::path> plugin_path;
};

constexpr const char* usual_vehicle = "bicycle_slip";

std::vector<std::string> words_of(std::string_view text) {
  std::vector<std::string> words;
  constexpr std::string_view gaps = ", \t";
  for (std::size_t from = text.find_first_not_of(gaps); from != std::string_view::npos;) {
    const std::size_t end = std::min(text.find_first_of(gaps, from), text.size());
    words.emplace_back(text.substr(from, end - from));
    from = text.find_first_not_of(gaps, end);
  }
  return words;
}

/// The answer to a question on the terminal; without one, `otherwise`.
std::string ask(const std::string& question, const std::string& otherwise) {
  fmt::print(stderr, "{} [{}] ", question, otherwise);
  std::fflush(stderr);
  std::string answer;
  std::getline(std::cin, answer);
  const std::vector<std::string> words = words_of(answer);
  return words.empty() ? otherwise : fmt::format("{}", fmt::join(words, ","));
}

void ask_for_vehicle(const Host& host, sim::StarterWishes& wishes) {
  fmt::print(stderr, "Vehicles:\n");
  for (const PluginRecord& plugin : host.discover())
    if (plugin.accepted() && plugin.kind == PluginKind::model)
      fmt::print(stderr, "  {:<20} {}\n", plugin.name, plugin.capabilities);
  wishes.vehicle = ask("Which one, or which file with a vehicle's equations?", usual_vehicle);
}

void ask_for_sensors(const Host& host, sim::StarterWishes& wishes) {
  const ModelDescription about = sim::starter_vehicle(host, wishes);
  std::vector<std::string> usual;
  fmt::print(stderr, "Sensors that it could have:\n");
  for (const Variable& output : about.outputs) {
    fmt::print(stderr, "  {:<20} {} [{}]\n", output.name, output.meaning, output.unit);
    if (output.usual) usual.push_back(output.name);
  }
  wishes.sensors = words_of(ask("Which ones, with commas between them?", fmt::format("{}", fmt::join(usual, ", "))));
}

void refuse_what_is_there(const fs::path& folder, bool force) {
  std::error_code none;  // what else is wrong with the folder is told where it is made
  for (const char* name : {sim::StarterFiles::robot_name, sim::StarterFiles::scenario_name})
    if (!force && fs::exists(folder / name, none))
      throw Error(fmt::format("{}: is there already; name another folder, or replace it with --force",
                              (folder / name).string()));
}

/// As a shell takes it for one word.
std::string in_shell(const std::string& word) {
  constexpr const char* plain = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-./+,:=@%";
  if (word.find_first_not_of(plain) == std::string::npos) return word;
  std::string quoted = "'";
  for (const char c : word) quoted += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return quoted + "'";
}

void tell(const fs::path& folder, const sim::StarterFiles& files) {
  const std::string robot = (folder / sim::StarterFiles::robot_name).string(),
                    scenario = (folder / sim::StarterFiles::scenario_name).string();
  fmt::print("{}: what the robot is; put its own lengths and noise there\n", robot);
  if (files.scenario.empty())
    fmt::print("no scenario: {}\n", files.why_no_scenario);
  else
    fmt::print("{}: a simulated drive\n", scenario);
  fmt::print("\nNext:\n  rhec check {}\n", in_shell(robot));
  if (!files.scenario.empty()) fmt::print("  rhec run {}\n", in_shell(scenario));
  fmt::print("  rhec log LOG --vehicle {}        which signals of a log are its sensors\n", robot);
}

int init(const InitArguments& arguments) {
  if (arguments.folder.empty()) throw Error("folder: found nothing; give the folder that the files shall go to");
  const fs::path folder(arguments.folder);
  refuse_what_is_there(folder, arguments.force);
  const Host host = examined_host(arguments.plugin_path);
  sim::StarterWishes wishes;
  wishes.folder = folder;
  wishes.name = fs::absolute(folder).lexically_normal().filename().string();
  if (wishes.name.empty()) wishes.name = fs::absolute(folder).lexically_normal().parent_path().filename().string();
  wishes.options = Settings::map({});
  apply_assignments(wishes.options, arguments.assignments);
  const bool asks = isatty(STDIN_FILENO) != 0 && isatty(STDERR_FILENO) != 0 && !arguments.json;
  wishes.vehicle = arguments.vehicle;
  if (wishes.vehicle.empty() && asks) ask_for_vehicle(host, wishes);
  if (wishes.vehicle.empty()) wishes.vehicle = usual_vehicle;
  wishes.sensors = words_of(arguments.sensors);
  if (wishes.sensors.empty() && arguments.vehicle.empty() && asks) ask_for_sensors(host, wishes);
  const sim::StarterFiles files = sim::starter_files(host, wishes);
  sim::OutputFolder out(folder);
  out.write(sim::StarterFiles::robot_name, files.robot);
  if (!files.scenario.empty()) out.write(sim::StarterFiles::scenario_name, files.scenario);
  out.commit();
  if (arguments.json) {
    sim::Json all{{"robot", (folder / sim::StarterFiles::robot_name).string()}};
    all["scenario"] =
        files.scenario.empty() ? sim::Json() : sim::Json((folder / sim::StarterFiles::scenario_name).string());
    print_json(all.dump(), folder);
  } else {
    tell(folder, files);
  }
  return exit_fine;
}

}  // namespace

void add_init(Program& program) {
  auto arguments = std::make_shared<InitArguments>();
  Command command = program.add(
      "init", "Writes the first files of a robot: what it is, and a simulated drive.",
      "Writes robot.yaml, with every number that the vehicle's model knows, and field.yaml, a scenario that names it, "
      "into\n"
      "the folder. Without --vehicle it asks for vehicle and sensors, if there is a terminal.\n\n"
      "Examples:\n"
      "  rhec init my_robot\n"
      "  rhec init my_robot --vehicle bicycle_slip --sensors x_gps,y_gps,yaw_rate --set wheelbase=2.8\n"
      "  rhec init my_robot --vehicle my_vehicle.yaml",
      [arguments] { return init(*arguments); });
  command.add("folder", arguments->folder, "a folder for the files, whose name is the robot's")
      .value("FOLDER")
      .required();
  command.add("--vehicle", arguments->vehicle, "a model of 'rhec plugins', or a vehicle's equations (*.yaml)")
      .value("NAME|FILE");
  command
      .add("--sensors", arguments->sensors,
           "outputs of the model, or parts of their names (gps: x_gps and y_gps), with commas between them; otherwise "
           "the "
           "usual ones")
      .value("A,B,...");
  add_assignments(command, arguments->assignments, "an option of the model");
  command.add_flag("--force", arguments->force, "replace files that are there");
  add_json(command, arguments->json);
  add_plugin_path(command, arguments->plugin_path);
}

}  // namespace rhec::apps
