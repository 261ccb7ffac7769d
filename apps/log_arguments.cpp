#include "log_arguments.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>

#include "commands.hpp"
#include "rhec/core/base/error.hpp"
#include "rhec/plugins/host/host.hpp"
#include "rhec/plugins/yaml/yaml.hpp"

namespace rhec::apps {
namespace {

sim::LogScenario read_scenario(const LogArguments& arguments) {
  Settings settings = load_yaml(arguments.scenario);
  apply_assignments(settings, arguments.assignments);
  return {Host(arguments.plugin_path), settings, arguments.variants};
}

sim::HoldOut read_hold_out(const LogArguments& arguments) {
  const int phase = arguments.phase >= 0 ? arguments.phase : arguments.hold_out - 1;
  if (arguments.hold_out > 0 && phase >= arguments.hold_out)
    throw Error(
        fmt::format("--hold-out-phase {} with --hold-out {}; expected a number below it", phase, arguments.hold_out));
  return {arguments.hold_out, phase};
}

}  // namespace

LogInput::LogInput(const LogArguments& arguments)
    : scenario(read_scenario(arguments)),
      hold_out(read_hold_out(arguments)),
      log(sim::read_recorded_log(arguments.dead_reckoning, arguments.gps, scenario)) {}

void add_log_arguments(CLI::App& command, LogArguments& arguments) {
  command.add_option("scenario", arguments.scenario, "a YAML file")->required();
  command.add_option("--dead-reckoning", arguments.dead_reckoning, "time [s], wheel speed [m/s], steering angle [rad]")
      ->type_name("FILE")
      ->required();
  command.add_option("--gps", arguments.gps, "time [s], x [m], y [m]")->type_name("FILE")->required();
  command.add_option("--hold-out", arguments.hold_out, "withhold one of so many fixes and predict it; 0: none")
      ->check(CLI::Range(0, 1000000))
      ->capture_default_str();
  command
      .add_option("--hold-out-phase", arguments.phase,
                  "place of the first one withheld, from 0; default: the last of them")
      ->check(CLI::Range(0, 1000000));
  command.add_option("--variant", arguments.variants, "run this variant alone; may be given several times")
      ->expected(1)
      ->allow_extra_args(false)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  add_assignments(command, arguments.assignments, "a key of the scenario");
  add_out(command, arguments.out, "DIR", "folder of the results");
  add_plugin_path(command, arguments.plugin_path);
}

}  // namespace rhec::apps
