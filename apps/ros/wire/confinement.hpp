#pragma once

#include <set>
#include <string>

namespace rhec::apps::ros {

/// Confines the UDP sockets that are opened while it exists to one network interface, and to this host: Cyclone listens
/// to all interfaces, and only chooses where it sends. The kernel then drops what comes in by another one.
class Confinement {
 public:
  Confinement();
  /// What this host sends to itself comes in by the loopback interface, whatever address it is sent to: it is heard,
  /// too. Throws Error for an interface that is not there, or if the kernel refuses.
  void apply(const std::string& interface) const;

 private:
  std::set<int> before_;
};

}  // namespace rhec::apps::ros
