#include "drive_arguments.hpp"

#include <fmt/format.h>

#include <filesystem>

#include "commands.hpp"
#include "crash_report.hpp"
#include "rhec/core/base/error.hpp"
#include "rhec/logs/files/open_log.hpp"
#include "rhec/plugins/robot/scenario_file.hpp"
#include "rhec/plugins/yaml/yaml.hpp"

namespace rhec::apps {
namespace {

sim::ReplayScenario read_replay_scenario(const LogArguments& arguments) {
  Settings settings = load_scenario(arguments.scenario);
  apply_assignments(settings, arguments.assignments);
  return {examined_host(arguments.plugin_path), settings, arguments.variants};
}

}  // namespace

void add_tracks(Command& command, TrackArguments& arguments) {
  command.add("--mcap", arguments.mcap, "write the estimates as ROS 2 messages, for Foxglove and PlotJuggler")
      .value("FILE");
  command.add("--csv", arguments.csv, "write the estimates as a table with a column `time`, for PlotJuggler")
      .value("FILE");
  command.add("--tum", arguments.tum, "write the trajectory in TUM's form, for evo").value("FILE");
}

Tracks::Tracks(const TrackArguments& arguments, const Robot& robot, const Path* reference) : robot_(robot) {
  if (!arguments.mcap.empty()) writers_.push_back(sim::open_track_mcap(arguments.mcap, robot, reference));
  if (!arguments.csv.empty()) writers_.push_back(sim::open_track_csv(arguments.csv, robot));
  if (!arguments.tum.empty()) writers_.push_back(sim::open_track_tum(arguments.tum, robot));
}

void Tracks::write(const sim::TrackSample& sample) {
  for (const auto& writer : writers_) writer->write(sample);
}

void Tracks::take(const sim::LoopSample& sample, logs::Stamp start) {
  if (!writers_.empty() && sample.estimate->state.size() > 0) write(sim::track_sample(sample, robot_, start));
}

void Tracks::commit() {
  for (const auto& writer : writers_) writer->close();
}

std::unique_ptr<logs::Log> open_log(const std::string& file, const std::vector<std::string>& msg_paths) {
  return logs::open_log(file, {.msg_paths = {msg_paths.begin(), msg_paths.end()}});
}

void add_msg_paths(Command& command, std::vector<std::string>& paths) {
  command
      .add_list("--msg-path", paths,
                "look here for definitions of messages that a bag does not bring; may be given several times")
      .value("DIR");
}

void tell_damage(const std::optional<logs::Damage>& damage) {
  if (damage) fmt::print(stderr, "rhec: warning: {}\n", damage->what);
}

sim::ReplayInput read_replay_input(const LogArguments& arguments) {
  sim::ReplayInput input(read_replay_scenario(arguments), read_hold_out(arguments),
                         *open_log(arguments.log, arguments.msg_paths));
  tell_damage(input.drives.front().damage);
  return input;
}

bool names_log(const LogArguments& arguments, const char* command) {
  const bool has_files = !arguments.dead_reckoning.empty() && !arguments.gps.empty();
  if (!arguments.log.empty() && (!arguments.dead_reckoning.empty() || !arguments.gps.empty()))
    throw Error("found a log, and --dead-reckoning or --gps; give the one or the other");
  if (!arguments.log.empty() || has_files) return true;
  std::string told;
  if (std::filesystem::exists(arguments.scenario)) {
    const Settings scenario = load_scenario(arguments.scenario);
    for (const char* key : {"path", "terrain", "speed"})
      if (told.empty() && scenario.find(key))
        told = fmt::format("; {} is a scenario of a simulated drive, which is for 'rhec run'", arguments.scenario);
  }
  fmt::print(stderr, "rhec: error: no log{}; give one, or --dead-reckoning and --gps; see 'rhec {} --help'\n", told,
             command);
  return false;
}

}  // namespace rhec::apps
