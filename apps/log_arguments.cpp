#include "log_arguments.hpp"

#include <fmt/format.h>

#include "commands.hpp"
#include "crash_report.hpp"
#include "drive_arguments.hpp"
#include "output.hpp"
#include "rhec/core/base/error.hpp"
#include "rhec/plugins/host/host.hpp"
#include "rhec/plugins/robot/scenario_file.hpp"
#include "rhec/plugins/yaml/yaml.hpp"

namespace rhec::apps {

sim::LogScenario read_log_scenario(const LogArguments& arguments) {
  Settings settings = load_scenario(arguments.scenario);
  apply_assignments(settings, arguments.assignments);
  return {examined_host(arguments.plugin_path), settings, arguments.variants};
}

sim::HoldOut read_hold_out(const LogArguments& arguments) {
  const int usual = arguments.log.empty() ? 0 : default_hold_out;
  const int every = arguments.hold_out >= 0 ? arguments.hold_out : usual;
  const int phase = arguments.phase >= 0 ? arguments.phase : every - 1;
  if (every > 0 && phase >= every)
    throw Error(fmt::format("--hold-out-phase {} with --hold-out {}; expected a number below it", phase, every));
  return {every, phase};
}

LogInput::LogInput(const LogArguments& arguments)
    : scenario(read_log_scenario(arguments)),
      hold_out(read_hold_out(arguments)),
      log(sim::read_recorded_log(arguments.dead_reckoning, arguments.gps, scenario)) {}

void add_log_arguments(Command& command, const std::string& name, LogArguments& arguments,
                       const std::string& usual_hold_out) {
  command.add("scenario", arguments.scenario, "a YAML file").required();
  command.add("log", arguments.log, "a table (CSV), MCAP, or a bag of rosbag2; see 'rhec log'").value("LOG");
  add_msg_paths(command, arguments.msg_paths);
  Argument dead_reckoning =
      command.add("--dead-reckoning", arguments.dead_reckoning, "time [s], wheel speed [m/s], steering angle [rad]")
          .value("FILE");
  Argument gps = command.add("--gps", arguments.gps, "time [s], x [m], y [m]").value("FILE");
  dead_reckoning.needs(gps);
  gps.needs(dead_reckoning);
  command
      .add("--hold-out", arguments.hold_out,
           "withhold one of so many fixes and predict it; 0: none; default: " + usual_hold_out)
      .within(0, 1000000);
  command.add("--hold-out-phase", arguments.phase, "place of the first one withheld, from 0; default: the last of them")
      .within(0, 1000000);
  command.add_list("--variant", arguments.variants, "run this variant alone; may be given several times");
  add_assignments(command, arguments.assignments, "a key of the scenario");
  add_out(command, arguments.out, "DIR",
          fmt::format("folder of the results; otherwise out/ and the scenario's name with _{}", name));
  add_json(command, arguments.json);
  add_plugin_path(command, arguments.plugin_path);
}

}  // namespace rhec::apps
