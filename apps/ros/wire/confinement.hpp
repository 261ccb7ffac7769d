#pragma once

#include <set>
#include <string>

namespace rhec::apps::ros {

/// Confines the UDP sockets that are opened while it exists to one network interface: Cyclone listens to all of them,
/// and only chooses where it sends. The kernel then drops what comes in by another interface.
class Confinement {
 public:
  Confinement();
  /// Throws Error if the kernel refuses.
  void apply(const std::string& interface) const;

 private:
  std::set<int> before_;
};

}  // namespace rhec::apps::ros
