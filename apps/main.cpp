#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "commands.hpp"
#include "rhec/core/base/error.hpp"
#include "rhec/core/config/option_values.hpp"
#include "rhec/plugins/yaml/yaml.hpp"

namespace rhec::apps {

void add_plugin_path(CLI::App& command, std::vector<std::filesystem::path>& directories) {
  command
      .add_option_function<std::vector<std::string>>(
          "--plugin-path",
          [&directories](const std::vector<std::string>& given) {
            // The search skips missing directories, but one named explicitly must exist.
            for (const std::string& directory : given)
              if (!std::filesystem::is_directory(directory))
                throw Error(
                    fmt::format("--plugin-path {}: found {}; give a directory that holds plugins",
                                directory.empty() ? "''" : directory,
                                std::filesystem::exists(directory) ? "a file, not a directory" : "no such directory"));
            directories.assign(given.begin(), given.end());
          },
          "look for plugins there first; may be given several times")
      ->type_name("DIR")
      ->expected(1)
      ->allow_extra_args(false)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
}

void add_assignments(CLI::App& command, std::vector<std::string>& assignments, const std::string& what) {
  command.add_option("--set", assignments, what + "; may be given several times")
      ->type_name("KEY=VALUE")
      ->expected(1)
      ->allow_extra_args(false)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
}

void apply_assignments(Settings& settings, const std::vector<std::string>& assignments) {
  for (const std::string& assignment : assignments) apply_assignment(settings, assignment);
}

void add_out(CLI::App& command, std::string& out, const std::string& type, const std::string& meaning) {
  command.add_option("--out", out, meaning)->type_name(type)->capture_default_str();
}

namespace {

constexpr const char* about = "Receding horizon estimation and control of field robots whose wheels slip.";
constexpr const char* examples =
    "Examples:\n"
    "  rhec run scenarios/figure8.yaml --out out/figure8\n"
    "  rhec options                       every key of a scenario\n"
    "  rhec plugins                       what is installed\n"
    "  rhec plugins gn_rti                the options of one plugin\n"
    "  rhec check bicycle_slip            a model before its first run\n"
    "  rhec solve problems.jsonl --solver gn_rti --set mode=converge --out solutions.jsonl\n"
    "  rhec solve problems.jsonl --solver gn_rti --sequence > solutions.jsonl\n"
    "  rhec compare scenarios/figure8.yaml --solvers gn_rti,sparse_sqp\n"
    "  rhec sweep scenarios/sweep_blocks.yaml --out out/blocks.sqlite\n"
    "  rhec report out/figure8 -o out/figure8.html\n\n"
    "'rhec COMMAND --help' says more of each command.";

int usage_error(std::string_view what) {
  fmt::print(stderr, "rhec: error: {}\n", what);
  return exit_usage;
}

/// An error message if the command is missing or unknown; otherwise empty.
std::string wrong_command(const CLI::App& program, int count, char** words) {
  std::vector<std::string> commands;
  for (const CLI::App* command : program.get_subcommands([](const CLI::App*) { return true; }))
    commands.push_back(command->get_name());
  const std::string expected = fmt::format("expected one of {}; see 'rhec --help'", fmt::join(commands, ", "));
  if (count < 2) return "no command; " + expected;
  const std::string word = words[1];
  if (word == "-h" || word == "--help" || word == "--version") return {};
  if (word.starts_with('-')) return fmt::format("unknown option '{}'; {}", word, expected);
  if (std::find(commands.begin(), commands.end(), word) != commands.end()) return {};
  const std::string near = nearest(word, commands);
  return fmt::format("unknown command '{}'; {}", word,
                     near.empty() ? expected : fmt::format("did you mean '{}'?", near));
}

int run(int count, char** words) {
  CLI::App program(about, "rhec");
  program.set_version_flag("--version", "rhec " RHEC_PROJECT_VERSION);
  program.require_subcommand(1);
  program.footer(examples);
  Action chosen;
  add_run(program, chosen);
  add_estimate(program, chosen);
  add_smooth(program, chosen);
  add_solve(program, chosen);
  add_compare(program, chosen);
  add_sweep(program, chosen);
  add_report(program, chosen);
  add_check(program, chosen);
  add_options(program, chosen);
  add_plugins(program, chosen);

  if (const std::string problem = wrong_command(program, count, words); !problem.empty()) return usage_error(problem);
  try {
    program.parse(count, words);
  } catch (const CLI::ParseError& end) {
    if (end.get_exit_code() == 0) return program.exit(end);  // --help, --version
    const auto called = program.get_subcommands();
    return usage_error(
        fmt::format("{}; see 'rhec {}--help'", end.what(), called.empty() ? "" : called.front()->get_name() + " "));
  }
  return chosen();
}

}  // namespace
}  // namespace rhec::apps

int main(int count, char** words) {
  try {
    return rhec::apps::run(count, words);
  } catch (const rhec::Error& mistake) {
    fmt::print(stderr, "rhec: error: {}\n", mistake.what());
  } catch (const std::exception& failure) {
    fmt::print(stderr, "rhec: error: failed unexpectedly: {}\n", failure.what());
  }
  return rhec::apps::exit_error;
}
