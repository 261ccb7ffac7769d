#include "apps/ros/node/live_topics.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "rhec/core/base/error.hpp"
#include "rhec/plugins/yaml/yaml.hpp"

namespace rhec::apps::ros::live_topics_test {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::ThrowsMessage;

LiveTopics topics(const std::string& signals, const std::string& types = "{}") {
  return LiveTopics(parse_yaml(signals, "robot.yaml"), parse_yaml(types, "robot.yaml"), {});
}

TEST(LiveTopics, KnowsUsualNamesAndThoseThatAreGiven) {
  const LiveTopics found = topics("outputs: {x: {from: /fix, as: east}, y: '/box/state:data[0]'}\ninputs: {u: none}",
                                  "{/box/state: std_msgs/Float64MultiArray}");
  EXPECT_EQ(found.topics()[static_cast<std::size_t>(found.topic("/fix"))].type, "sensor_msgs/msg/NavSatFix");
  EXPECT_EQ(found.topics()[static_cast<std::size_t>(found.topic("/box/state"))].type, "std_msgs/msg/Float64MultiArray");
  EXPECT_EQ(found.hash(found.topic("/fix")).substr(0, 7), "RIHS01_");
  EXPECT_TRUE(found.reader(found.topic("/box/state"), {.fields = {"data[0]"}}));
}

TEST(LiveTopics, AsksForATypeThatNobodySays) {
  EXPECT_THAT([] { topics("outputs:\n  x: /my/sensor:data"); },
              ThrowsMessage<Error>(AllOf(HasSubstr("robot.yaml:2"), HasSubstr("ros.types"))));
}

TEST(LiveTopics, RefusesColumns) {
  EXPECT_THAT([] { topics("outputs:\n  x: speed"); }, ThrowsMessage<Error>(HasSubstr("a column")));
}

TEST(LiveTopics, HasNoRecordsOfItsOwn) {
  const LiveTopics found = topics("outputs: {x: {from: /fix, as: east}}");
  EXPECT_THROW(found.read({}, {}), Error);
  EXPECT_EQ(found.damage_at({.topic = found.topic("/fix"), .bytes = {}}, logs::RecordError("cut")).what, "/fix: cut");
}

}  // namespace
}  // namespace rhec::apps::ros::live_topics_test
