// `rhec ros` of a build without Cyclone DDS.
#include "live.hpp"
#include "rhec/core/base/error.hpp"

namespace rhec::apps::ros {
namespace {

Error no_wire() {
  return Error(
      "rhec ros: this build has no Cyclone DDS; install it (Debian: apt-get install cyclonedds-dev, or "
      "scripts/install-dependencies), and build rhec again");
}

}  // namespace

int run_node(const Host&, Settings, const LiveArguments&) { throw no_wire(); }
int run_robot(const Host&, Settings, const LiveArguments&) { throw no_wire(); }

}  // namespace rhec::apps::ros
