#include "rhec/core/control/path.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <string>

#include "rhec/core/base/error.hpp"
#include "support/error_of.hpp"

namespace rhec {
namespace path_test {

constexpr double pi = std::numbers::pi;

// An L: 3 m along +x, then 4 m along +y.
Path corner() { return Path({{0, 0, 1.0}, {3, 0, 2.0}, {3, 4, 4.0}}); }

TEST(Path, IsAddressedByArcLength) {
  const Path path = corner();
  EXPECT_DOUBLE_EQ(path.length(), 7.0);
  const PathPoint point = path.point_at(5.0);
  EXPECT_DOUBLE_EQ(point.x, 3.0);
  EXPECT_DOUBLE_EQ(point.y, 2.0);
  EXPECT_DOUBLE_EQ(point.heading, pi / 2);
  EXPECT_DOUBLE_EQ(point.speed, 3.0);
  EXPECT_DOUBLE_EQ(path.point_at(3.0).heading, pi / 2) << "at a waypoint the segment that follows counts";
  EXPECT_DOUBLE_EQ(path.point_at(2.999).heading, 0.0);
}

TEST(Path, GoesStraightOnBeyondItsEnds) {
  const Path path = corner();
  const PathPoint beyond = path.point_at(10.0);
  EXPECT_DOUBLE_EQ(beyond.x, 3.0);
  EXPECT_DOUBLE_EQ(beyond.y, 7.0);
  EXPECT_DOUBLE_EQ(beyond.speed, 4.0) << "the speed is held, not extrapolated";
  const PathPoint before = path.point_at(-2.0);
  EXPECT_DOUBLE_EQ(before.x, -2.0);
  EXPECT_DOUBLE_EQ(before.y, 0.0);
  EXPECT_DOUBLE_EQ(before.speed, 1.0);
}

TEST(Path, DropsRepeatedWaypoints) {
  const Path path({{0, 0, 2}, {0, 0, 9}, {1, 0, 3}, {1, 0, 9}, {1, 0, 9}, {2, 0, 4}, {2, 0, 9}});
  EXPECT_EQ(path.size(), 3);
  EXPECT_DOUBLE_EQ(path.length(), 2.0);
  const PathPoint point = path.point_at(1.0);
  EXPECT_DOUBLE_EQ(point.x, 1.0);
  EXPECT_DOUBLE_EQ(point.speed, 3.0);
}

TEST(Path, RefusesWhatIsNoPath) {
  const double nan = std::numeric_limits<double>::quiet_NaN(), infinity = std::numeric_limits<double>::infinity();
  EXPECT_THROW(Path(std::vector<Waypoint>{}), Error);
  EXPECT_THROW(Path(std::vector<Waypoint>{{1, 2, {}}}), Error);
  EXPECT_THROW(Path({{1, 2, {}}, {1, 2, {}}}), Error);
  EXPECT_NE(error_of([&] { Path({{0, 0, {}}, {nan, 0, {}}}); }).find("waypoint 2"), std::string::npos);
  EXPECT_NE(error_of([&] { Path({{0, infinity, {}}, {1, 0, {}}}); }).find("waypoint 1"), std::string::npos);
  EXPECT_NE(error_of([&] { Path({{0, 0, {}}, {1, 0, nan}}); }).find("waypoint 2"), std::string::npos);
}

TEST(Path, ClosestPointIsWhatAFineSearchFinds) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> place(-10.0, 10.0);
  std::vector<Waypoint> waypoints;
  waypoints.reserve(12);
  for (int i = 0; i < 12; ++i) waypoints.push_back({place(random), place(random), {}});
  const Path path(waypoints);
  for (int trial = 0; trial < 50; ++trial) {
    const double x = place(random), y = place(random);
    double from = path.length() * (place(random) + 10.0) / 20.0, to = path.length() * (place(random) + 10.0) / 20.0;
    if (from > to) std::swap(from, to);
    double smallest = std::numeric_limits<double>::infinity();
    for (int i = 0; i <= 20000; ++i) {
      const PathPoint point = path.point_at(from + (to - from) * i / 20000.0);
      smallest = std::min(smallest, std::hypot(point.x - x, point.y - y));
    }
    const PathProjection found = path.closest(x, y, from, to);
    EXPECT_GE(found.arc_length, from - 1e-9);
    EXPECT_LE(found.arc_length, to + 1e-9);
    const PathPoint point = path.point_at(found.arc_length);
    EXPECT_NEAR(std::hypot(point.x - x, point.y - y), std::abs(found.lateral), 1e-9);
    EXPECT_LE(std::abs(found.lateral), smallest + 1e-9);
    EXPECT_GE(std::abs(found.lateral), smallest - 0.01);
  }
}

/// Short winding segments, so that the nearest one may be anywhere.
Path winding_path(unsigned seed, std::vector<double>* arc_lengths) {
  std::mt19937 random(seed);
  std::normal_distribution<double> turn(0.0, 0.4);
  std::uniform_real_distribution<double> length(0.01, 0.3);
  std::vector<Waypoint> waypoints{{0.0, 0.0, 1.0}};
  arc_lengths->assign(1, 0.0);
  double heading = 0.0;
  for (int i = 0; i < 400; ++i) {
    heading += turn(random);
    const double step = length(random);
    const Waypoint& last = waypoints.back();
    waypoints.push_back({last.x + step * std::cos(heading), last.y + step * std::sin(heading), 1.0 + 0.01 * i});
    arc_lengths->push_back(arc_lengths->back() + step);
  }
  return Path(waypoints);
}

TEST(Path, ClosestPointIsTheBestOfAllSegments) {
  for (unsigned seed = 0; seed < 20; ++seed) {
    std::vector<double> arc_lengths;
    const Path path = winding_path(seed, &arc_lengths);
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> place(-6.0, 6.0), share(-0.1, 1.1);
    for (int trial = 0; trial < 100; ++trial) {
      const double x = place(random), y = place(random);
      double from = path.length() * share(random), to = path.length() * share(random);
      if (from > to) std::swap(from, to);
      // Reference: each segment separately.
      double nearest = std::numeric_limits<double>::infinity(), begin = from;
      for (const double end : arc_lengths) {
        if (end <= begin || end >= to) continue;
        nearest = std::min(nearest, std::abs(path.closest(x, y, begin, end).lateral));
        begin = end;
      }
      nearest = std::min(nearest, std::abs(path.closest(x, y, begin, to).lateral));
      ASSERT_NEAR(std::abs(path.closest(x, y, from, to).lateral), nearest, 1e-12) << "seed " << seed << ", " << trial;
    }
  }
}

TEST(Path, APointIsTheSameFromWhateverSegmentItIsSearched) {
  std::vector<double> arc_lengths;
  const Path path = winding_path(1, &arc_lengths);
  std::mt19937 random(1);
  std::uniform_real_distribution<double> share(-0.1, 1.1);
  int segment = -7;
  for (int trial = 0; trial < 2000; ++trial) {
    // Far away, or a little on or back, or a waypoint itself.
    const double arc_length = trial % 3 == 0   ? path.length() * share(random)
                              : trial % 3 == 1 ? arc_lengths[segment] + share(random)
                                               : arc_lengths[random() % arc_lengths.size()];
    const PathPoint expected = path.point_at(arc_length), found = path.point_at(arc_length, segment);
    ASSERT_EQ(found.x, expected.x) << arc_length;
    ASSERT_EQ(found.y, expected.y);
    ASSERT_EQ(found.heading, expected.heading);
    ASSERT_EQ(found.speed, expected.speed);
    ASSERT_GE(segment, 0);
    ASSERT_LT(segment, path.size() - 1);
  }
}

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

}  // namespace path_test
}  // namespace rhec
