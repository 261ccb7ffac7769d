#include "apps/ros/node/node_time.hpp"

#include <gtest/gtest.h>

#include <chrono>

namespace rhec::apps::ros::node_time_test {
namespace {

constexpr logs::Stamp second = 1'000'000'000;

Clock::time_point at(double seconds) {
  return Clock::time_point(std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(seconds)));
}

TEST(NodeTime, IsTheComputersUnlessItIsSimulated) {
  const NodeTime time(false);
  EXPECT_TRUE(time.is_known());
  EXPECT_GT(time.now(), 1'600'000'000 * second);
  EXPECT_EQ(time.instant_of(at(5.0)), at(5.0));
  EXPECT_EQ(time.silence(at(1e6)), 0.0);
}

TEST(NodeTime, IsNotKnownBeforeAClockIsHeard) {
  NodeTime time(true);
  EXPECT_FALSE(time.is_known());
  EXPECT_EQ(time.silence(at(100.0)), 0.0);
  EXPECT_FALSE(time.take(7 * second, at(100.0)));
  EXPECT_TRUE(time.is_known());
  EXPECT_EQ(time.now(), 7 * second);
  EXPECT_EQ(time.instant(), at(7.0));
  EXPECT_EQ(time.instant_of(at(100.0)), at(7.0));
  EXPECT_EQ(time.silence(at(103.0)), 3.0);
}

TEST(NodeTime, GoesBackOnlyInJumps) {
  NodeTime time(true);
  EXPECT_FALSE(time.take(100 * second, at(0.0)));
  EXPECT_FALSE(time.take(100 * second - second / 4, at(0.1)));  // out of order
  EXPECT_EQ(time.now(), 100 * second);
  EXPECT_EQ(time.take(40 * second, at(0.2)), 60.0);
  EXPECT_EQ(time.now(), 40 * second);
  EXPECT_FALSE(time.take(900 * second, at(0.3)));  // ahead is where time goes
  EXPECT_EQ(time.now(), 900 * second);
}

TEST(NodeTime, MayBeginAtZero) {
  NodeTime time(true);
  EXPECT_FALSE(time.take(0, at(0.0)));
  EXPECT_TRUE(time.is_known());
  EXPECT_FALSE(time.take(0, at(0.1)));
  EXPECT_EQ(time.silence(at(0.1)), 0.0);
}

}  // namespace
}  // namespace rhec::apps::ros::node_time_test
