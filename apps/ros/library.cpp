// What the library of `rhec ros` has for live.cpp.
#include <utility>

#include "live.hpp"
#include "rhec/core/base/export.hpp"

extern "C" {
RHEC_EXPORT extern const char rhec_ros_version[];
const char rhec_ros_version[] = RHEC_PROJECT_VERSION;

RHEC_EXPORT int rhec_run_node(const rhec::Host& host, rhec::Settings settings,
                              const rhec::apps::ros::LiveArguments& arguments) {
  return rhec::apps::ros::run_node(host, std::move(settings), arguments);
}

RHEC_EXPORT int rhec_run_robot(const rhec::Host& host, rhec::Settings settings,
                               const rhec::apps::ros::LiveArguments& arguments) {
  return rhec::apps::ros::run_robot(host, std::move(settings), arguments);
}
}
