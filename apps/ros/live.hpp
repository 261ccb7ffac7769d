#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "rhec/core/config/settings.hpp"
#include "rhec/plugins/host/host.hpp"

namespace rhec::apps::ros {

/// What the command line of `rhec ros` says.
struct LiveArguments {
  std::string file = {}, interface = {}, distro = {}, path = {};
  std::vector<std::string> assignments = {}, msg_paths = {};
  int domain = -1;  ///< -1: of the environment
  int priority = 0, cpu = -1;
  double seconds = 0.0;  ///< 0: until it is stopped
  bool once = false, simulate = false;
  bool json = false;  ///< the report at the end is JSON, and what happens is told on standard error
  std::vector<std::filesystem::path> plugin_path = {};
};

// Both are in a library of their own, which the program loads. Where it is not installed they throw Error that says
// what to install. They return an exit code.
/// A node that estimates and steers.
int run_node(const Host& host, Settings settings, const LiveArguments& arguments);
/// A simulated robot.
int run_robot(const Host& host, Settings settings, const LiveArguments& arguments);

/// The library, in the folder of rhec's libraries, and what it is looked for.
inline constexpr const char* live_library = "ros_node.so";
inline constexpr const char* run_node_symbol = "rhec_run_node";
inline constexpr const char* run_robot_symbol = "rhec_run_robot";
inline constexpr const char* version_symbol = "rhec_ros_version";
using RunLive = int(const Host& host, Settings settings, const LiveArguments& arguments);

}  // namespace rhec::apps::ros
