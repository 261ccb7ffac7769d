#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "command.hpp"
#include "rhec/sim/logs/recorded_log.hpp"

namespace rhec::apps {

/// The arguments of commands that work on a recorded log.
struct LogArguments {
  std::string scenario, log, dead_reckoning, gps, out;
  std::vector<std::string> assignments, variants, msg_paths;
  int hold_out = -1, phase = -1;  ///< -1: the default
  bool json = false;
  std::vector<std::filesystem::path> plugin_path;
};

/// `name` is the command's; `usual_hold_out`: the default of --hold-out, in words.
void add_log_arguments(Command& command, const std::string& name, LogArguments& arguments,
                       const std::string& usual_hold_out = "5 of LOG, else none");
/// Of a log, without --hold-out.
inline constexpr int default_hold_out = 5;

/// The scenario that these arguments name; and what they say of fixes to be withheld. Throw Error for any mistake.
sim::LogScenario read_log_scenario(const LogArguments& arguments);
sim::HoldOut read_hold_out(const LogArguments& arguments);

/// The input that these arguments name, read and checked. Throws Error for any mistake.
struct LogInput {
  explicit LogInput(const LogArguments& arguments);
  sim::LogScenario scenario;
  sim::HoldOut hold_out;
  sim::RecordedLog log;
};

}  // namespace rhec::apps
