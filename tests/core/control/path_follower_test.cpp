#include "rhec/core/control/path_follower.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <vector>

#include "rhec/core/base/error.hpp"

namespace rhec {
namespace path_follower_test {

constexpr double pi = std::numbers::pi;

// An L: 3 m along +x, then 4 m along +y.
Path corner() { return Path({{0, 0, 1.0}, {3, 0, 2.0}, {3, 4, 4.0}}); }

TEST(PathFollower, ProjectsOnSegmentsWithASignedDistance) {
  const Path path = corner();
  PathFollower follower(path);
  EXPECT_DOUBLE_EQ(follower.advance(1.25, 0.5), 1.25);
  EXPECT_DOUBLE_EQ(follower.lateral(), 0.5) << "left of +x is +y";
  EXPECT_DOUBLE_EQ(follower.advance(1.5, -0.25), 1.5);
  EXPECT_DOUBLE_EQ(follower.lateral(), -0.25);
  EXPECT_DOUBLE_EQ(follower.advance(4.0, -1.0), 3.0) << "outside the corner the corner itself is closest";
  EXPECT_DOUBLE_EQ(follower.lateral(), -std::sqrt(2.0));
}

TEST(PathFollower, StopsAtTheStartAndFinishesAtTheEnd) {
  const Path path = corner();
  PathFollower follower(path);
  EXPECT_DOUBLE_EQ(follower.advance(-5.0, 0.0), 0.0);
  EXPECT_FALSE(follower.finished());
  follower.advance(2.9, 1.0);
  follower.advance(3.0, 3.99);
  EXPECT_FALSE(follower.finished());
  EXPECT_DOUBLE_EQ(follower.advance(2.5, 4.5), 7.5) << "the last segment goes on";
  EXPECT_TRUE(follower.finished());
  EXPECT_DOUBLE_EQ(follower.lateral(), 0.5);
  follower.reset();
  EXPECT_FALSE(follower.finished());
  EXPECT_DOUBLE_EQ(follower.arc_length(), 0.0);
}

TEST(PathFollower, StaysWhereItIsOnANonFinitePosition) {
  const Path path = corner();
  PathFollower follower(path);
  follower.advance(1.0, 0.2);
  EXPECT_DOUBLE_EQ(follower.advance(std::numeric_limits<double>::quiet_NaN(), 0.0), 1.0);
  EXPECT_DOUBLE_EQ(follower.lateral(), 0.2);
}

TEST(PathFollower, RefusesAWindowThatSeesNothing) {
  const Path path = corner();
  EXPECT_THROW(PathFollower(path, {.ahead = 0.0}), Error);
  EXPECT_THROW(PathFollower(path, {.ahead = 5.0, .behind = -1.0}), Error);
  EXPECT_THROW(PathFollower(path, {.ahead = std::numeric_limits<double>::quiet_NaN()}), Error);
}

// A figure-8 whose branches really cross at the origin (a lemniscate of Gerono, 40 m wide), two laps.
Path crossing_eight() {
  std::vector<Waypoint> waypoints;
  for (int i = 0; i <= 4000; ++i) {
    const double t = pi / 2 + 4.0 * pi * i / 4000.0;
    waypoints.push_back({40.0 * std::sin(t), 40.0 * std::sin(t) * std::cos(t), {}});
  }
  return Path(waypoints);
}

TEST(PathFollower, NeverJumpsBranchesAtACrossing) {
  const Path path = crossing_eight();
  const double stride = 1.0, noise = 0.4;
  for (unsigned seed = 0; seed < 20; ++seed) {
    std::mt19937 random(seed);
    std::normal_distribution<double> lateral(0.0, noise);
    PathFollower follower(path);
    for (double arc_length = 0.0; arc_length < path.length(); arc_length += stride) {
      const PathPoint point = path.point_at(arc_length);
      const double offset = lateral(random);
      const double found =
          follower.advance(point.x - offset * std::sin(point.heading), point.y + offset * std::cos(point.heading));
      ASSERT_NEAR(found, arc_length, 1.0) << "seed " << seed;
    }
  }
  // The test could fail: a search over the whole path does jump.
  const PathPoint before_crossing = path.point_at(path.length() / 8.0 + 0.3);
  const PathProjection anywhere =
      path.closest(before_crossing.x + 0.3, before_crossing.y + 0.3, path.length() / 4, path.length());
  EXPECT_LT(std::abs(anywhere.lateral), 1.0);
  EXPECT_GT(anywhere.arc_length, path.length() / 4);
}

// Two tangent circles that are driven in turn, or one alone, from (0, 0) on.
Path circles(double radius, int circles, bool in_turn, double spacing) {
  std::vector<Waypoint> waypoints{{0.0, 0.0, {}}};
  const int count = static_cast<int>(std::ceil(2.0 * pi * radius / spacing));
  for (int c = 0; c < circles; ++c) {
    const double side = in_turn && c % 2 == 1 ? -1.0 : 1.0;
    for (int i = 1; i <= count; ++i) {
      const double turn = 2.0 * pi * i / count;
      waypoints.push_back({radius * std::sin(turn), side * radius * (1.0 - std::cos(turn)), {}});
    }
  }
  return Path(waypoints);
}

/// Follows a vehicle that goes along the path by strides, off it by noise and an offset. The largest error of progress.
double worst_progress(const Path& path, PathFollower::Window window, double stride, double noise, double offset,
                      unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> error(0.0, noise);
  PathFollower follower(path, window);
  double worst = 0.0;
  for (double arc_length = 0.0; arc_length < path.length(); arc_length += stride) {
    const PathPoint point = path.point_at(arc_length);
    const double x = point.x - offset * std::sin(point.heading) + error(random);
    const double y = point.y + offset * std::cos(point.heading) + error(random);
    worst = std::max(worst, std::abs(follower.advance(x, y) - arc_length));
  }
  return worst;
}

TEST(PathFollower, SkipsNoLapOfCirclesShorterThanItsWindow) {
  for (const double radius : {0.15, 0.3, 0.7, 0.95, 1.3, 3.0})
    for (const bool in_turn : {false, true}) {
      const Path path = circles(radius, 6, in_turn, 0.1 * radius);
      for (unsigned seed = 0; seed < 3; ++seed)
        for (const double share : {0.02, 0.1, 0.25})          // strides, in radii
          for (const double offset : {-0.4, -0.2, 0.0, 0.3})  // beside the path, in radii
            ASSERT_LT(worst_progress(path, {}, share * radius, 0.05 * radius, in_turn ? 0.0 : offset * radius, seed),
                      0.5 * radius)
                << "radius " << radius << " m, stride " << share << ", offset " << offset << ", seed " << seed;
    }
}

TEST(PathFollower, IsOnTheSameLapAsSeenFromFarOutside) {
  const Path path = circles(0.3, 6, false, 0.03);
  PathFollower follower(path);
  for (double turn = 0.0; turn < 12.0 * pi - 0.1; turn += 0.1)
    ASSERT_NEAR(follower.advance(1.5 * std::sin(turn), 0.3 - 1.5 * std::cos(turn)), 0.3 * turn, 0.03);
}

TEST(PathFollower, PassesWhatIsSmallerThanItsStride) {
  // Waypoints of a vehicle that waited: noise about one place, which makes the path longer by metres.
  std::mt19937 random(5);
  std::normal_distribution<double> noise(0.0, 0.02);
  std::vector<Waypoint> waypoints;
  for (int i = 0; i <= 300; ++i) {
    const double x = i < 100 ? 0.05 * i : i < 200 ? 5.0 : 5.0 + 0.05 * (i - 200);
    waypoints.push_back({x + noise(random), noise(random), 1.0});
  }
  const Path path(waypoints);
  PathFollower follower(path);
  for (double x = 0.0; x <= 10.0; x += 0.2) {
    const PathPoint place = path.point_at(follower.advance(x, 0.1));
    ASSERT_NEAR(place.x, x, 0.15) << "at " << x;
  }
}

TEST(PathFollower, GetsBehindTheSharpestTurn) {
  for (const double degrees : {60.0, 120.0, 145.0}) {
    const double turn = degrees * pi / 180.0;
    const Path path({{0, 0, 1.0}, {10, 0, 1.0}, {10 + 10 * std::cos(turn), 10 * std::sin(turn), 1.0}});
    PathFollower follower(path);
    follower.advance(9.0, 0.0);
    follower.advance(9.3, 0.2);  // cuts the corner
    for (double on = 1.0; on < 5.0; on += 0.2)
      ASSERT_NEAR(follower.advance(10 + on * std::cos(turn), on * std::sin(turn)), 10.0 + on, 1e-9) << degrees;
  }
}

TEST(PathFollower, FindsAVehicleThatJumpedAhead) {
  std::vector<Waypoint> waypoints;
  for (int i = 0; i <= 1000; ++i) waypoints.push_back({0.1 * i, std::sin(0.05 * i), {}});
  const Path path(waypoints);
  PathFollower follower(path);
  follower.advance(10.0, std::sin(5.0));
  const double before = follower.arc_length();
  const PathPoint ahead = path.point_at(before + 6.0);
  EXPECT_NEAR(follower.advance(ahead.x + 0.1, ahead.y), before + 6.0, 0.2);
}

TEST(PathFollower, ResultDoesNotDependOnResolution) {
  // A straight line with few and with many waypoints; the window cuts the long segments.
  std::vector<Waypoint> fine;
  for (int i = 0; i <= 10000; ++i) fine.push_back({0.01 * i, 0.0, {}});
  const Path coarse_path({{0, 0, {}}, {100, 0, {}}}), fine_path(fine);
  PathFollower coarse(coarse_path), finely(fine_path);
  std::mt19937 random(3);
  std::uniform_real_distribution<double> step(-1.5, 3.0), side(-2.0, 2.0);
  for (double x = 0.0; x < 100.0; x += step(random)) {
    const double y = side(random);
    ASSERT_NEAR(coarse.advance(x, y), finely.advance(x, y), 1e-9);
    ASSERT_NEAR(coarse.lateral(), finely.lateral(), 1e-9);
  }
}

// Forwards along +x, back along the same line, and off to the side.
Path cusps() {
  std::vector<Waypoint> waypoints;
  for (int i = 0; i <= 100; ++i) waypoints.push_back({0.1 * i, 0.0, i < 100 ? 1.0 : 0.0});
  for (int i = 1; i <= 50; ++i) waypoints.push_back({10.0 - 0.1 * i, 0.0, i < 50 ? -1.0 : 0.0});
  for (int i = 1; i <= 50; ++i) waypoints.push_back({5.0 + 0.1 * i, 0.02 * i, 1.0});
  return {waypoints, {.acceleration = 1.0}};
}

TEST(PathFollower, LeavesASectionWhereItsStopIsReached) {
  const Path path = cusps();
  ASSERT_EQ(path.section_count(), 3);
  PathFollower follower(path, {.stop_distance = 0.1, .stop_time = 0.0});
  for (double x = 0.0; x < 9.85; x += 0.5) EXPECT_NEAR(follower.advance(x, 0.02), x, 1e-9);
  EXPECT_NEAR(follower.advance(9.5, 0.0), 9.5, 1e-9) << "not yet there, so not on the way back";
  EXPECT_EQ(follower.section(), 0);
  EXPECT_NEAR(follower.advance(9.92, 0.0), 10.08, 1e-9);
  EXPECT_EQ(follower.section(), 1);
  EXPECT_NEAR(follower.advance(9.0, -0.1), 11.0, 1e-9);
  EXPECT_NEAR(follower.lateral(), 0.1, 1e-9) << "left of the path, which goes along -x";
  EXPECT_NEAR(follower.advance(5.05, 0.0), 15.05, 0.05);
  EXPECT_EQ(follower.section(), 2);
  EXPECT_FALSE(follower.finished());
  PathFollower in_time(path, {.stop_distance = 0.0, .stop_time = 0.5});
  in_time.locate(9.0, 0.0, 0.0);
  EXPECT_EQ(in_time.section(), 0);
  in_time.advance(9.8, 0.0);  // 0.2 m = 1/2 a t^2 with t = 0.63 s
  EXPECT_EQ(in_time.section(), 0);
  in_time.advance(9.9, 0.0);  // 0.45 s
  EXPECT_EQ(in_time.section(), 1);
}

TEST(PathFollower, ComesToAnEndWhereThePathDoes) {
  const Path path({{0, 0, 1.0}, {5, 0, 1.0}, {10, 0, 0.0}});
  PathFollower follower(path);
  follower.advance(5.0, 0.0);
  follower.advance(9.7, 0.0);
  EXPECT_FALSE(follower.finished());
  follower.advance(9.95, 0.0);
  EXPECT_TRUE(follower.finished());
  follower.reset();
  EXPECT_FALSE(follower.finished());
}

TEST(PathFollower, OneFollowsTheSectionsOfAnother) {
  const Path path = cusps();
  PathFollower leader(path), other(path);
  leader.locate(9.5, 0.0, 0.0);
  other.locate(9.5, 0.0, 0.0);
  other.advance_with(leader, 9.99, 0.0);
  EXPECT_EQ(other.section(), 0);
  leader.advance(9.95, 0.0);
  other.advance_with(leader, 9.6, 0.0);
  EXPECT_EQ(other.section(), 1);
  EXPECT_NEAR(other.arc_length(), 10.4, 1e-9);
}

/// Whoever takes itself to be at the end of the path does not take others there.
TEST(PathFollower, OneFinishesByItsOwnPlace) {
  const Path path({{0.0, 0.0, 1.0}, {10.0, 0.0, 1.0}, {20.0, 0.0, 0.0}});
  PathFollower leader(path), other(path);
  for (double x = 0.0; x <= 20.0; x += 0.5) {
    leader.advance(x, 0.0);
    other.advance_with(leader, 0.5 * x, 0.0);
  }
  EXPECT_TRUE(leader.finished());
  EXPECT_FALSE(other.finished());
  EXPECT_NEAR(other.arc_length(), 10.0, 1e-9);
}

TEST(PathFollower, RefusesStopsThatAreNeverReached) {
  const Path path = corner();
  EXPECT_THROW(PathFollower(path, {.stop_distance = -1.0}), Error);
  EXPECT_THROW(PathFollower(path, {.stop_time = std::numeric_limits<double>::quiet_NaN()}), Error);
}

}  // namespace path_follower_test
}  // namespace rhec
