#include "core/control/retreat.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>

namespace rhec {
namespace retreat_test {

constexpr double pi = std::numbers::pi, nan = std::numeric_limits<double>::quiet_NaN();

Path straight(double velocity) { return Path({{0.0, 0.0, velocity}, {100.0, 0.0, velocity}}); }

TEST(Retreat, IsThePathBackwardsUntilTheVehicleIsAligned) {
  for (const double velocity : {2.0, -2.0}) {
    const Path path = straight(velocity);
    const double along = velocity > 0.0 ? 0.0 : pi;
    Retreat retreat;
    ASSERT_TRUE(retreat.begin(path, 0, 40.0, 0.5, 0.4));
    EXPECT_EQ(retreat.arc_length(), 40.0);
    EXPECT_NEAR(retreat.arc_length_after(40.0, 3.0), 38.5, 1e-12);
    const PathPoint there = retreat.point_at(path, 38.5);
    EXPECT_NEAR(there.x, 38.5, 1e-12);
    EXPECT_EQ(there.speed, velocity > 0.0 ? -0.5 : 0.5);
    EXPECT_EQ(there.in_reverse, velocity > 0.0);
    EXPECT_NEAR(std::remainder(there.heading - along, 2.0 * pi), 0.0, 1e-12) << "the vehicle looks where it did";
    retreat.advance(path, {39.2, 0.7, along + 0.3}, 0.2);
    EXPECT_TRUE(retreat.is_under_way());
    EXPECT_NEAR(retreat.arc_length(), 39.2, 1e-9);
    retreat.advance(path, {39.6, 0.7, along + 0.3}, 0.2);
    EXPECT_NEAR(retreat.arc_length(), 39.2, 1e-9) << "places become less";
    retreat.advance(path, {nan, 0.7, along + 0.3}, 0.2);
    EXPECT_TRUE(retreat.is_under_way()) << "what is no number says nothing";
    retreat.advance(path, {38.3, 0.1, along - 0.01}, 0.2);
    EXPECT_FALSE(retreat.is_under_way());
    EXPECT_TRUE(retreat.has_arrived());
    EXPECT_EQ(retreat.path_beside(path, 38.5), 38.5);
    EXPECT_NEAR(retreat.arc_length(), 38.3, 1e-9);
    EXPECT_EQ(retreat.goes_on_at(path, 0.0, 0.0), retreat.arc_length());
  }
}

TEST(Retreat, EndsWhereItHelpsNobody) {
  const Path path = straight(2.0);
  Retreat retreat;
  EXPECT_FALSE(retreat.begin(path, 0, 40.0, 0.5, 0.01)) << "the vehicle is aligned";
  EXPECT_FALSE(retreat.begin(path, 0, 40.0, 0.5, 2.0)) << "it looks away";
  EXPECT_FALSE(retreat.begin(path, 0, 40.0, 0.5, nan));
  EXPECT_FALSE(retreat.begin(path, 0, 40.0, 0.0, 0.4)) << "it has no speed to do so";
  EXPECT_FALSE(retreat.begin(path, 0, 0.05, 0.5, 0.4)) << "the path begins here";
  ASSERT_TRUE(retreat.begin(path, 0, 40.0, 0.5, 0.4));
  retreat.advance(path, {39.5, 0.5, 2.0}, 0.2);
  EXPECT_TRUE(retreat.is_under_way()) << "it was less when that began";
  retreat.advance(path, {39.5, 0.5, 2.5}, 0.2);
  EXPECT_FALSE(retreat.is_under_way()) << "it looks away";
  EXPECT_FALSE(retreat.has_arrived());
  ASSERT_TRUE(retreat.begin(path, 0, 40.0, 0.5, 0.4));
  for (double x = 39.5; x > 25.0; x -= 0.5) retreat.advance(path, {x, 0.5, 0.3}, 0.2);
  EXPECT_FALSE(retreat.is_under_way()) << "it has gone back for 20 s";
  EXPECT_EQ(retreat.arc_length_after(3.0, 100.0), 3.0) << "behind its end there is nothing to drive";
}

}  // namespace retreat_test
}  // namespace rhec
