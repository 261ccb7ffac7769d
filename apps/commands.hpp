#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "rhec/core/config/settings.hpp"

namespace CLI {
class App;
}

namespace rhec::apps {

/// Exit codes of the program.
enum ExitCode : int {
  exit_fine = 0,
  exit_error = 1,      ///< an error that the user can fix: rhec::Error
  exit_usage = 2,      ///< a wrong command line
  exit_not_solved = 3  ///< everything ran, but some results are not usable
};

/// What to do once the command line has been read; returns an exit code.
using Action = std::function<int()>;

// One function per command: adds the command to the program, and sets `chosen` to its action if it is the one called.
void add_check(CLI::App& program, Action& chosen);
void add_compare(CLI::App& program, Action& chosen);
void add_estimate(CLI::App& program, Action& chosen);
void add_report(CLI::App& program, Action& chosen);
void add_run(CLI::App& program, Action& chosen);
void add_smooth(CLI::App& program, Action& chosen);
void add_solve(CLI::App& program, Action& chosen);
void add_sweep(CLI::App& program, Action& chosen);
void add_options(CLI::App& program, Action& chosen);
void add_plugins(CLI::App& program, Action& chosen);

// Options shared by several commands.

/// `--plugin-path DIR`.
void add_plugin_path(CLI::App& command, std::vector<std::filesystem::path>& directories);
/// `--set KEY=VALUE`; `what` describes a key, for the help.
void add_assignments(CLI::App& command, std::vector<std::string>& assignments, const std::string& what);
/// Applies the assignments of `--set` to `settings`, in the order given.
void apply_assignments(Settings& settings, const std::vector<std::string>& assignments);
/// `--out`; `type` says whether it takes a file or a folder.
void add_out(CLI::App& command, std::string& out, const std::string& type, const std::string& meaning);

}  // namespace rhec::apps
