#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "command.hpp"
#include "rhec/sim/logs/recorded_log.hpp"

namespace rhec::apps {

/// The arguments of commands that work on a recorded log.
struct LogArguments {
  std::string scenario, dead_reckoning, gps, out = "out";
  std::vector<std::string> assignments, variants;
  int hold_out = 0, phase = -1;
  std::vector<std::filesystem::path> plugin_path;
};

/// `needs_log`: whether the command cannot do without the log's files.
void add_log_arguments(Command& command, LogArguments& arguments, bool needs_log = true);

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
