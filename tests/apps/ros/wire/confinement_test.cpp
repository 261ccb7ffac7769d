#include "apps/ros/wire/confinement.hpp"

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <ifaddrs.h>
#include <net/if.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cstdint>
#include <optional>
#include <string>

#include "rhec/core/base/error.hpp"

namespace rhec::apps::ros::confinement_test {
namespace {

sockaddr_in place(in_addr address, std::uint16_t port) {
  sockaddr_in result{};
  result.sin_family = AF_INET;
  result.sin_addr = address;
  result.sin_port = port;
  return result;
}

in_addr address_of(const char* text) {
  in_addr address{};
  inet_pton(AF_INET, text, &address);
  return address;
}

/// A UDP socket that listens to all interfaces.
class Socket {
 public:
  Socket() : descriptor_(socket(AF_INET, SOCK_DGRAM, 0)) {
    sockaddr_in own = place({.s_addr = INADDR_ANY}, 0);
    EXPECT_EQ(bind(descriptor_, reinterpret_cast<sockaddr*>(&own), sizeof(own)), 0);
    socklen_t size = sizeof(own);
    getsockname(descriptor_, reinterpret_cast<sockaddr*>(&own), &size);
    port_ = own.sin_port;
    const timeval patience{.tv_sec = 0, .tv_usec = 200'000};
    setsockopt(descriptor_, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof(patience));
  }
  ~Socket() { close(descriptor_); }
  Socket(const Socket&) = delete;
  Socket& operator=(const Socket&) = delete;

  void join(in_addr group, in_addr interface) const {
    const ip_mreq request{.imr_multiaddr = group, .imr_interface = interface};
    EXPECT_EQ(setsockopt(descriptor_, IPPROTO_IP, IP_ADD_MEMBERSHIP, &request, sizeof(request)), 0);
  }
  void send_by(in_addr interface) const {
    EXPECT_EQ(setsockopt(descriptor_, IPPROTO_IP, IP_MULTICAST_IF, &interface, sizeof(interface)), 0);
  }
  void send(in_addr address, const Socket& to) const {
    const sockaddr_in there = place(address, to.port_);
    sendto(descriptor_, "x", 1, 0, reinterpret_cast<const sockaddr*>(&there), sizeof(there));
  }
  bool hears() const {
    char byte = 0;
    return recv(descriptor_, &byte, 1, 0) == 1;
  }

 private:
  int descriptor_;
  std::uint16_t port_ = 0;
};

struct Interface {
  std::string name;
  in_addr address;
};

/// One that is not the loopback, with multicast; none: this machine has none.
std::optional<Interface> another_interface() {
  std::optional<Interface> found;
  ifaddrs* list = nullptr;
  if (getifaddrs(&list) != 0) return found;
  for (const ifaddrs* each = list; each; each = each->ifa_next) {
    if (!each->ifa_addr || each->ifa_addr->sa_family != AF_INET || (each->ifa_flags & IFF_LOOPBACK) != 0) continue;
    if ((each->ifa_flags & IFF_MULTICAST) == 0 || (each->ifa_flags & IFF_UP) == 0) continue;
    found = {each->ifa_name, reinterpret_cast<const sockaddr_in*>(each->ifa_addr)->sin_addr};
  }
  freeifaddrs(list);
  return found;
}

TEST(Confinement, WhatComesInByAnotherInterfaceIsNotHeard) {
  const auto other = another_interface();
  if (!other) GTEST_SKIP() << "this machine has no interface with multicast beside the loopback";
  const in_addr group = address_of("239.255.77.77");
  const Socket sender, free;
  sender.send_by(other->address);
  free.join(group, other->address);
  sender.send(group, free);
  if (!free.hears()) GTEST_SKIP() << "multicast does not come back by " << other->name;
  for (const bool is_other : {true, false}) {
    const Confinement confinement;
    const Socket confined;
    confined.join(group, other->address);
    confinement.apply(is_other ? other->name : "lo");
    sender.send(group, confined);
    EXPECT_EQ(confined.hears(), is_other);
  }
  sender.send(group, free);  // it was there before
  EXPECT_TRUE(free.hears());
}

TEST(Confinement, ThisHostIsHeardByAllOfItsAddresses) {
  const auto other = another_interface();
  const Socket sender;
  const Confinement confinement;
  const Socket confined;
  confinement.apply(other ? other->name : "lo");
  sender.send(address_of("127.0.0.1"), confined);
  EXPECT_TRUE(confined.hears());
  if (!other) return;
  sender.send(other->address, confined);
  EXPECT_TRUE(confined.hears());
}

TEST(Confinement, SaysWhichInterfaceIsNotThere) { EXPECT_THROW(Confinement().apply("nowhere0"), Error); }

}  // namespace
}  // namespace rhec::apps::ros::confinement_test
