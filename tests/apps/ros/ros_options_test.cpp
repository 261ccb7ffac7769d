#include "apps/ros/ros_options.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "rhec/core/base/error.hpp"
#include "rhec/plugins/yaml/yaml.hpp"

namespace rhec::apps::ros::ros_options_test {
namespace {

using testing::HasSubstr;
using testing::ThrowsMessage;

Settings section(const std::string& text) { return parse_yaml(text, "robot.yaml"); }

TEST(RosOptions, SteersNobodyUnlessAsked) {
  const RosOptions options = read_ros_options(section("{}"));
  EXPECT_FALSE(options.command.steer);
  EXPECT_EQ(options.interface, "lo");
}

TEST(RosOptions, NamesTheLineOfAMistake) {
  EXPECT_THAT([] { read_ros_options(section("node: x\ninterfaces: eth0")); },
              ThrowsMessage<Error>(HasSubstr("robot.yaml:2")));
  EXPECT_THAT([] { read_ros_options(section("node: x\nnames:\n  stop: stop")); },
              ThrowsMessage<Error>(AllOf(HasSubstr("robot.yaml:3"), HasSubstr("expected a full name"))));
  for (const char* name : {"/cmd vel", "//fix", "/fix/", "/1fix", "/a/2", "/", "/fi\xC3\xA4"})
    EXPECT_THAT([&] { read_ros_options(section(std::string("names: {command: '") + name + "'}")); },
                ThrowsMessage<Error>(AllOf(HasSubstr(name), HasSubstr("of letters, digits, _ and /"))));
  for (const char* name : {"/fix", "/robot1/cmd_vel", "/_a/b2"}) EXPECT_TRUE(is_topic_name(name)) << name;
  EXPECT_THAT([] { read_ros_options(section("command: {steer: true}\nnames: {command: ''}")); },
              ThrowsMessage<Error>(HasSubstr("robot.yaml:2")));
  EXPECT_THAT([] { read_ros_options(section("command: {steer: true, form: ackermann}")); },
              ThrowsMessage<Error>(HasSubstr("command.steering")));
}

TEST(RosOptions, ReadsCoordinatesOfFrames) {
  const auto arms = read_lever_arms(section("{antenna_x: gps.link.x, gps_offset: -gps_link.y}"));
  ASSERT_EQ(arms.size(), 2u);
  EXPECT_EQ(arms[0].frame, "gps.link");
  EXPECT_EQ(arms[0].axis, 0);
  EXPECT_EQ(arms[0].sign, 1);
  EXPECT_EQ(arms[1].option, "gps_offset");
  EXPECT_EQ(arms[1].axis, 1);
  EXPECT_EQ(arms[1].sign, -1);
  for (const char* wrong : {"{a: gps_link}", "{a: .x}", "{a: gps_link.w}", "{a: gps_link.xy}"})
    EXPECT_THROW(read_lever_arms(section(wrong)), Error) << wrong;
}

}  // namespace
}  // namespace rhec::apps::ros::ros_options_test
