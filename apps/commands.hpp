#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "command.hpp"
#include "rhec/core/config/settings.hpp"
#include "rhec/plugins/robot/option_section.hpp"

namespace rhec::apps {

/// Exit codes of the program.
enum ExitCode : int {
  exit_fine = 0,
  exit_error = 1,      ///< an error that the user can fix: rhec::Error
  exit_usage = 2,      ///< a wrong command line
  exit_not_solved = 3  ///< everything ran, but some results are not usable
};

// One function per command: adds the command to the program.
void add_check(Program& program);
void add_compare(Program& program);
void add_completion(Program& program);
void add_estimate(Program& program);
void add_init(Program& program);
void add_log(Program& program);
void add_map(Program& program);
void add_model(Program& program);
void add_report(Program& program);
void add_ros(Program& program);
void add_run(Program& program);
void add_smooth(Program& program);
void add_solve(Program& program);
void add_sweep(Program& program);
void add_tune(Program& program);
void add_options(Program& program);
void add_plugins(Program& program);

// Options shared by several commands.

/// `--plugin-path DIR`.
void add_plugin_path(Command& command, std::vector<std::filesystem::path>& directories);
/// `--set KEY=VALUE`; `what` describes a key, for the help.
void add_assignments(Command& command, std::vector<std::string>& assignments, const std::string& what);
/// Applies the assignments of `--set` to `settings`, in the order given.
void apply_assignments(Settings& settings, const std::vector<std::string>& assignments);
/// Every section of a scenario with its keys: of simulations, recorded drives, signals and ROS.
std::vector<OptionSection> option_sections();

}  // namespace rhec::apps
