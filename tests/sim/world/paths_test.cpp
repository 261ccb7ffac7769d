#include "rhec/sim/world/paths.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <numbers>
#include <string>

#include "rhec/core/base/error.hpp"
#include "rhec/core/control/path_follower.hpp"
#include "rhec/sim/numbers/random.hpp"
#include "support/error_of.hpp"
#include "support/temporary_folder.hpp"

namespace rhec::sim {
namespace paths_test {

auto waypoints_of(const std::string& content, const WaypointFile& defaults = {}) {
  const TemporaryFolder folder;
  return load_waypoints(folder.put("waypoints.csv", content), defaults);
}

std::string message_for(const std::string& content) {
  return error_of([&] { waypoints_of(content); });
}

// The largest turn of heading per metre along a path [1/m].
double largest_curvature(const Path& path) {
  double largest = 0.0;
  for (double s = 1.0; s < path.length(); s += 0.5) {
    const double turn =
        std::remainder(path.point_at(s).heading - path.point_at(s - 1.0).heading, 2.0 * std::numbers::pi);
    largest = std::max(largest, std::abs(turn));
  }
  return largest;
}

TEST(FigureEight, IsTwoLapsOfTwoTangentCircles) {
  const Path path(figure_eight({.speed = 8.0}));
  EXPECT_NEAR(path.length(), 2 * 275.2, 0.1);
  const PathPoint start = path.point_at(0.0);
  EXPECT_NEAR(start.heading, 0.0, 3e-3);
  EXPECT_EQ(start.speed, 8.0);
  for (int quarter = 0; quarter <= 4; ++quarter) {
    const PathPoint point = path.point_at(path.length() * quarter / 4.0);
    EXPECT_NEAR(std::hypot(point.x, point.y), 0.0, 1e-9) << "every circle begins and ends at the origin";
  }
  EXPECT_NEAR(path.point_at(path.length() / 8.0).y, 2 * 21.9, 1e-3) << "the left circle first";
  EXPECT_NEAR(path.point_at(path.length() * 3.0 / 8.0).y, -2 * 21.9, 1e-3);
  EXPECT_NEAR(largest_curvature(path), 1.0 / 21.9, 0.1 / 21.9 + 1e-6) << "one segment in ten more or less";
}

TEST(FigureEight, NoisyVehicleStaysOnItsBranchAtTheOrigin) {
  const Path path(figure_eight({.laps = 2}));
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    RandomStream random(seed, "lateral");
    PathFollower follower(path);
    for (double s = 0.0; s < path.length(); s += 2.0) {
      const PathPoint point = path.point_at(s);
      const double offset = 0.5 * random.normal();
      const double found =
          follower.advance(point.x - offset * std::sin(point.heading), point.y + offset * std::cos(point.heading));
      ASSERT_NEAR(found, s, 0.5) << "seed " << seed;
    }
  }
}

TEST(ZigZag, HasTheDocumentedGeometry) {
  const Path path(zig_zag({.speed = 3.0}));
  EXPECT_NEAR(path.length(), 6 * 68.0 + 5 * std::numbers::pi * 9.0, 0.02);
  EXPECT_NEAR(path.length(), 550.0, 2.0);
  const PathPoint start = path.point_at(0.0), end = path.point_at(path.length());
  EXPECT_EQ(start.x, 0.0);
  EXPECT_EQ(start.y, -20.0);
  EXPECT_EQ(start.heading, 0.0);
  EXPECT_NEAR(end.x, 0.0, 1e-9);
  EXPECT_NEAR(end.y, 70.0, 1e-9);
  EXPECT_NEAR(std::abs(end.heading), std::numbers::pi, 1e-9);
  const double steepest = std::atan(1.4 * largest_curvature(path)) * 180.0 / std::numbers::pi;
  EXPECT_LT(steepest, 10.0) << "driveable by a bicycle of 1.4 m with a limit of 35 deg";
}

TEST(GeneratedPaths, RefuseNonsense) {
  EXPECT_THROW(figure_eight({.speed = 0.0}), Error);
  EXPECT_THROW(figure_eight({.laps = 0}), Error);
  EXPECT_THROW(figure_eight({.radius = -1.0}), Error);
  EXPECT_THROW(zig_zag({.spacing = 0.0}), Error);
  EXPECT_THROW(zig_zag({.legs = 0}), Error);
}

TEST(GeneratedPaths, HaveTheirSpeedEverywhere) {
  const Path path(zig_zag({.speed = 3.0}));
  for (const double at : {0.0, 10.0, 200.0}) EXPECT_EQ(path.point_at(at).speed, 3.0);
}

TEST(Headland, TurnsAsAFishtailWhereRowsAreNear) {
  const Path path(headland({.speed = 2.0, .rows = 3, .row_length = 40.0, .row_spacing = 3.0, .turn_radius = 5.0}));
  EXPECT_EQ(path.why_not_drivable(), "");
  ASSERT_EQ(path.section_count(), 5);
  const PathPoint first_stop = path.point_at(path.section_end(0)), second = path.point_at(path.section_end(1));
  EXPECT_NEAR(first_stop.x, 45.0, 1e-9);
  EXPECT_NEAR(first_stop.y, 5.0, 1e-9);
  EXPECT_NEAR(second.y, 5.0 - 7.0, 1e-9);
  EXPECT_LT(path.point_at(path.section_start(1) + 1.0).speed, 0.0);
  const PathPoint end = path.point_at(path.length());
  EXPECT_NEAR(end.x, 40.0, 1e-9);
  EXPECT_NEAR(end.y, 6.0, 1e-9);
  EXPECT_EQ(end.speed, 0.0);
  const Path wide(headland({.rows = 2, .row_spacing = 14.0, .turn_radius = 5.0}));
  EXPECT_EQ(wide.section_count(), 1) << "wide rows are joined without a stop";
  EXPECT_NEAR(wide.point_at(wide.length()).y, 14.0, 1e-9);
  EXPECT_THROW(headland({.row_spacing = 0.0}), Error);
}

TEST(LoadWaypoints, ReadsReverseStopsAndRoom) {
  const auto waypoints = waypoints_of("speed,y,x,right\n2,0,0,1.5\n0,0,10,\n-1,0,5,0.5\n");
  ASSERT_EQ(waypoints.size(), 3u);
  EXPECT_EQ(waypoints[2].x, 5.0);
  EXPECT_EQ(waypoints[2].speed, -1.0);
  EXPECT_EQ(waypoints[0].right, 1.5);
  EXPECT_EQ(waypoints[1].right, infinity);
  EXPECT_EQ(waypoints[0].left, infinity);
}

TEST(LoadWaypoints, ReadsWithAndWithoutHeaderAndSpeed) {
  const auto plain = waypoints_of("0,0\n1,2\n", {.speed = 4.0});
  ASSERT_EQ(plain.size(), 2u);
  EXPECT_EQ(plain[1].y, 2.0);
  EXPECT_EQ(plain[1].speed, 4.0);
  const auto named = waypoints_of("x,y,speed\r\n0,0,1.5\r\n1,2,2.5\r\n");
  ASSERT_EQ(named.size(), 2u);
  EXPECT_EQ(named[1].speed, 2.5);
}

TEST(LoadWaypoints, NamesTheRowOfAMistake) {
  EXPECT_CONTAINS(message_for("0,0\n1,2,3\n"), "waypoints.csv:2: 3 field(s) where 2");
  EXPECT_CONTAINS(message_for("x,y\n0,0\n1,two\n"), "waypoints.csv:3: field 2 is 'two'");
  EXPECT_CONTAINS(message_for("0,0\n1,\n"), "waypoints.csv:2: a coordinate is missing");
  EXPECT_CONTAINS(message_for("0,0,1\n1,0,-1\n"), "give the waypoint where it does the speed 0");
  EXPECT_CONTAINS(message_for("0,0,1\n1,0,\n"), "waypoints.csv:2: the speed is missing");
  EXPECT_CONTAINS(message_for("x,y\n0,0\n9,0\n1,0.1\n"), "waypoints.csv:3: path: a vehicle");
  EXPECT_CONTAINS(message_for("x,y\n0,0\n0,0\n"), "waypoints.csv: path: 1 distinct waypoint(s)");
  EXPECT_CONTAINS(message_for("x,z\n0,0\n9,0\n"), "a column 'z'");
  EXPECT_CONTAINS(message_for("x,speed\n0,1\n9,1\n"), "no column 'y'");
  EXPECT_CONTAINS(message_for("x,y,left\n0,0,1\n9,0,-1\n"), "waypoints.csv:3: room of -1 m");
  EXPECT_CONTAINS(message_for("0\n1\n"), "expected x,y");
  EXPECT_CONTAINS(message_for("x,y\n1,1\n"), "at least 2 rows");
  EXPECT_CONTAINS(message_for(""), "empty");
}

}  // namespace paths_test
}  // namespace rhec::sim
