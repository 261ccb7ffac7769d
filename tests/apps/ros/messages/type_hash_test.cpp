#include "apps/ros/messages/type_hash.hpp"

#include <gtest/gtest.h>

#include "rhec/core/base/error.hpp"

namespace rhec::apps::ros::type_hash_test {
namespace {

std::string hash_of(const std::string& type) { return type_hash(type, logs::builtin_definitions()); }

// As ROS 2 Jazzy publishes them beside its interfaces: a text, nested types, arrays, sequences, a type without fields.
TEST(TypeHash, IsTheOneThatRosPublishes) {
  EXPECT_EQ(hash_of("std_msgs/msg/String"), "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18");
  EXPECT_EQ(hash_of("builtin_interfaces/msg/Time"),
            "RIHS01_b106235e25a4c5ed35098aa0a61a3ee9c9b18d197f398b0e4206cea9acf9c197");
  EXPECT_EQ(hash_of("geometry_msgs/msg/Twist"),
            "RIHS01_9c45bf16fe0983d80e3cfe750d6835843d265a9a6c46bd2e609fcddde6fb8d2a");
  EXPECT_EQ(hash_of("nav_msgs/msg/Odometry"),
            "RIHS01_3cc97dc7fb7502f8714462c526d369e35b603cfc34d946e3f2eda2766dfec6e0");
  EXPECT_EQ(hash_of("sensor_msgs/msg/JointState"),
            "RIHS01_a13ee3a330e346c9d87b5aa18d24e11690752bd33a0350f11c5882bc9179260e");
  EXPECT_EQ(hash_of("std_msgs/msg/Empty"), "RIHS01_20b625256f32d5dbc0d04fee44f43c41e51c70d3502f84b4a08e7a9c26a96312");
}

TEST(TypeHash, TellsBytesFromNumbers) {
  logs::Definitions definitions;
  logs::parse_ros2msg("a/msg/Byte", "byte data", definitions);
  logs::parse_ros2msg("a/msg/Number", "uint8 data", definitions);
  EXPECT_NE(type_description("a/msg/Byte", definitions).find("\"type_id\": 16"), std::string::npos);
  EXPECT_NE(type_description("a/msg/Number", definitions).find("\"type_id\": 3"), std::string::npos);
}

TEST(TypeHash, RefusesWhatIsNotDefined) { EXPECT_THROW(hash_of("nobody_msgs/msg/Nothing"), Error); }

}  // namespace
}  // namespace rhec::apps::ros::type_hash_test
