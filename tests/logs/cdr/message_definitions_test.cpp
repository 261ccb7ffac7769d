#include "rhec/logs/cdr/message_definitions.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "support/error_of.hpp"

namespace rhec::logs {
namespace message_definitions_test {

TEST(MessageDefinitions, NamesOfTypesHaveOneForm) {
  EXPECT_EQ(full_type_name("nav_msgs/Odometry"), "nav_msgs/msg/Odometry");
  EXPECT_EQ(full_type_name("nav_msgs/msg/Odometry"), "nav_msgs/msg/Odometry");
  EXPECT_EQ(full_type_name("nav_msgs::msg::dds_::Odometry_"), "nav_msgs/msg/Odometry");
}

TEST(MessageDefinitions, AMessageIsLinkedWithWhatItContains) {
  const MessageType type = link_message("nav_msgs/msg/Odometry", builtin_definitions());
  EXPECT_EQ(type.structures.front().name, "nav_msgs/msg/Odometry");
  EXPECT_EQ(type.structures.size(), 10u);  // Header, Time, PoseWithCovariance, Pose, Point, Quaternion, Twist, ...
}

TEST(MessageDefinitions, ATextOfADefinitionDefinesTheSame) {
  Definitions again;
  parse_ros2msg("nav_msgs/msg/Path", ros2msg_text("nav_msgs/msg/Path", builtin_definitions()), again);
  EXPECT_EQ(link_message("nav_msgs/msg/Path", again).structures.size(),
            link_message("nav_msgs/msg/Path", builtin_definitions()).structures.size());
}

TEST(MessageDefinitions, RefusesWhatCannotBe) {
  Definitions made;
  parse_ros2msg("p/msg/A", "B b\n", made);
  EXPECT_THAT(error_of([&] { link_message("p/msg/A", made); }),
              testing::AllOf(testing::HasSubstr("p/msg/B in p/msg/A"), testing::HasSubstr("--msg-path")));
  parse_ros2msg("p/msg/B", "A[] a\n", made);
  EXPECT_THAT(error_of([&] { link_message("p/msg/A", made); }), testing::HasSubstr("contains itself"));
  parse_ros2msg("p/msg/B", "float64[0] a\n", made);
  EXPECT_THAT(error_of([&] { link_message("p/msg/A", made); }), testing::HasSubstr("of no length"));
}

}  // namespace message_definitions_test
}  // namespace rhec::logs
