#include "confinement.hpp"

#include <fmt/format.h>
#include <linux/filter.h>
#include <net/if.h>
#include <sys/socket.h>

#include <array>
#include <cerrno>
#include <charconv>
#include <cstdint>
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
  const unsigned index = if_nametoindex(interface.c_str());
  if (index == 0) throw Error(fmt::format("the interface {} is not there: {}", interface, std::strerror(errno)));
  // By the interface that a packet came in by: all of it is kept (largest length), or nothing.
  constexpr std::uint32_t came_in_by = static_cast<std::uint32_t>(SKF_AD_OFF) + SKF_AD_IFINDEX, all = 0xffffffff;
  std::array<sock_filter, 5> code{{
      {.code = BPF_LD | BPF_W | BPF_ABS, .jt = 0, .jf = 0, .k = came_in_by},
      {.code = BPF_JMP | BPF_JEQ | BPF_K, .jt = 1, .jf = 0, .k = index},
      {.code = BPF_JMP | BPF_JEQ | BPF_K, .jt = 0, .jf = 1, .k = if_nametoindex("lo")},
      {.code = BPF_RET | BPF_K, .jt = 0, .jf = 0, .k = all},
      {.code = BPF_RET | BPF_K, .jt = 0, .jf = 0, .k = 0},
  }};
  const sock_fprog filter{.len = code.size(), .filter = code.data()};
  for (const int descriptor : udp_sockets()) {
    if (before_.contains(descriptor)) continue;
    if (setsockopt(descriptor, SOL_SOCKET, SO_ATTACH_FILTER, &filter, sizeof(filter)) != 0)
      throw Error(
          fmt::format("the sockets could not be confined to the interface {}: {}", interface, std::strerror(errno)));
  }
}

}  // namespace rhec::apps::ros
