#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "rhec/sim/logs/recorded_log.hpp"

namespace CLI {
class App;
}

namespace rhec::apps {

/// What commands on a recorded log are told.
struct LogArguments {
  std::string scenario, dead_reckoning, gps, out = "out";
  std::vector<std::string> assignments, variants;
  int hold_out = 0, phase = -1;
  std::vector<std::filesystem::path> plugin_path;
};

void add_log_arguments(CLI::App& command, LogArguments& arguments);

/// The same, read. Throws Error for whatever is wrong.
struct LogInput {
  explicit LogInput(const LogArguments& arguments);
  sim::LogScenario scenario;
  sim::HoldOut hold_out;
  sim::RecordedLog log;
};

}  // namespace rhec::apps
