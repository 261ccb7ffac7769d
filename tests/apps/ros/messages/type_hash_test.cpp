#include "apps/ros/messages/type_hash.hpp"

#include <gtest/gtest.h>

#include "rhec/core/base/error.hpp"

namespace rhec::apps::ros::type_hash_test {
namespace {

std::string hash_of(const std::string& type) { return type_hash(type, logs::builtin_definitions()); }

struct Published {
  const char *type, *hash;
};
class TypeHash : public testing::TestWithParam<Published> {};

TEST_P(TypeHash, IsTheOneThatOthersPublish) { EXPECT_EQ(hash_of(GetParam().type), GetParam().hash); }

// What ROS 2 Jazzy publishes beside its interfaces (.json): a text, nested types, arrays, sequences, a type without
// fields.
INSTANTIATE_TEST_SUITE_P(
    OfRos, TypeHash,
    testing::Values(
        Published{"std_msgs/msg/String", "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"},
        Published{"builtin_interfaces/msg/Time",
                  "RIHS01_b106235e25a4c5ed35098aa0a61a3ee9c9b18d197f398b0e4206cea9acf9c197"},
        Published{"geometry_msgs/msg/Twist", "RIHS01_9c45bf16fe0983d80e3cfe750d6835843d265a9a6c46bd2e609fcddde6fb8d2a"},
        Published{"nav_msgs/msg/Odometry", "RIHS01_3cc97dc7fb7502f8714462c526d369e35b603cfc34d946e3f2eda2766dfec6e0"},
        Published{"sensor_msgs/msg/JointState",
                  "RIHS01_a13ee3a330e346c9d87b5aa18d24e11690752bd33a0350f11c5882bc9179260e"},
        Published{"std_msgs/msg/Empty", "RIHS01_20b625256f32d5dbc0d04fee44f43c41e51c70d3502f84b4a08e7a9c26a96312"}));

// What the simulator CARLA has as golden values of its messages, of ROS 2 Jazzy.
INSTANTIATE_TEST_SUITE_P(
    OfCarla, TypeHash,
    testing::Values(
        Published{"ackermann_msgs/msg/AckermannDriveStamped",
                  "RIHS01_48ca7612a08d3bb72744fd98b71b7cf2ea24c6ad50fa4e1aa0bbad963c90d8cf"},
        Published{"rosgraph_msgs/msg/Clock", "RIHS01_692f7a66e93a3c83e71765d033b60349ba68023a8c689a79e48078bcb5c58564"},
        Published{"sensor_msgs/msg/Imu", "RIHS01_7d9a00ff131080897a5ec7e26e315954b8eae3353c3f995c55faf71574000b5b"},
        Published{"sensor_msgs/msg/NavSatFix",
                  "RIHS01_62223ab3fe210a15976021da7afddc9e200dc9ec75231c1b6a557fc598a65404"},
        Published{"tf2_msgs/msg/TFMessage",
                  "RIHS01_e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087"}));

// Constants of programs that speak with nodes of ROS 2 Jazzy over Zenoh, whose keys contain them, in public
// repositories. Of ObstacleArrayMsg nobody publishes one; all others that are heard or sent are among these.
INSTANTIATE_TEST_SUITE_P(
    OfZenoh, TypeHash,
    testing::Values(
        Published{"std_msgs/msg/Bool", "RIHS01_feb91e995ff9ebd09c0cb3d2aed18b11077585839fb5db80193b62d74528f6c9"},
        Published{"geometry_msgs/msg/TwistStamped",
                  "RIHS01_5f0fcd4f81d5d06ad9b4c4c63e3ea51b82d6ae4d0558f1d475229b1121db6f64"},
        Published{"geometry_msgs/msg/PoseArray",
                  "RIHS01_af0cc36d190e104d546d168d6b39df04fa4b4ccecf59cb4c9ed328d3d5004aa0"},
        Published{"nav_msgs/msg/Path", "RIHS01_1957a5bb3cee5da65c4e52e52b65a93df227efce4c20f8458b36e73066ca334b"},
        Published{"diagnostic_msgs/msg/DiagnosticArray",
                  "RIHS01_5a8a36efb05fb25070fa0fb3810290c0e6cd4862b54a8fb975a1ee8dc55a333e"}));

TEST(TypeHashes, TellBytesFromNumbers) {
  logs::Definitions definitions;
  logs::parse_ros2msg("a/msg/Byte", "byte data", definitions);
  logs::parse_ros2msg("a/msg/Number", "uint8 data", definitions);
  EXPECT_NE(type_description("a/msg/Byte", definitions).find("\"type_id\": 16"), std::string::npos);
  EXPECT_NE(type_description("a/msg/Number", definitions).find("\"type_id\": 3"), std::string::npos);
}

TEST(TypeHashes, NeedDefinitions) { EXPECT_THROW(hash_of("nobody_msgs/msg/Nothing"), Error); }

}  // namespace
}  // namespace rhec::apps::ros::type_hash_test
