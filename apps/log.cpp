#include <fmt/format.h>

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "commands.hpp"
#include "crash_report.hpp"
#include "drive_arguments.hpp"
#include "output.hpp"
#include "rhec/logs/mapping/proposal.hpp"
#include "rhec/logs/signals/survey.hpp"
#include "rhec/plugins/host/host.hpp"
#include "rhec/plugins/robot/scenario_file.hpp"
#include "rhec/plugins/yaml/yaml.hpp"
#include "rhec/sim/files/json.hpp"
#include "rhec/sim/replay/replay_scenario.hpp"
#include "rhec/sim/world/truth_estimator.hpp"

namespace rhec::apps {
namespace {

struct InspectArguments {
  std::string log, vehicle;
  bool json = false;
  std::vector<std::string> msg_paths;
  std::vector<std::filesystem::path> plugin_path;
};

/// 1700000000123456789 as "1700000000.123".
std::string seconds(logs::Stamp stamp) { return fmt::format("{:.3f}", 1e-9 * static_cast<double>(stamp)); }

void print_topic(const logs::TopicSurvey& topic) {
  const bool is_table = topic.topic.name.empty();
  fmt::print("\n{}", is_table ? "columns" : fmt::format("{}  {}", topic.topic.name, topic.topic.type));
  fmt::print(": {} records", topic.count);
  if (topic.usual_interval > 0.0)
    fmt::print(", {:.4g} 1/s, longest gap {:.3g} s, {:.3f} s after the start", 1.0 / topic.usual_interval,
               topic.longest_gap, topic.gap_start);
  if (topic.largest_lateness > 1e-3) fmt::print(", received up to {:.3g} s after the stamp", topic.largest_lateness);
  if (topic.backwards > 0) fmt::print(", {} stamps before the one before", topic.backwards);
  fmt::print("\n");
  if (topic.broken > 0) fmt::print("  {} of them cannot be read, the first: {}\n", topic.broken, topic.first_broken);
  if (!topic.unreadable.empty()) fmt::print("  not understood: {}\n", topic.unreadable);
  for (const logs::FieldSurvey& field : topic.fields) {
    const std::string missing = field.count < topic.count ? fmt::format(", {} missing", topic.count - field.count) : "";
    const std::string unit = field.unit.empty() ? "" : fmt::format(" [{}]", field.unit);
    const std::string name = (is_table ? field.name : topic.topic.name + ":" + field.name) + unit;
    if (field.count == 0)
      fmt::print("  {:<48} no value\n", name);
    else if (field.least == field.most)
      fmt::print("  {:<48} {:.9g}{}\n", name, field.least, missing);
    else
      fmt::print("  {:<48} {:.9g} to {:.9g}{}\n", name, field.least, field.most, missing);
  }
}

/// The variables of a vehicle: of a scenario's file, of a file with equations, or of a model plugin.
ModelDescription description_of(const InspectArguments& arguments) {
  const Host host = examined_host(arguments.plugin_path);
  Settings settings;
  if (std::filesystem::is_regular_file(arguments.vehicle)) {
    if (load_yaml(arguments.vehicle).find("equations"))
      settings.set("model.equations", Settings::scalar(arguments.vehicle));
    else
      settings = load_scenario(arguments.vehicle);
  } else {
    settings.set("model.name", Settings::scalar(arguments.vehicle));
  }
  return sim::ReplayScenario(host, settings).variants().front().robot.model()->description();
}

sim::Json json_of(const logs::TopicSurvey& topic) {
  sim::Json fields = sim::Json::array();
  for (const logs::FieldSurvey& field : topic.fields) {
    sim::Json one{{"name", field.name}, {"values", field.count}};
    if (!field.unit.empty()) one["unit"] = field.unit;
    if (field.count > 0) {
      one["least"] = field.least;
      one["most"] = field.most;
    }
    fields.push_back(std::move(one));
  }
  return {{"topic", topic.topic.name},
          {"type", topic.topic.type},
          {"records", topic.count},
          {"usual_interval", topic.usual_interval},
          {"longest_gap", topic.longest_gap},
          {"gap_start", topic.gap_start},
          {"largest_lateness", topic.largest_lateness},
          {"backwards", topic.backwards},
          {"broken", topic.broken},
          {"not_understood", topic.unreadable},
          {"fields", fields}};
}

/// Everything that the tables have; the proposal as the text that goes into a scenario.
sim::Json json_of(const logs::Survey& survey, const InspectArguments& arguments) {
  sim::Json topics = sim::Json::array();
  for (const logs::TopicSurvey& topic : survey.topics) topics.push_back(json_of(topic));
  sim::Json all{{"log", arguments.log}, {"topics", topics}};
  if (survey.first != logs::no_stamp) {
    all["first"] = seconds(survey.first);
    all["last"] = seconds(survey.last);
  }
  if (!arguments.vehicle.empty()) all["signals"] = logs::propose_signals(survey, description_of(arguments));
  return all;
}

int inspect(const InspectArguments& arguments) {
  const auto log = open_log(arguments.log, arguments.msg_paths);
  const logs::Survey survey = logs::survey(*log);
  if (arguments.json) {
    fmt::print("{}\n", json_of(survey, arguments).dump(2));
    tell_damage(survey.damage);
    return exit_fine;
  }
  std::int64_t records = 0;
  for (const logs::TopicSurvey& topic : survey.topics) records += topic.count;
  fmt::print("{}: {} records", arguments.log, records);
  if (survey.first != logs::no_stamp)
    fmt::print(", {:.3f} s, from {} to {}", logs::seconds_between(survey.first, survey.last), seconds(survey.first),
               seconds(survey.last));
  fmt::print("\n");
  for (const logs::TopicSurvey& topic : survey.topics) print_topic(topic);
  tell_damage(survey.damage);
  if (arguments.vehicle.empty()) {
    fmt::print("\n'rhec log {} --vehicle NAME' proposes which signals are a vehicle's outputs and inputs\n",
               arguments.log);
  } else {
    fmt::print(
        "\n# A proposal; look at each line, at units and signs above all. Put it into the vehicle's scenario.\n{}",
        logs::propose_signals(survey, description_of(arguments)));
  }
  return exit_fine;
}

}  // namespace

void add_log(Program& program) {
  auto arguments = std::make_shared<InspectArguments>();
  Command command = program.add(
      "log", "Lists what is in a log: topics or columns, rates, gaps, ranges; and proposes a mapping to a vehicle.",
      "A log is a table with a header (CSV), MCAP, or a bag of rosbag2 (.db3, or its folder). What a proposal prints "
      "is the\n"
      "section `signals` of a scenario, which 'rhec estimate SCENARIO LOG' reads by.\n\n"
      "Examples:\n"
      "  rhec log drive.mcap\n"
      "  rhec log my_bag --vehicle bicycle_slip\n"
      "  rhec log drive.csv --vehicle my_robot.yaml",
      [arguments] { return inspect(*arguments); });
  command.add("log", arguments->log, "a file, or the folder of a bag").required().value("LOG");
  command.add("--vehicle", arguments->vehicle, "propose `signals` for this model, or for that of this scenario")
      .value("NAME|FILE");
  add_json(command, arguments->json);
  add_msg_paths(command, arguments->msg_paths);
  add_plugin_path(command, arguments->plugin_path);
}

}  // namespace rhec::apps
