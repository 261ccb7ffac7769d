#include "apps/ros/wire/wire_options.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>

#include "rhec/core/base/error.hpp"

namespace rhec::apps::ros::wire_options_test {
namespace {

using testing::HasSubstr;
using testing::ThrowsMessage;

TEST(WireOptions, KnowTheSizeOfIdsByDistribution) {
  ASSERT_EQ(unsetenv("ROS_DISTRO"), 0);
  EXPECT_EQ(wire_options({}, {}).id_bytes, 16u);
  EXPECT_EQ(wire_options({}, {.distro = "humble"}).id_bytes, 24u);
  ASSERT_EQ(setenv("ROS_DISTRO", "foxy", 1), 0);
  EXPECT_EQ(wire_options({}, {}).id_bytes, 24u);
  EXPECT_EQ(wire_options({}, {.distro = "jazzy"}).id_bytes, 16u);
  EXPECT_THAT([] { wire_options({}, {.distro = "humbel"}); }, ThrowsMessage<Error>(HasSubstr("--ros-distro")));
  ASSERT_EQ(unsetenv("ROS_DISTRO"), 0);
}

TEST(WireOptions, TheCommandLineComesFirst) {
  RosOptions options;
  options.interface = "eth7";
  EXPECT_EQ(wire_options(options, {}).interface, "eth7");
  const WireOptions wire = wire_options(options, {.interface = "eth8", .domain = 7});
  EXPECT_EQ(wire.interface, "eth8");
  EXPECT_EQ(wire.domain, 7u);
}

}  // namespace
}  // namespace rhec::apps::ros::wire_options_test
