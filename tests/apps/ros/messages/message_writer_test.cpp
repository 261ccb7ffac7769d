#include "apps/ros/messages/message_writer.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>

#include "rhec/core/base/error.hpp"
#include "rhec/logs/cdr/message_reader.hpp"

namespace rhec::apps::ros::message_writer_test {
namespace {

std::shared_ptr<const logs::MessageType> type_of(const std::string& name) {
  return std::make_shared<const logs::MessageType>(logs::link_message(name, logs::builtin_definitions()));
}

/// What a reader finds at paths; its stamp goes to `stamp`.
std::vector<double> read(const std::string& type, std::span<const std::byte> message,
                         const std::vector<std::string>& paths, logs::Stamp& stamp) {
  logs::MessageReader reader(type_of(type), {.fields = paths});
  std::vector<double> values(paths.size());
  stamp = reader.read({.bytes = message}, values.data());
  return values;
}

TEST(MessageWriter, WritesWhatAReaderFinds) {
  struct Case {
    const char* type;
    std::vector<std::string> paths;
  };
  const std::array cases{
      Case{"sensor_msgs/msg/Imu", {"orientation.z", "orientation.w", "angular_velocity.z"}},
      Case{"sensor_msgs/msg/NavSatFix", {"latitude", "longitude", "altitude", "position_covariance[4]"}},
      Case{"sensor_msgs/msg/JointState", {"position[left]", "velocity[left]", "velocity[right]"}},
      Case{"nav_msgs/msg/Odometry", {"pose.pose.position.x", "twist.twist.angular.z", "twist.covariance[35]"}},
      Case{"std_msgs/msg/Float64MultiArray", {"data[0]", "data[3]"}},
  };
  for (const Case& each : cases) {
    MessageWriter writer(type_of(each.type));
    double value = 1.5;
    for (const std::string& path : each.paths) writer.set(path, value += 1.0);
    logs::Stamp stamp = 0;
    const std::vector<double> found = read(each.type, writer.write(42, "frame"), each.paths, stamp);
    value = 1.5;
    for (const double number : found) EXPECT_EQ(number, value += 1.0) << each.type;
    if (std::string(each.type).starts_with("std_msgs")) continue;
    EXPECT_EQ(stamp, 42) << each.type;
  }
}

TEST(MessageWriter, AddsAndForgets) {
  MessageWriter writer(type_of("sensor_msgs/msg/JointState"));
  writer.add("velocity[a]", 1.0);
  writer.add("velocity[a]", 0.5);
  logs::Stamp stamp = 0;
  EXPECT_EQ(read("sensor_msgs/msg/JointState", writer.write(0, ""), {"velocity[a]"}, stamp)[0], 1.5);
  writer.clear();
  EXPECT_TRUE(writer.empty());
  EXPECT_TRUE(std::isnan(read("sensor_msgs/msg/JointState", writer.write(0, ""), {"velocity[a]"}, stamp)[0]));
}

TEST(MessageWriter, RefusesNumbersThatItCannotWrite) {
  MessageWriter writer(type_of("std_msgs/msg/Int64"));
  EXPECT_THROW(writer.write(0, ""), Error);
}

}  // namespace
}  // namespace rhec::apps::ros::message_writer_test
