#include "rhec/logs/cdr/message_reader.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "rhec/logs/cdr/cdr_writer.hpp"
#include "support/error_of.hpp"

namespace rhec::logs {
namespace message_reader_test {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;

std::shared_ptr<const MessageType> type_of(const std::string& name) {
  return std::make_shared<const MessageType>(link_message(name, builtin_definitions()));
}

struct Read {
  Stamp stamp;
  std::vector<double> values;
};
Read read(const std::string& type, const CdrWriter& message, const FieldRequest& request) {
  MessageReader reader(type_of(type), request);
  Read result{0, std::vector<double>(request.fields.size())};
  result.stamp = reader.read({.topic = 0, .received = 5, .place = 0, .bytes = message.bytes()}, result.values.data());
  return result;
}

CdrWriter joints(Stamp stamp = 1'500'000'000) {
  CdrWriter message;
  message.header(stamp, "base_link");
  message.length(3);
  for (const char* name : {"left", "steer", "right"}) message.text(name);
  message.length(3);
  message.numbers(std::vector<double>{0.1, 0.2, 0.3});
  message.length(2);  // a driver that leaves one out
  message.numbers(std::vector<double>{1.0, 2.0});
  message.length(0);
  return message;
}

TEST(MessageReader, TakesItemsByIndexAndByName) {
  const Read found =
      read("sensor_msgs/msg/JointState", joints(),
           {{"position[steer]", "velocity[0]", "position[right]", "velocity[right]", "position[gone]", "effort[0]"}});
  EXPECT_EQ(found.stamp, 1'500'000'000);
  EXPECT_EQ(found.values[0], 0.2);
  EXPECT_EQ(found.values[1], 1.0);
  EXPECT_EQ(found.values[2], 0.3);
  for (int i = 3; i < 6; ++i) EXPECT_TRUE(std::isnan(found.values[static_cast<std::size_t>(i)]));
}

TEST(MessageReader, ItsClockIsTheHeadersOrWhatIsAskedFor) {
  const std::string type = "sensor_msgs/msg/JointState";
  EXPECT_EQ(read(type, joints(), {{}, "received"}).stamp, 5);
  EXPECT_EQ(read(type, joints(0), {}).stamp, 5);  // a stamp that nobody has set
  EXPECT_EQ(read(type, joints(), {{}, "header.stamp"}).stamp, 1'500'000'000);
  EXPECT_EQ(read(type, joints(), {{}, "position[left] [ms]"}).stamp, 100'000);
}

TEST(MessageReader, TakesStructuresByTheirOwnNames) {
  CdrWriter message;
  message.length(2);
  for (const char* child : {"wheel", "base_link"}) {
    message.header(7, "odom");
    message.text(child);
    message.numbers(std::vector<double>{child[0] == 'w' ? 1.0 : 2.0, 3.0, 4.0});
    message.numbers(std::vector<double>{0.0, 0.0, 0.0, 1.0});
  }
  const Read found = read("tf2_msgs/msg/TFMessage", message,
                          {{"transforms[base_link].transform.translation.x", "transforms[0].transform.translation.x",
                            "transforms[base_link].transform.rotation.w", "transforms[gone].transform.rotation.w"},
                           "transforms[base_link].header.stamp"});
  EXPECT_EQ(found.values[0], 2.0);
  EXPECT_EQ(found.values[1], 1.0);
  EXPECT_EQ(found.values[2], 1.0);
  EXPECT_TRUE(std::isnan(found.values[3]));
  EXPECT_EQ(found.stamp, 7);
}

TEST(MessageReader, ReadsBehindTextsAndCovariances) {
  CdrWriter message;
  message.header(9, "odom");
  message.text("base");
  for (int i = 0; i < 7; ++i) message.f64(i);
  for (int i = 0; i < 36; ++i) message.f64(100 + i);
  for (int i = 0; i < 6; ++i) message.f64(200 + i);
  for (int i = 0; i < 36; ++i) message.f64(300 + i);
  EXPECT_THAT(read("nav_msgs/msg/Odometry", message,
                   {{"twist.twist.angular.z", "pose.covariance[35]", "pose.pose.position.y", "twist.covariance[0]"}})
                  .values,
              ElementsAre(205.0, 135.0, 1.0, 300.0));
}

TEST(MessageReader, ACutMessageIsRefusedAndNeverReadBeyond) {
  const CdrWriter whole = joints();
  MessageReader reader(type_of("sensor_msgs/msg/JointState"), {{"effort[0]"}});
  double value = 0.0;
  for (std::size_t size = 0; size + 8 < whole.bytes().size(); ++size) {
    const std::vector<std::byte> cut(whole.bytes().begin(), whole.bytes().begin() + static_cast<std::ptrdiff_t>(size));
    EXPECT_THROW(reader.read({.topic = 0, .received = 0, .place = 0, .bytes = cut}, &value), RecordError) << size;
  }
}

TEST(MessageReader, FieldsThatCannotBeNameWhatThereIs) {
  const auto message = [](const char* type, const char* field) {
    return error_of([&] { MessageReader(type_of(type), {{field}}); });
  };
  EXPECT_THAT(message("nav_msgs/msg/Odometry", "twist.twist.linea.x"), HasSubstr("did you mean 'linear'"));
  EXPECT_THAT(message("nav_msgs/msg/Odometry", "twist.twist.linear"),
              AllOf(HasSubstr("not a number"), HasSubstr("x, y, z")));
  EXPECT_THAT(message("nav_msgs/msg/Odometry", "child_frame_id"), HasSubstr("is a text"));
  EXPECT_THAT(message("nav_msgs/msg/Odometry", "pose.covariance"), HasSubstr("e.g. covariance[0]"));
  EXPECT_THAT(message("nav_msgs/msg/Odometry", "pose.covariance[36]"), HasSubstr("has 36 items"));
  EXPECT_THAT(message("nav_msgs/msg/Odometry", "pose.covariance[x]"), HasSubstr("no list of names"));
  EXPECT_THAT(message("nav_msgs/msg/Odometry", "pose[0]"), HasSubstr("no list"));
  EXPECT_THAT(message("std_msgs/msg/Float64", "data.x"), HasSubstr("is a number, and has no field 'x'"));
}

TEST(MessageReader, ListsTheNumbersOfAMessage) {
  EXPECT_THAT(number_paths(*type_of("sensor_msgs/msg/JointState"), joints().bytes()),
              ElementsAre("position[left]", "position[steer]", "position[right]", "velocity[left]", "velocity[steer]"));
}

TEST(MessageReader, StructuresWithNamesAreListedByThem) {
  Definitions definitions;
  parse_ros2msg("my_msgs/msg/Wheel", "uint8 KIND=1\nfloat64 omega 0.0\nstring name", definitions);
  parse_ros2msg("my_msgs/msg/Drive", "Wheel[<=4] wheels", definitions);
  const auto type = std::make_shared<const MessageType>(link_message("my_msgs/msg/Drive", definitions));
  CdrWriter message;
  const std::vector<std::string> names{"left", "right", "left", "", "7"};
  message.u32(static_cast<std::uint32_t>(names.size()));
  for (const std::string& name : names) {
    message.f64(1.0);
    message.text(name);
  }
  EXPECT_THAT(number_paths(*type, message.bytes()),
              ElementsAre("wheels[left].omega", "wheels[right].omega", "wheels[2].omega", "wheels[3].omega",
                          "wheels[4].omega"));
  MessageReader reader(type, {{"wheels[right].omega"}});
  double value = 0.0;
  reader.read({.bytes = message.bytes()}, &value);
  EXPECT_EQ(value, 1.0);
}

}  // namespace message_reader_test
}  // namespace rhec::logs
