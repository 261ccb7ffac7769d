#include "core/control/approach.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>

namespace rhec {
namespace approach_test {

constexpr double pi = std::numbers::pi;
constexpr double speed = 1.2, radius = 3.0;
const TurningCircle turn{.radius = radius, .speed = speed};

Path straight(double velocity, double room = infinity) {
  Waypoint first, last;
  first.speed = last.speed = velocity;
  first.left = first.right = last.left = last.right = room;
  last.x = 100.0;
  return Path({first, last});
}

TEST(Approach, LeadsFromTheVehicleToThePathAndGoesOnAsThePath) {
  for (const double velocity : {2.0, -2.0}) {
    const Path path = straight(velocity);
    const double along = velocity > 0.0 ? 0.0 : pi;  // the heading of who drives along it
    for (const double beside : {0.0, 0.7, -4.0, 15.0}) {
      for (const double heading : {along + pi, along + 2.0, along - 2.5}) {
        Approach approach;
        ASSERT_TRUE(approach.begin(path, 0, 40.0, {40.0, beside, heading}, turn));
        EXPECT_TRUE(approach.is_under_way());
        const PathPoint first = approach.point_at(path, approach.arc_length());
        EXPECT_NEAR(first.x, 40.0, 1e-9);
        EXPECT_NEAR(first.y, beside, 1e-9);
        EXPECT_NEAR(std::remainder(first.heading - heading, 2.0 * pi), 0.0, 1e-9);
        EXPECT_EQ(first.speed, velocity > 0.0 ? speed : -speed);
        const PathPoint last = approach.point_at(path, approach.target() - 1e-9);
        EXPECT_NEAR(last.x, approach.target(), 1e-6);
        EXPECT_NEAR(last.y, 0.0, 1e-6);
        EXPECT_NEAR(std::remainder(last.heading - along, 2.0 * pi), 0.0, 1e-6);
        const PathPoint beyond = approach.point_at(path, approach.target() + 2.0);
        EXPECT_EQ(beyond.x, approach.target() + 2.0);
        EXPECT_EQ(beyond.y, 0.0);
        EXPECT_NEAR(approach.path_beside(path, approach.arc_length()), 40.0, 1e-9);
        EXPECT_NEAR(approach.path_beside(path, approach.target()), approach.target(), 1e-9);
        EXPECT_NEAR(approach.arc_length_after(approach.arc_length(), 2.0), approach.arc_length() + 2.0 * speed, 1e-12);
        EXPECT_GE(approach.target(), 40.0) << "nothing is driven twice";
        EXPECT_LT(approach.target(), 40.0 + 8.0 * radius + 1e-9);
      }
    }
  }
}

TEST(Approach, MovesOnWithTheVehicleToItsEnd) {
  const Path path = straight(2.0);
  Approach approach;
  ASSERT_TRUE(approach.begin(path, 0, 40.0, {40.0, 0.0, pi}, turn));
  double last = approach.arc_length();
  int steps = 0;
  for (; approach.is_under_way() && steps < 1000; ++steps) {
    // A little beside where it shall be, as one that slips is.
    const PathPoint there = approach.point_at(path, approach.arc_length_after(approach.arc_length(), 0.2));
    approach.advance(path, {there.x + 0.1, there.y - 0.1, there.heading + 0.3}, 0.2);
    EXPECT_GE(approach.arc_length(), last);
    EXPECT_LT(approach.arc_length(), last + 0.6 * radius) << "it does not leave an arc out";
    last = approach.arc_length();
  }
  EXPECT_LT(steps, 1000);
  EXPECT_TRUE(approach.has_arrived());
  EXPECT_EQ(approach.goes_on_at(path, 0.0, 0.0), approach.target());
}

TEST(Approach, EndsWhereTheVehicleHasLeftIt) {
  const Path path = straight(2.0);
  Approach approach;
  ASSERT_TRUE(approach.begin(path, 0, 40.0, {40.0, 0.0, pi}, turn));
  approach.advance(path, {40.0, 0.0, pi + 1.4}, 0.2);
  EXPECT_TRUE(approach.is_under_way());
  approach.advance(path, {40.0, 0.0, pi + 1.7}, 0.2);
  EXPECT_FALSE(approach.is_under_way());
  EXPECT_FALSE(approach.has_arrived());
  ASSERT_TRUE(approach.begin(path, 0, 40.0, {40.0, 0.0, pi}, turn));
  approach.advance(path, {40.0, 0.9 * radius, pi}, 0.2);
  EXPECT_TRUE(approach.is_under_way());
  approach.advance(path, {40.0 + 3.0 * radius, 0.0, pi}, 0.2);
  EXPECT_FALSE(approach.is_under_way()) << "it is elsewhere";
  EXPECT_FALSE(approach.has_arrived());
  EXPECT_EQ(approach.goes_on_at(path, 60.0, 0.0), std::nullopt) << "where it left the path";
}

TEST(Approach, KeepsToTheRoomBesideThePath) {
  Approach approach;
  // Half a circle has the width of its diameter.
  EXPECT_FALSE(approach.begin(straight(2.0, 0.5 * radius), 0, 40.0, {40.0, 0.0, pi}, turn));
  EXPECT_FALSE(approach.is_under_way());
  for (const double room : {1.1 * radius, 1.5 * radius, 2.5 * radius}) {
    const Path path = straight(2.0, room);
    ASSERT_TRUE(approach.begin(path, 0, 40.0, {40.0, 0.0, pi}, turn)) << room;
    for (double at = approach.arc_length(); at < approach.target(); at += 0.05)
      EXPECT_LE(std::abs(approach.point_at(path, at).y), room + 0.05) << room;
  }
  // From outside it may come in.
  EXPECT_TRUE(approach.begin(straight(2.0, 1.1 * radius), 0, 40.0, {40.0, -3.0 * radius, pi}, turn));
}

TEST(Approach, EndsInTheSectionThatIsDriven) {
  Waypoint first, stop, last;
  first.speed = 2.0;
  stop.x = 42.0;
  last.x = 20.0;
  last.speed = -2.0;
  const Path path({first, stop, last});
  Approach approach;
  ASSERT_TRUE(approach.begin(path, 0, 40.0, {40.0, 1.0, pi}, turn));
  EXPECT_LE(approach.target(), 42.0);
  EXPECT_LE(approach.arc_length_after(approach.target(), 100.0), 42.0);
}

TEST(Approach, ThereIsNoneWithoutATurnOrAPlace) {
  const Path path = straight(2.0);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  Approach approach;
  EXPECT_FALSE(approach.begin(path, 0, 40.0, {40.0, 0.0, pi}, {.radius = infinity, .speed = 0.0}));
  EXPECT_FALSE(approach.begin(path, 0, 40.0, {40.0, 0.0, pi}, {.radius = 1.0, .speed = 0.0}));
  EXPECT_FALSE(approach.begin(path, 0, 40.0, {nan, 0.0, pi}, turn));
  EXPECT_FALSE(approach.begin(path, 0, 40.0, {40.0, 0.0, nan}, turn));
}

}  // namespace approach_test
}  // namespace rhec
