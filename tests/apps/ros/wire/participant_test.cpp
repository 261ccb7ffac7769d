#include "apps/ros/wire/participant.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>

#include "rhec/core/base/error.hpp"

// What a participant sends and hears is tested between processes: tests/cli/ros.py.
namespace rhec::apps::ros::participant_test {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::ThrowsMessage;

TEST(Participant, NamesTypesAsRosDoes) {
  EXPECT_EQ(dds_type_name("nav_msgs/msg/Odometry"), "nav_msgs::msg::dds_::Odometry_");
}

TEST(Participant, TellsWhichInterfacesThereAre) {
  EXPECT_THAT([] { Participant({.interface = "nowhere0"}); },
              ThrowsMessage<Error>(AllOf(HasSubstr("'nowhere0'"), HasSubstr("lo (127.0.0.1)"))));
}

TEST(Participant, RefusesDomainsThatHaveNoPorts) {
  EXPECT_THAT([] { Participant({.domain = 233}); }, ThrowsMessage<Error>(HasSubstr("0 to 232")));
}

TEST(Participant, ReadsTheDomainOfTheEnvironment) {
  ASSERT_EQ(setenv("ROS_DOMAIN_ID", "42", 1), 0);
  EXPECT_EQ(domain_of_environment(), 42u);
  for (const char* wrong : {"x", "233", "-1", "4 "}) {
    ASSERT_EQ(setenv("ROS_DOMAIN_ID", wrong, 1), 0);
    EXPECT_THROW(domain_of_environment(), Error) << wrong;
  }
  ASSERT_EQ(unsetenv("ROS_DOMAIN_ID"), 0);
  EXPECT_EQ(domain_of_environment(), 0u);
}

}  // namespace
}  // namespace rhec::apps::ros::participant_test
