// The wire against another implementation of DDS, eProsima's Fast DDS, which most nodes of ROS 2 use: both ways, on the
// loopback interface.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <string>
#include <vector>

#include "apps/ros/messages/type_hash.hpp"
#include "apps/ros/node/lever_arms.hpp"
#include "apps/ros/support/stranger.hpp"
#include "apps/ros/wire/participant.hpp"
#include "rhec/logs/cdr/cdr_cursor.hpp"
#include "rhec/plugins/yaml/yaml.hpp"
#include "rhec/sim/telemetry/robot_messages.hpp"

namespace rhec::apps::ros::participant_strangers_test {
namespace {

using ParticipantStrangers = StrangerTest;

WireTopic topic_of(const std::string& name, const std::string& type) {
  return {name, type, type_hash(type, logs::builtin_definitions())};
}

TEST_F(ParticipantStrangers, HearWhatIsSent) {
  Participant wire({.domain = domain_, .node = "rhec"});
  const std::string type = "nav_msgs/msg/Odometry";
  const int writer = wire.add_writer(topic_of("/rhec/odometry", type), Delivery::sure);
  wire.announce();
  const std::array readers{reader("rt/rhec/odometry", type, true, false),
                           reader("rt/rhec/odometry", type, false, false)};
  ASSERT_TRUE(becomes([&] { return wire.matched_readers(writer) == 2; }));
  logs::CdrWriter message;
  sim::write_odometry(5, {}, {1.0, 2.0, 3.0}, Eigen::Matrix3d::Identity(), 0.5, 0.25, message);
  const Bytes sent(message.bytes().begin(), message.bytes().end());
  for (eprosima::fastdds::dds::DataReader* reader : readers) {
    Bytes heard;
    EXPECT_TRUE(becomes([&] {
      wire.write(writer, message.bytes());
      heard = take(reader);
      return !heard.empty();
    }));
    ASSERT_GE(heard.size(), sent.size());
    heard.resize(sent.size());  // what is behind fills up to a multiple of four
    EXPECT_EQ(heard, sent);
  }
}

TEST_F(ParticipantStrangers, AreHeardReliableOrNot) {
  Participant wire({.domain = domain_, .node = "rhec"});
  const std::string type = "sensor_msgs/msg/Imu";
  const int reader = wire.add_reader(topic_of("/imu", type), Delivery::latest);
  wire.announce();
  logs::CdrWriter message;
  message.header(7, "imu_link");
  message.numbers(std::vector<double>(37, 0.5));
  Bytes sent(message.bytes().begin(), message.bytes().end());
  int expected = 0;
  for (const bool is_reliable : {true, false}) {
    eprosima::fastdds::dds::DataWriter* const writer = this->writer("rt/imu", type, is_reliable);
    ASSERT_TRUE(becomes([&] { return wire.matched_writers(reader) == expected + 1; }));
    ++expected;
    Bytes heard;
    EXPECT_TRUE(becomes([&] {
      writer->write(&sent);
      if (wire.wait(Clock::now() + std::chrono::milliseconds(50)))
        wire.take([&](const Arrival& arrival) { heard.assign(arrival.cdr.begin(), arrival.cdr.end()); });
      return !heard.empty();
    }));
    EXPECT_EQ(heard, sent);
  }
}

TEST_F(ParticipantStrangers, LearnWhatNodesOfRosTellOfThemselves) {
  Participant wire({.domain = domain_, .node = "my_node"});
  const WireTopic topic = topic_of("/cmd_vel", "geometry_msgs/msg/TwistStamped");
  wire.add_writer(topic, Delivery::sure);
  wire.announce();
  EXPECT_TRUE(becomes([&] { return !discovery_.writer("rt/cmd_vel").first.empty(); }));
  EXPECT_EQ(discovery_.writer("rt/cmd_vel").first, "geometry_msgs::msg::dds_::TwistStamped_");
  EXPECT_EQ(discovery_.writer("rt/cmd_vel").second, "typehash=" + topic.hash + ";");
  const std::vector<std::string> participants = discovery_.participants();
  EXPECT_NE(std::find(participants.begin(), participants.end(), "enclave=/;"), participants.end());
  // Who comes later hears which endpoints are the node's.
  eprosima::fastdds::dds::DataReader* const reader =
      this->reader("ros_discovery_info", "rmw_dds_common/msg/ParticipantEntitiesInfo", true, true);
  Bytes heard;
  ASSERT_TRUE(becomes([&] {
    heard = take(reader);
    return !heard.empty();
  }));
  logs::CdrCursor cursor(heard);
  cursor.skip_numbers(logs::Kind::u8, 16);
  EXPECT_EQ(cursor.length(8), 1u);
  EXPECT_EQ(cursor.text(), "/");
  EXPECT_EQ(cursor.text(), "my_node");
  EXPECT_EQ(cursor.length(16), 0u);  // readers
  EXPECT_EQ(cursor.length(16), 1u);  // writers
}

TEST_F(ParticipantStrangers, TellWhereSensorsAre) {
  Participant wire({.domain = domain_, .node = "rhec"});
  RosOptions options;
  options.patience = 20.0;
  options.lever_arms = parse_yaml("{antenna_x: gps_link.x, antenna_y: -gps_link.y}", "robot.yaml");
  // The mast stands 1 m ahead and is turned to the left; the antenna is 0.5 m along its own x, so to the vehicle's
  // left.
  eprosima::fastdds::dds::DataWriter* const writer = this->writer("rt/tf_static", "tf2_msgs/msg/TFMessage", true, true);
  logs::CdrWriter message;
  message.length(2);
  message.header(0, "base_link");
  message.text("mast");
  message.numbers(std::array{1.0, 0.0, 0.0, 0.0, 0.0, std::sqrt(0.5), std::sqrt(0.5)});
  message.header(0, "mast");
  message.text("gps_link");
  message.numbers(std::array{0.5, 0.0, 2.0, 0.0, 0.0, 0.0, 1.0});
  Bytes sent(message.bytes().begin(), message.bytes().end());
  ASSERT_TRUE(writer->write(&sent));
  Settings settings = parse_yaml("model: {name: skid_steer}", "robot.yaml");
  set_lever_arms(wire, options, settings);
  EXPECT_NEAR(settings.find_path("model.antenna_x")->as_number(), 1.0, 1e-12);
  EXPECT_NEAR(settings.find_path("model.antenna_y")->as_number(), -0.5, 1e-12);
}

}  // namespace
}  // namespace rhec::apps::ros::participant_strangers_test
