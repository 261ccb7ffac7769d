#include "apps/ros/messages/obstacle_messages.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>

#include "apps/ros/support/obstacles.hpp"
#include "rhec/logs/cdr/message_reader.hpp"

namespace rhec::apps::ros::obstacle_messages_test {
namespace {

using logs::CdrWriter;
using logs::RecordError;

constexpr double usual = 0.5;

CdrWriter array_of(const std::vector<ToldObstacle>& told, std::string_view frame_of_each = "") {
  CdrWriter message;
  write_obstacle_array(1'500'000'000, "odom", told, message, frame_of_each);
  return message;
}

TEST(ObstacleMessages, ReadsCentres) {
  CdrWriter message;
  write_obstacle_poses(7, "odom", {{.x = 3.0, .y = 4.0}, {.x = -1.0}}, message);
  const SeenObstacles seen = read_obstacle_poses(message.bytes(), usual);
  EXPECT_EQ(seen.header.frame, "odom");
  EXPECT_EQ(seen.header.stamp, 7);
  ASSERT_EQ(seen.obstacles.size(), 2u);
  EXPECT_EQ(seen.obstacles[0].y, 4.0);
  EXPECT_EQ(seen.obstacles[1].semi_axis_across, usual);
  EXPECT_EQ(seen.obstacles[1].velocity_x, 0.0);
}

TEST(ObstacleMessages, ReadsPlacesSizesAndVelocities) {
  const SeenObstacles seen = read_obstacle_array(
      array_of({{.x = 1.0, .y = 2.0, .radius = 0.25, .velocity_x = 0.5, .velocity_y = -1.5}, {.x = 3.0}}).bytes(),
      usual);
  EXPECT_EQ(seen.header.stamp, 1'500'000'000);
  ASSERT_EQ(seen.obstacles.size(), 2u);
  EXPECT_EQ(seen.obstacles[0].x, 1.0);
  EXPECT_EQ(seen.obstacles[0].y, 2.0);
  EXPECT_EQ(seen.obstacles[0].semi_axis_along, 0.25);
  EXPECT_EQ(seen.obstacles[0].velocity_x, 0.5);
  EXPECT_EQ(seen.obstacles[0].velocity_y, -1.5);
  EXPECT_EQ(seen.obstacles[1].semi_axis_across, usual);  // a point without a size
}

// What is written by hand above is what the definition of the type says.
TEST(ObstacleMessages, AreThoseOfTheirDefinition) {
  logs::MessageReader reader(std::make_shared<const logs::MessageType>(logs::link_message(
                                 "costmap_converter_msgs/msg/ObstacleArrayMsg", logs::builtin_definitions())),
                             {.fields = {"obstacles[1].radius", "obstacles[1].velocities.twist.linear.y",
                                         "obstacles[1].polygon.points[0].x"}});
  const CdrWriter message = array_of({{.x = 1.0}, {.x = 3.0, .radius = 0.25, .velocity_y = -1.5}}, "odom");
  std::array<double, 3> values{};
  reader.read({.bytes = message.bytes()}, values.data());
  EXPECT_EQ(values, (std::array{0.25, -1.5, 3.0}));
}

bool contains(const Obstacle& ellipse, double x, double y) {
  const double dx = x - ellipse.x, dy = y - ellipse.y;
  const double along = (std::cos(ellipse.heading) * dx + std::sin(ellipse.heading) * dy) / ellipse.semi_axis_along;
  const double across = (std::cos(ellipse.heading) * dy - std::sin(ellipse.heading) * dx) / ellipse.semi_axis_across;
  return along * along + across * across <= 1.0 + 1e-9;
}

TEST(ObstacleMessages, EllipsesContainTheirOutlineAndItsBelt) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> coordinate(-3.0, 3.0), size(0.0, 0.5);
  for (int trial = 0; trial < 200; ++trial) {
    std::vector<Position> outline;
    for (int corner = 0; corner <= trial % 6; ++corner) outline.push_back({coordinate(random), coordinate(random)});
    const double radius = size(random);
    const Obstacle ellipse = ellipse_around(outline, radius);
    for (const Position& corner : outline)
      for (int i = 0; i < 12; ++i) {
        const double angle = 2.0 * std::numbers::pi * i / 12;
        EXPECT_TRUE(contains(ellipse, corner.x + radius * std::cos(angle), corner.y + radius * std::sin(angle)))
            << trial;
      }
  }
}

TEST(ObstacleMessages, EllipsesAreAsSlenderAsWhatTheyAreAround) {
  // A wall of 10 m, at 30 degrees.
  const double c = std::cos(std::numbers::pi / 6), s = std::sin(std::numbers::pi / 6);
  const Obstacle wall = ellipse_around(std::array{Position{0.0, 0.0}, Position{10.0 * c, 10.0 * s}}, 0.1);
  EXPECT_NEAR(wall.x, 5.0 * c, 1e-12);
  EXPECT_NEAR(wall.y, 5.0 * s, 1e-12);
  EXPECT_NEAR(wall.heading, std::numbers::pi / 6, 1e-12);
  EXPECT_NEAR(wall.semi_axis_along, std::numbers::sqrt2 * 5.1, 1e-12);
  EXPECT_NEAR(wall.semi_axis_across, std::numbers::sqrt2 * 0.1, 1e-12);
}

TEST(ObstacleMessages, EllipsesAreAroundTheSmallestRectangle) {
  std::mt19937 random(6);
  std::uniform_real_distribution<double> coordinate(-3.0, 3.0), size(0.0, 0.5);
  for (int trial = 0; trial < 200; ++trial) {
    std::vector<Position> outline;
    for (int corner = 0; corner <= 2 + trial % 9; ++corner) outline.push_back({coordinate(random), coordinate(random)});
    if (trial % 3 == 0) outline.push_back(outline.front());
    const double radius = size(random);
    const Obstacle ellipse = ellipse_around(outline, radius);
    double least = std::numeric_limits<double>::infinity();
    for (int i = 0; i < 1800; ++i) {
      const double c = std::cos(i * std::numbers::pi / 3600.0), s = std::sin(i * std::numbers::pi / 3600.0);
      double lower[2] = {1e9, 1e9}, upper[2] = {-1e9, -1e9};
      for (const Position& corner : outline) {
        const double place[2] = {c * corner.x + s * corner.y, c * corner.y - s * corner.x};
        for (int j = 0; j < 2; ++j) {
          lower[j] = std::min(lower[j], place[j]);
          upper[j] = std::max(upper[j], place[j]);
        }
      }
      least = std::min(least, (0.5 * (upper[0] - lower[0]) + radius) * (0.5 * (upper[1] - lower[1]) + radius));
    }
    const double area = 0.5 * ellipse.semi_axis_along * ellipse.semi_axis_across;
    EXPECT_LE(area, least * (1.0 + 1e-12)) << trial;
    EXPECT_GE(area, least * 0.99) << trial;  // in steps of 0.05 degrees
  }
}

// A message of 16 MB is taken. Pairs of its corners could not be looked at within hours.
TEST(ObstacleMessages, OutlinesMayHaveAMillionCorners) {
  constexpr int corners = 1'000'000;
  ToldObstacle round{.outline = {}};
  for (int i = 0; i < corners; ++i) {
    const double angle = 2.0 * std::numbers::pi * i / corners;
    round.outline.emplace_back(1e7 + 4e6 * std::cos(angle), 3e6 * std::sin(angle));
  }
  const Obstacle seen = read_obstacle_array(array_of({round}).bytes(), usual).obstacles.at(0);
  EXPECT_NEAR(seen.x, 1e7, 2.0);
  EXPECT_NEAR(std::max(seen.semi_axis_along, seen.semi_axis_across), std::numbers::sqrt2 * 4e6, 10.0);
  EXPECT_NEAR(std::min(seen.semi_axis_along, seen.semi_axis_across), std::numbers::sqrt2 * 3e6, 10.0);
}

TEST(ObstacleMessages, LinesWithoutAWidthGetTheUsualOne) {
  for (const auto& end : {std::pair{4.0, 0.0}, std::pair{0.0, 4.0}, std::pair{-4.0, 0.0}, std::pair{2.0, 3.0}}) {
    const SeenObstacles seen = read_obstacle_array(array_of({{.outline = {{0.0, 0.0}, end}}}).bytes(), usual);
    const Obstacle& line = seen.obstacles.at(0);
    EXPECT_NEAR(std::min(line.semi_axis_along, line.semi_axis_across), std::numbers::sqrt2 * usual, 1e-6);
  }
}

TEST(ObstacleMessages, RefusesNumbersThatCannotBe) {
  const double nothing = std::numeric_limits<double>::quiet_NaN(), endless = std::numeric_limits<double>::infinity();
  for (const double wrong : {nothing, endless, -endless, 1e30}) {
    EXPECT_THROW(read_obstacle_array(array_of({{.x = wrong}}).bytes(), usual), RecordError) << wrong;
    EXPECT_THROW(read_obstacle_array(array_of({{.y = wrong}}).bytes(), usual), RecordError) << wrong;
    EXPECT_THROW(read_obstacle_array(array_of({{.radius = wrong}}).bytes(), usual), RecordError) << wrong;
    EXPECT_THROW(read_obstacle_array(array_of({{.velocity_x = wrong}}).bytes(), usual), RecordError) << wrong;
    EXPECT_THROW(read_obstacle_array(array_of({{.velocity_y = wrong}}).bytes(), usual), RecordError) << wrong;
    CdrWriter message;
    write_obstacle_poses(0, "odom", {{.x = wrong}}, message);
    EXPECT_THROW(read_obstacle_poses(message.bytes(), usual), RecordError) << wrong;
  }
  EXPECT_THROW(read_obstacle_array(array_of({{.radius = -0.1}}).bytes(), usual), RecordError);
}

TEST(ObstacleMessages, RefusesCutsOtherFramesAndOutlinesOfNothing) {
  const CdrWriter whole = array_of({{.x = 1.0}, {.x = 2.0}}, "odom");
  for (std::size_t size = 0; size < whole.bytes().size(); ++size)
    EXPECT_THROW(read_obstacle_array(whole.bytes().first(size), usual), RecordError) << size;
  EXPECT_EQ(read_obstacle_array(whole.bytes(), usual).obstacles.size(), 2u);
  EXPECT_THROW(read_obstacle_array(array_of({{.x = 1.0}}, "map").bytes(), usual), RecordError);
  CdrWriter message;
  message.header(0, "odom");
  message.length(1);
  message.header(0, "");
  message.length(0);
  message.numbers(std::vector<double>(60, 0.0));
  EXPECT_THROW(read_obstacle_array(message.bytes(), usual), RecordError);
  message.clear();
  message.header(0, "odom");
  message.length(4'000'000'000u);
  EXPECT_THROW(read_obstacle_array(message.bytes(), usual), RecordError);
}

}  // namespace
}  // namespace rhec::apps::ros::obstacle_messages_test
