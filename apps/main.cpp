#include <fmt/format.h>
#include <sys/resource.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <exception>
#include <filesystem>
#include <fstream>
#include <new>
#include <string>
#include <system_error>
#include <vector>

#include "commands.hpp"
#include "crash_report.hpp"
#include "rhec/core/base/error.hpp"
#include "rhec/plugins/robot/memory_need.hpp"
#include "rhec/plugins/yaml/yaml.hpp"
#include "version.hpp"

namespace rhec::apps {

void add_plugin_path(Command& command, std::vector<std::filesystem::path>& directories) {
  command
      .add_list(
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
      .value("DIR");
}

void add_assignments(Command& command, std::vector<std::string>& assignments, const std::string& what) {
  command.add_list("--set", assignments, what + "; may be given several times").value("KEY=VALUE");
}

void apply_assignments(Settings& settings, const std::vector<std::string>& assignments) {
  for (const std::string& assignment : assignments) apply_assignment(settings, assignment);
}

namespace {

constexpr const char* about = "Receding horizon estimation and control of field robots whose wheels slip.";
constexpr const char* examples =
    "Examples:\n"
    "  rhec run scenarios/figure8.yaml    results go to out/figure8\n"
    "  rhec report out/figure8            a page of them\n"
    "  rhec init my_robot                 files of a robot to go on from\n"
    "  rhec options                       every key of a scenario\n"
    "  rhec plugins                       what is installed\n"
    "  rhec plugins gn_rti                the options of one plugin\n"
    "  rhec check bicycle_slip            a model before its first run\n"
    "  rhec model my_vehicle.yaml --cpp   a vehicle's equations as a plugin in C++\n"
    "  rhec solve problems.jsonl --solver gn_rti --set mode=converge --out solutions.jsonl\n"
    "  rhec solve problems.jsonl --solver gn_rti --sequence > solutions.jsonl\n"
    "  rhec compare scenarios/figure8.yaml --solvers gn_rti,sparse_sqp\n"
    "  rhec sweep scenarios/sweep_blocks.yaml --out out/blocks.sqlite\n"
    "  rhec tune scenarios/victoria_park.yaml --dead-reckoning DRS.txt --gps GPS.txt --out out/tuned\n"
    "  rhec log drive.mcap --vehicle bicycle_slip\n"
    "  rhec estimate my_robot.yaml drive.mcap --out out/drive\n"
    "  rhec ros my_robot.yaml\n"
    "  rhec report out/figure8 -o out/figure8.html\n"
    "  rhec map field.sqlite --geotiff out/geotiff\n\n"
    "'rhec COMMAND --help' says more of each command.";

/// The folder of the scenarios that come with the program, as one would type it: that of the installation, if it runs
/// from there, or of the source tree.
std::string scenarios() {
  std::error_code none;
  const std::filesystem::path program = std::filesystem::read_symlink("/proc/self/exe", none);
  const std::filesystem::path installed = program.parent_path().parent_path() / "share/rhec/scenarios";
  return std::filesystem::is_directory(installed, none) ? installed.string() : "scenarios";
}

std::string first_steps() {
  return fmt::format(
      "{0}\n\n"
      "A robot drives a figure of eight over slipping ground, estimates its slip, and steers with that:\n"
      "  rhec run {1}/figure8.yaml                      then look at out/figure8/run.svg\n"
      "The same as a page to look into, and with another estimator, at another speed:\n"
      "  rhec report out/figure8                        opens in a browser: out/figure8/report.html\n"
      "  rhec run {1}/figure8.yaml --set estimator.name=ekf --set speed=5 --out out/ekf\n"
      "Your own robot: one of the vehicles, or equations of your own, and its sensors:\n"
      "  rhec init my_robot                             writes its files\n"
      "  rhec check my_robot/robot.yaml                 what a check says\n"
      "  rhec model --help                              equations become a plugin\n"
      "Your own log:\n"
      "  rhec estimate --help\n\n"
      "'rhec --help' lists all commands, 'rhec options' every key of a scenario, 'rhec plugins' what is installed.\n",
      about, scenarios());
}

int run(int count, char** words) {
  Program program(about, examples, first_steps(), &version_text);
  add_init(program);
  add_run(program);
  add_estimate(program);
  add_smooth(program);
  add_solve(program);
  add_compare(program);
  add_sweep(program);
  add_tune(program);
  add_log(program);
  add_ros(program);
  add_report(program);
  add_map(program);
  add_check(program);
  add_model(program);
  add_options(program);
  add_plugins(program);
  add_completion(program);
  return program.run(count, words);
}

std::string why_not_written(const std::string& reason) {
  return fmt::format("standard output could not be written: {}; is there room where it goes?", reason);
}

/// What is printed waits in a buffer: whether it could be written is known when that is emptied.
void finish_output() {
  if (std::fflush(stdout) != 0 || std::ferror(stdout) != 0) throw Error(why_not_written(std::strerror(errno)));
}

}  // namespace
}  // namespace rhec::apps

namespace {

/// Linux grants more than there is, and ends a program that uses it without a word. With this limit, such an allocation
/// fails instead, which is told.
void limit_memory() {
  double total = 0, resident = 0, shared = 0, text = 0, libraries = 0, data = 0;  // [pages], proc(5)
  std::ifstream statm("/proc/self/statm");
  struct rlimit limit {};
  if (!(statm >> total >> resident >> shared >> text >> libraries >> data) || getrlimit(RLIMIT_DATA, &limit) != 0)
    return;
  const double most = data * static_cast<double>(getpagesize()) + rhec::free_memory();
  if (!(most < static_cast<double>(limit.rlim_cur))) return;
  limit.rlim_cur = static_cast<rlim_t>(most);
  setrlimit(RLIMIT_DATA, &limit);
}

int run_and_tell(int count, char** words) {
  try {
    const int code = rhec::apps::run(count, words);
    rhec::apps::finish_output();
    return code;
  } catch (const rhec::Error& mistake) {
    fmt::print(stderr, "rhec: error: {}\n", mistake.what());
  } catch (const std::system_error& failure) {
    if (std::ferror(stdout) != 0)
      fmt::print(stderr, "rhec: error: {}\n", rhec::apps::why_not_written(failure.code().message()));
    else
      fmt::print(stderr, "rhec: error: failed unexpectedly: {}\n", failure.what());
  } catch (const std::bad_alloc&) {
    std::fputs(
        "rhec: error: there is not enough memory; expected shorter horizons and logs, coarser grids and maps, or a "
        "machine with more\n",
        stderr);  // which needs none
  } catch (const std::exception& failure) {
    fmt::print(stderr, "rhec: error: failed unexpectedly: {}\n", failure.what());
  }
  return rhec::apps::exit_error;
}

}  // namespace

int main(int count, char** words) {
  rhec::apps::install_crash_report();
  limit_memory();
  const int code = run_and_tell(count, words);
  rhec::apps::end_crash_report();
  return code;
}
