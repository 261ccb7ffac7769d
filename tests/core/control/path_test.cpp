#include "rhec/core/control/path.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <string>
#include <utility>
#include <vector>

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
  EXPECT_DOUBLE_EQ(point.speed, std::sqrt(10.0)) << "between 2 and 4 m/s with constant acceleration";
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
  EXPECT_NE(error_of([&] {
              Path({{0, 0, 1.0}, {1, 0, 1.0}, {1.7e308, 1e308, 1.0}});
            }).find("waypoint 3"),
            std::string::npos);
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

TEST(Path, ThePointThatIsClosestToNoPlaceIsOneOfThePath) {
  constexpr double nothing = std::numeric_limits<double>::quiet_NaN();
  const Path path({{0, 0, 2}, {3, 0, 2}, {3, 4, 2}});
  for (const auto& [x, y] :
       {std::pair{nothing, 0.0}, {0.0, nothing}, {infinity, 0.0}, {-infinity, infinity}, {1e308, 1e308}}) {
    const double found = path.closest(x, y, 1.0, 6.0).arc_length;
    EXPECT_TRUE(found >= 1.0 && found <= 6.0) << x << ", " << y << ": " << found;
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

// 4 m forwards along +x, a stop, 2 m back along +y in reverse (heading -y), a stop, and on along +y.
Path headland() {
  return Path({{0, 0, 2.0}, {2, 0, 2.0}, {4, 0, 0.0}, {3.2, 0.6, -1.0}, {2.4, 1.2, 0.0}, {3.4, 1.2, 1.0}});
}

TEST(Path, SpeedsVaryWithConstantAcceleration) {
  const Path path({{0, 0, 2.0}, {10, 0, 4.0}, {14, 0, 0.0}, {14, 6, 3.0}});
  int segment = 0;
  // 12 m^2/s^2 over twice 10 m, from 2 m/s.
  EXPECT_DOUBLE_EQ(path.arc_length_after(0.0, 1.0, segment), 2.0 + 0.5 * 0.6);
  EXPECT_DOUBLE_EQ(path.point_at(2.3).speed, 2.6);
  const double first = 10.0 / 3.0, second = 2.0, third = 4.0;
  EXPECT_DOUBLE_EQ(path.duration(), first + second + third);
  EXPECT_EQ(path.point_at(14.0).speed, 0.0);
  EXPECT_NEAR(path.arc_length_after(0.0, first + second, segment), 14.0, 1e-12) << "a stop is reached in time";
  EXPECT_NEAR(path.arc_length_after(0.0, first + second + 2.0, segment), 14.0 + 0.5 * 0.75 * 4.0, 1e-12) << "and left";
  EXPECT_NEAR(path.arc_length_after(20.0, 2.0, segment), 26.0, 1e-12) << "beyond the end at the last speed";
  EXPECT_NEAR(path.arc_length_after(-4.0, 1.0, segment), -2.0, 1e-12) << "before the start at the first";
  const Path standing({{0, 0, 0.0}, {10, 0, 2.0}, {20, 0, 0.0}});
  EXPECT_EQ(standing.arc_length_after(20.0, 5.0, segment), 20.0);
  EXPECT_EQ(standing.arc_length_after(0.0, 1e6, segment), 20.0);
  EXPECT_DOUBLE_EQ(standing.arc_length_after(0.0, 1.0, segment), 0.1) << "4 / 20 m/s^2 from rest";
}

TEST(Path, WhereAVehicleGetsToIsTheSumOfItsWays) {
  std::vector<double> arc_lengths;
  const Path path = winding_path(5, &arc_lengths);
  for (const double start : {-0.5, 0.0, 7.3, path.length() - 0.2}) {
    int segment = 3;
    double stepwise = start, way = start;
    for (int k = 0; k < 2000; ++k) {
      stepwise = path.arc_length_after(stepwise, 0.005, segment);
      way += 0.005 * path.point_at(way).speed;  // Euler's rule
    }
    segment = 0;
    EXPECT_NEAR(path.arc_length_after(start, 10.0, segment), stepwise, 1e-9);
    EXPECT_NEAR(stepwise, way, 0.01);
  }
}

TEST(Path, InReverseTheVehicleLooksTheOtherWay) {
  const Path path = headland();
  EXPECT_EQ(path.why_not_drivable(), "");
  EXPECT_EQ(path.section_count(), 3);
  EXPECT_DOUBLE_EQ(path.section_end(0), 4.0);
  EXPECT_DOUBLE_EQ(path.section_start(2), 6.0);
  EXPECT_TRUE(path.stops_after(1));
  EXPECT_FALSE(path.stops_after(2));
  EXPECT_EQ(path.point_at(1.0).heading, 0.0);
  const PathPoint back = path.point_at(5.0);
  EXPECT_EQ(back.speed, -1.0);
  EXPECT_NEAR(back.heading, std::atan2(-0.6, 0.8), 1e-12) << "against the direction of the path";
  EXPECT_EQ(path.point_at(6.5).heading, 0.0);
  EXPECT_EQ(path.top_speed(), 2.0);
  EXPECT_DOUBLE_EQ(path.time_to_section_end(2.0, 0), 2.0);
}

TEST(Path, SpeedsAreLoweredInTime) {
  std::vector<Waypoint> waypoints;
  for (int i = 0; i <= 400; ++i) waypoints.push_back({0.1 * i, 0.0, i == 200 ? 0.0 : 3.0});
  const Path path(waypoints, {.acceleration = 0.5});
  for (double s = 0.0; s < 40.0; s += 0.37)
    EXPECT_NEAR(path.point_at(s).speed, std::min(3.0, std::sqrt(2.0 * 0.5 * std::abs(s - 20.0))), 1e-9) << s;
  std::vector<Waypoint> circle;
  for (int i = 0; i <= 400; ++i) circle.push_back({5.0 * std::cos(0.01 * i), 5.0 * std::sin(0.01 * i), 3.0});
  EXPECT_NEAR(Path(circle).point_at(10.0).curvature, 0.2, 1e-5);
  EXPECT_NEAR(Path(circle, {.lateral_acceleration = 0.8}).point_at(10.0).speed, 2.0, 1e-4);
  EXPECT_EQ(Path(circle, {.lateral_acceleration = 2.0}).point_at(10.0).speed, 3.0);
}

TEST(Path, SaysWhatNoVehicleCanFollow) {
  const auto why = [](const std::vector<Waypoint>& waypoints) { return Path(waypoints).why_not_drivable(); };
  EXPECT_EQ(why({{0, 0, 1.0}, {1, 0, 0.0}, {2, 0, 1.0}}), "");
  EXPECT_NE(why({{0, 0, 1.0}, {1, 0, 0.0}, {2, 0, 0.0}}).find("waypoint 2 and at waypoint 3"), std::string::npos);
  EXPECT_NE(why({{0, 0, 1.0}, {1, 0, 2.0}, {1, 0, 2.0}, {0, 0, -1.0}}).find("-1 m/s at waypoint 4"), std::string::npos);
  EXPECT_NE(why({{0, 0, 1.0}, {1, 0, 1.0}, {0, 0, 1.0}}).find("180 degrees on the spot at waypoint 2"),
            std::string::npos)
      << "a cusp that is driven forwards";
  EXPECT_NE(why({{0, 0, 1.0}, {1, 0, 0.0}, {2, 0, -1.0}}).find("180 degrees"), std::string::npos)
      << "in reverse, but not back";
}

TEST(Path, RoomBesideItVariesFromWaypointToWaypoint) {
  const Path path({{0, 0, 1, 2.0, 3.0}, {4, 0, 1, 4.0}, {8, 0, 1, 4.0}});
  EXPECT_DOUBLE_EQ(path.point_at(1.0).left, 2.5);
  EXPECT_DOUBLE_EQ(path.point_at(0.0).right, 3.0);
  EXPECT_EQ(path.point_at(1.0).right, infinity);
  EXPECT_EQ(path.point_at(6.0).right, infinity);
  EXPECT_NE(error_of([] { Path({{0, 0, 1}, {1, 0, 1, -2.0}}); }).find("waypoint 2"), std::string::npos);
}

TEST(Path, LocatesAVehicleAnywhere) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  // Two rows 3 m apart, there and back, twice.
  std::vector<Waypoint> waypoints;
  for (int lap = 0; lap < 2; ++lap)
    for (const auto& [x, y] : {std::pair{0.0, 0.0}, {50.0, 0.0}, {51.5, 1.5}, {50.0, 3.0}, {0.0, 3.0}, {-1.5, 1.5}})
      waypoints.push_back({x, y, 1.0});
  const Path path(waypoints);
  EXPECT_NEAR(path.locate(30.0, 0.4, 0.1).arc_length, 30.0, 1e-9) << "of equal laps the first";
  EXPECT_NEAR(path.locate(30.0, 1.4, 0.1).arc_length, 30.0, 1e-9);
  const double back = path.length() / 2.0;
  EXPECT_NEAR(path.locate(30.0, 1.4, pi - 0.1).arc_length, 50.0 + 2.0 * 1.5 * std::sqrt(2.0) + 20.0, 1e-9)
      << "the row that leads where the vehicle looks";
  EXPECT_LT(path.locate(30.0, 2.9, nan).arc_length, back);
  const Path reversing = headland();
  EXPECT_EQ(reversing.locate(3.2, 0.6, -0.6).section, 1);
  EXPECT_EQ(reversing.locate(3.3, 1.2, 0.0).section, 2);
  EXPECT_EQ(reversing.locate(1.0, 0.0, 0.0).section, 0);
}

}  // namespace path_test
}  // namespace rhec
