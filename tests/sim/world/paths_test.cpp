#include "rhec/sim/world/paths.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <numbers>
#include <string>

#include "rhec/core/base/error.hpp"
#include "rhec/sim/numbers/random.hpp"
#include "support/error_of.hpp"

namespace rhec::sim {
namespace paths_test {

std::filesystem::path file_with(const std::string& content) {
  auto file = std::filesystem::path(testing::TempDir()) / "rhec_waypoints.csv";
  std::ofstream(file) << content;
  return file;
}

std::string message_for(const std::string& content) {
  return error_of([&] { load_waypoints(file_with(content)); });
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

TEST(LoadWaypoints, ReadsWithAndWithoutHeaderAndSpeed) {
  const auto plain = load_waypoints(file_with("0,0\n1,2\n"), {.speed = 4.0});
  ASSERT_EQ(plain.size(), 2u);
  EXPECT_EQ(plain[1].y, 2.0);
  EXPECT_EQ(plain[1].speed, 4.0);
  const auto named = load_waypoints(file_with("x,y,speed\r\n0,0,1.5\r\n1,2,2.5\r\n"));
  ASSERT_EQ(named.size(), 2u);
  EXPECT_EQ(named[1].speed, 2.5);
}

TEST(LoadWaypoints, NamesTheRowOfAMistake) {
  EXPECT_CONTAINS(message_for("0,0\n1,2,3\n"), "rhec_waypoints.csv:2: 3 field(s) where 2");
  EXPECT_CONTAINS(message_for("x,y\n0,0\n1,two\n"), "rhec_waypoints.csv:3: field 2 is 'two'");
  EXPECT_CONTAINS(message_for("0,0\n1,\n"), "rhec_waypoints.csv:2: a coordinate is missing");
  EXPECT_CONTAINS(message_for("0,0,1\n1,0,-1\n"), "rhec_waypoints.csv:2: the speed is -1");
  EXPECT_CONTAINS(message_for("0\n1\n"), "expected x,y");
  EXPECT_CONTAINS(message_for("x,y\n1,1\n"), "at least 2 rows");
  EXPECT_CONTAINS(message_for(""), "empty");
}

}  // namespace paths_test
}  // namespace rhec::sim
