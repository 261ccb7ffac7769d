#include "apps/ros/wire/confinement.hpp"

#include <gtest/gtest.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <string>

#include "rhec/core/base/error.hpp"

namespace rhec::apps::ros::confinement_test {
namespace {

/// A UDP socket, and the interface that it is bound to; empty: none.
class Socket {
 public:
  Socket() : descriptor_(socket(AF_INET, SOCK_DGRAM, 0)) {}
  ~Socket() { close(descriptor_); }
  Socket(const Socket&) = delete;
  Socket& operator=(const Socket&) = delete;
  std::string interface() const {
    std::array<char, 64> name{};
    socklen_t size = name.size();
    EXPECT_EQ(getsockopt(descriptor_, SOL_SOCKET, SO_BINDTODEVICE, name.data(), &size), 0);
    return name.data();
  }

 private:
  int descriptor_;
};

TEST(Confinement, BindsWhatIsOpenedMeanwhile) {
  const Socket before;
  const Confinement confinement;
  const Socket meanwhile;
  confinement.apply("lo");
  EXPECT_EQ(meanwhile.interface(), "lo");
  EXPECT_EQ(before.interface(), "");
}

TEST(Confinement, SaysIfItCannot) {
  const Confinement confinement;
  const Socket meanwhile;
  EXPECT_THROW(confinement.apply("nowhere0"), Error);
}

}  // namespace
}  // namespace rhec::apps::ros::confinement_test
