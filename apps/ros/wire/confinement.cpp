#include "confinement.hpp"

#include <fmt/format.h>
#include <sys/socket.h>

#include <cerrno>
#include <charconv>
#include <cstring>
#include <filesystem>

#include "rhec/core/base/error.hpp"

namespace rhec::apps::ros {
namespace {

bool is_udp(int descriptor) {
  int type = 0, family = 0;
  socklen_t size = sizeof(int);
  if (getsockopt(descriptor, SOL_SOCKET, SO_TYPE, &type, &size) != 0 || type != SOCK_DGRAM) return false;
  size = sizeof(int);
  return getsockopt(descriptor, SOL_SOCKET, SO_DOMAIN, &family, &size) == 0 &&
         (family == AF_INET || family == AF_INET6);
}

std::set<int> udp_sockets() {
  std::set<int> found;
  for (const auto& entry : std::filesystem::directory_iterator("/proc/self/fd")) {
    const std::string name = entry.path().filename().string();
    int descriptor = -1;
    std::from_chars(name.data(), name.data() + name.size(), descriptor);
    if (descriptor >= 0 && is_udp(descriptor)) found.insert(descriptor);
  }
  return found;
}

}  // namespace

Confinement::Confinement() : before_(udp_sockets()) {}

void Confinement::apply(const std::string& interface) const {
  for (const int descriptor : udp_sockets()) {
    if (before_.contains(descriptor)) continue;
    if (setsockopt(descriptor, SOL_SOCKET, SO_BINDTODEVICE, interface.c_str(),
                   static_cast<socklen_t>(interface.size() + 1)) != 0)
      throw Error(
          fmt::format("the sockets could not be confined to the interface {}: {}; expected Linux 5.7 or newer, or the "
                      "capability CAP_NET_RAW",
                      interface, std::strerror(errno)));
  }
}

}  // namespace rhec::apps::ros
