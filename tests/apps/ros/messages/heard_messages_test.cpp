#include "apps/ros/messages/heard_messages.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>

#include "rhec/logs/cdr/cdr_writer.hpp"
#include "rhec/sim/telemetry/robot_messages.hpp"

namespace rhec::apps::ros::heard_messages_test {
namespace {

using logs::CdrWriter;
using logs::RecordError;

TEST(HeardMessages, ReadsAPath) {
  const std::array poses{sim::PlanarPose{1.0, 2.0, 0.3}, sim::PlanarPose{-4.0, 5.0, 0.0}};
  const std::array<logs::Stamp, 2> times{7, 8};
  CdrWriter message;
  sim::write_path(1'500'000'000, "odom", poses, times, message);
  const Positions path = read_path(message.bytes());
  EXPECT_EQ(path.header.frame, "odom");
  EXPECT_EQ(path.header.stamp, 1'500'000'000);
  ASSERT_EQ(path.places.size(), 2u);
  EXPECT_EQ(path.places[1].x, -4.0);
  EXPECT_EQ(path.places[1].y, 5.0);
}

TEST(HeardMessages, RefusesAPathThatIsCutOrNotFinite) {
  const std::array poses{sim::PlanarPose{1.0, std::numeric_limits<double>::quiet_NaN(), 0.0}};
  const std::array<logs::Stamp, 1> times{0};
  CdrWriter message;
  sim::write_path(0, "odom", poses, times, message);
  EXPECT_THROW(read_path(message.bytes()), RecordError);
  for (std::size_t size = 0; size < message.bytes().size(); ++size)
    EXPECT_THROW(read_path(message.bytes().first(size)), RecordError) << size;
}

TEST(HeardMessages, RefusesALengthThatThereIsNoRoomFor) {
  CdrWriter message;
  message.header(0, "odom");
  message.length(4'000'000'000u);
  EXPECT_THROW(read_path(message.bytes()), RecordError);
  EXPECT_THROW(read_pose_array(message.bytes()), RecordError);
}

TEST(HeardMessages, ReadsPosesTransformsFlagsAndClocks) {
  CdrWriter message;
  message.header(0, "map");
  message.length(1);
  message.numbers(std::array{3.0, 4.0, 0.0, 0.0, 0.0, 0.0, 1.0});
  EXPECT_EQ(read_pose_array(message.bytes()).places.at(0).y, 4.0);

  message.clear();
  sim::write_transform(0, {"odom", "base_link"}, {1.0, 2.0, M_PI}, message);
  const std::vector<PlaceOfFrame> transforms = read_transforms(message.bytes());
  ASSERT_EQ(transforms.size(), 1u);
  EXPECT_EQ(transforms[0].parent, "odom");
  EXPECT_EQ(transforms[0].child, "base_link");
  EXPECT_EQ(transforms[0].translation[1], 2.0);
  EXPECT_NEAR(transforms[0].rotation[2], 1.0, 1e-15);

  message.clear();
  message.flag(true);
  EXPECT_TRUE(read_flag(message.bytes()));
  message.clear();
  message.stamp(12'000'000'345);
  EXPECT_EQ(read_clock(message.bytes()), 12'000'000'345);
}

TEST(HeardMessages, RefusesStampsOfMoreThanASecondInNanoseconds) {
  CdrWriter message;
  message.i32(1);
  message.u32(1'000'000'000);
  EXPECT_THROW(read_clock(message.bytes()), RecordError);
}

std::vector<std::byte> fix(int status, double east_variance, double north_variance, int type) {
  CdrWriter message;
  message.header(0, "gps");
  message.i8(static_cast<std::int8_t>(status));
  message.u16(1);
  message.numbers(std::array{51.0, 7.0, 100.0});
  message.numbers(std::array{east_variance, 0.0, 0.0, 0.0, north_variance, 0.0, 0.0, 0.0, 9.0});
  message.u8(static_cast<std::uint8_t>(type));
  return {message.bytes().begin(), message.bytes().end()};
}

TEST(HeardMessages, TellsHowGoodAFixIs) {
  EXPECT_FALSE(read_fix_quality(fix(-1, 1.0, 1.0, 2)).has_fix);
  const FixQuality known = read_fix_quality(fix(0, 4.0, 16.0, 2));
  EXPECT_TRUE(known.has_fix);
  EXPECT_EQ(known.sigma, 4.0);
  EXPECT_EQ(read_fix_quality(fix(2, 4.0, 16.0, 0)).sigma, std::nullopt);
}

}  // namespace
}  // namespace rhec::apps::ros::heard_messages_test
