#include "log_arguments.hpp"

#include <fmt/format.h>

#include "commands.hpp"
#include "crash_report.hpp"
#include "rhec/core/base/error.hpp"
#include "rhec/plugins/host/host.hpp"
#include "rhec/plugins/yaml/yaml.hpp"

namespace rhec::apps {

sim::LogScenario read_log_scenario(const LogArguments& arguments) {
  Settings settings = load_yaml(arguments.scenario);
  apply_assignments(settings, arguments.assignments);
  return {examined_host(arguments.plugin_path), settings, arguments.variants};
}

sim::HoldOut read_hold_out(const LogArguments& arguments) {
  const int phase = arguments.phase >= 0 ? arguments.phase : arguments.hold_out - 1;
  if (arguments.hold_out > 0 && phase >= arguments.hold_out)
    throw Error(
        fmt::format("--hold-out-phase {} with --hold-out {}; expected a number below it", phase, arguments.hold_out));
  return {arguments.hold_out, phase};
}

LogInput::LogInput(const LogArguments& arguments)
    : scenario(read_log_scenario(arguments)),
      hold_out(read_hold_out(arguments)),
      log(sim::read_recorded_log(arguments.dead_reckoning, arguments.gps, scenario)) {}

void add_log_arguments(Command& command, LogArguments& arguments, bool needs_log) {
  command.add("scenario", arguments.scenario, "a YAML file").required();
  Argument dead_reckoning =
      command.add("--dead-reckoning", arguments.dead_reckoning, "time [s], wheel speed [m/s], steering angle [rad]")
          .value("FILE");
  Argument gps = command.add("--gps", arguments.gps, "time [s], x [m], y [m]").value("FILE");
  if (needs_log) {
    dead_reckoning.required();
    gps.required();
  } else {
    dead_reckoning.needs(gps);
    gps.needs(dead_reckoning);
  }
  command.add("--hold-out", arguments.hold_out, "withhold one of so many fixes and predict it; 0: none")
      .within(0, 1000000)
      .shows_default();
  command.add("--hold-out-phase", arguments.phase, "place of the first one withheld, from 0; default: the last of them")
      .within(0, 1000000);
  command.add_list("--variant", arguments.variants, "run this variant alone; may be given several times");
  add_assignments(command, arguments.assignments, "a key of the scenario");
  add_out(command, arguments.out, "DIR", "folder of the results");
  add_plugin_path(command, arguments.plugin_path);
}

}  // namespace rhec::apps
