#include "view.hpp"

#include <cmath>
#include <vector>

namespace rhec {
namespace obstacles_test {

using namespace testing;

At at(const std::string& options, const std::vector<double>& position, const TermPlace& place = {}) {
  return {bicycle(), make("obstacles", options), place, {position[0], position[1], 0.4, 0.0}};
}

TEST(Obstacles, AreKeptAwayByTheirEdges) {
  const std::string circle = "{vehicle_radius: 0.5, obstacles: [{x: 3, y: 1, radius: 1.5}]}";
  EXPECT_NEAR(at(circle, {3.0, 3.0}).inside(0), 0.0, 1e-12) << "two metres from the centre";
  EXPECT_GT(at(circle, {3.0, 3.1}).inside(0), 0.09);
  EXPECT_LT(at(circle, {3.0, 2.9}).inside(0), -0.09);
  EXPECT_NEAR(at(circle, {10.0, 1.0}).inside(0), 5.0, 0.02) << "about the distance";
  // Four metres long, along 90 degrees.
  const std::string ellipse =
      "{vehicle_radius: 0, obstacles: [{x: 0, y: 0, length: 4, width: 1, heading: 1.5707963267948966}]}";
  EXPECT_NEAR(at(ellipse, {0.0, 2.0}).inside(0), 0.0, 1e-12);
  EXPECT_NEAR(at(ellipse, {-0.5, 0.0}).inside(0), 0.0, 1e-12);
  EXPECT_LT(at(ellipse, {0.0, 1.9}).inside(0), 0.0);
  EXPECT_GT(at(ellipse, {0.6, 0.0}).inside(0), 0.0);
}

TEST(Obstacles, HaveAGradientAtTheirCentre) {
  const At centre = at("{obstacles: [{x: 3, y: 1, radius: 1.5}]}", {3.0, 1.0});
  EXPECT_LT(centre.inside(0), -1.0);
  for (const double slope : centre.slopes) EXPECT_EQ(slope, 0.0);
}

TEST(Obstacles, MoveToTheTimeOfTheNode) {
  const std::string moving = "{vehicle_radius: 0, obstacles: [{x: 3, y: 1, radius: 1, velocity_x: 2, velocity_y: -1}]}";
  EXPECT_NEAR(at(moving, {3.0 + 8.0 + 1.0, 1.0 - 4.0}, {.time = 4.0}).inside(0), 0.0, 1e-12);
}

TEST(Obstacles, ThatAreSeenAtRunTimeTakeTheRestOfTheRoom) {
  const std::string options = "{vehicle_radius: 0, most: 3, obstacles: [{x: 100, radius: 1}]}";
  EXPECT_EQ(make("obstacles", options)->most_obstacles(), 2);
  const std::vector<Obstacle> seen = {{.x = 5.0, .semi_axis_along = 2.0, .semi_axis_across = 1.0, .velocity_x = 1.0}};
  const At two = at(options, {5.0 + 2.0 + 2.0, 0.0}, {.time = 12.0, .obstacles = seen, .seen = 10.0});
  ASSERT_EQ(two.values.size(), 3u);
  EXPECT_GT(two.inside(0), 80.0);
  EXPECT_NEAR(two.inside(1), 0.0, 1e-12);
  EXPECT_EQ(two.lower[2], -HUGE_VAL) << "nothing is there";
  EXPECT_EQ(two.upper[2], HUGE_VAL);
  EXPECT_TRUE(std::isfinite(two.values[2]));
}

/// A measured size may be nonsense: what is there is in the way, and not the place for the vehicle to be.
TEST(Obstacles, OfNoSizeAreSmall) {
  for (const double size : {0.0, -1.0, -0.5}) {
    const std::vector<Obstacle> seen = {{.x = 5.0, .semi_axis_along = size, .semi_axis_across = size}};
    for (const char* options : {"{vehicle_radius: 0.5, most: 1}", "{vehicle_radius: 0, most: 1}"}) {
      const At centre = at(options, {5.0, 0.0}, {.obstacles = seen}),
               beside = at(options, {5.0, 0.6}, {.obstacles = seen});
      EXPECT_LT(centre.inside(0), 0.0) << options << " " << size;
      EXPECT_GT(beside.inside(0), 0.05) << options << " " << size;
    }
  }
}

TEST(Obstacles, AreRefusedInWords) {
  EXPECT_THAT(error_of([] { make("obstacles", "{obstacles: {x: 1}}"); }), HasSubstr("a list of obstacles"));
  EXPECT_THAT(error_of([] { make("obstacles", "{obstacles: [{x: 1, radus: 1}]}"); }),
              HasSubstr("did you mean 'radius'"));
  EXPECT_THAT(error_of([] { make("obstacles", "{obstacles: [{radius: 1, length: 2, width: 1}]}"); }),
              HasSubstr("a radius beside the length and width of an ellipse"));
  EXPECT_THAT(error_of([] { make("obstacles", "{obstacles: [{length: 2}]}"); }), HasSubstr("a length and a width"));
  EXPECT_THAT(error_of([] { make("obstacles", "{most: 0, obstacles: [{x: 1}]}"); }), HasSubstr("most: more obstacles"));
}

}  // namespace obstacles_test
}  // namespace rhec
