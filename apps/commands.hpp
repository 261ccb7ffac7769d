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

/// What the program answers to whoever called it.
enum ExitCode : int {
  exit_fine = 0,
  exit_error = 1,      ///< a mistake that the user can mend: rhec::Error
  exit_usage = 2,      ///< of the command line itself
  exit_not_solved = 3  ///< all was done, but some answers are not usable
};

/// What to do once the command line has been read; returns an exit code.
using Action = std::function<int()>;

// One function a command: adds it to the program, and puts what it does into `chosen` when it is the one that was
// called.
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

// Options that several commands have.

/// `--plugin-path DIR`.
void add_plugin_path(CLI::App& command, std::vector<std::filesystem::path>& directories);
/// `--set KEY=VALUE`; `what` a key is, for the help.
void add_assignments(CLI::App& command, std::vector<std::string>& assignments, const std::string& what);
/// Puts what `--set` gave over settings, in the order given.
void apply_assignments(Settings& settings, const std::vector<std::string>& assignments);
/// `--out`, to a file or a folder, as `type` says.
void add_out(CLI::App& command, std::string& out, const std::string& type, const std::string& meaning);

}  // namespace rhec::apps
