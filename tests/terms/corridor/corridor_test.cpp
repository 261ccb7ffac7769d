#include "view.hpp"

#include <cmath>

namespace rhec {
namespace corridor_test {

using namespace testing;

TEST(Corridor, MeasuresTheDistanceFromThePathToTheLeft) {
  const TermPlace place{.x = 10.0, .y = -3.0, .heading = 0.7};
  // Two metres along the path and half a metre to the left.
  const double x = 10.0 + 2.0 * std::cos(0.7) - 0.5 * std::sin(0.7),
               y = -3.0 + 2.0 * std::sin(0.7) + 0.5 * std::cos(0.7);
  const At at(bicycle(), make("corridor", "{left: 1.5, right: 1, margin: 0.25}"), place, {x, y, 0.1, 0.0});
  ASSERT_EQ(at.values.size(), 1u);
  EXPECT_NEAR(at.values[0], 0.5, 1e-12);
  EXPECT_EQ(at.lower[0], -0.75);
  EXPECT_EQ(at.upper[0], 1.25);
}

TEST(Corridor, EdgesVaryAlongThePath) {
  const auto term = make("corridor", "{along: [10, 20, 40], left_along: [1, 3, 2], right: 4}");
  const auto left = [&](double arc_length) {
    double data[3], lower, upper;
    term->write_data({.arc_length = arc_length}, data, &lower, &upper);
    EXPECT_EQ(lower, -4.0);
    return upper;
  };
  EXPECT_EQ(left(0.0), 1.0);
  EXPECT_EQ(left(10.0), 1.0);
  EXPECT_EQ(left(15.0), 2.0);
  EXPECT_EQ(left(30.0), 2.5);
  EXPECT_EQ(left(1000.0), 2.0);
}

TEST(Corridor, TheRoomOfThePathComesFirst) {
  const auto term = make("corridor", "{left: 1, right: 4, margin: 0.25}");
  double data[3], lower, upper;
  term->write_data({.left = 3.0}, data, &lower, &upper);
  EXPECT_EQ(upper, 2.75);
  EXPECT_EQ(lower, -3.75);
}

TEST(Corridor, RefusesWhatIsNoCorridor) {
  EXPECT_THAT(error_of([] { make("corridor", "{along: [2, 1], left_along: [1, 1]}"); }), HasSubstr("increase"));
  EXPECT_THAT(error_of([] { make("corridor", "{along: [1, 2], left_along: [1]}"); }), HasSubstr("one number for each"));
  EXPECT_THAT(error_of([] { make("corridor", "{along: [1, 2]}"); }), HasSubstr("left_along or right_along"));
  EXPECT_THAT(error_of([] { make("corridor", "{left: 1, right: 1, margin: 1}"); }), HasSubstr("no room"));
  EXPECT_THAT(error_of([] { make("corridor", "{lefft: 1}"); }), HasSubstr("did you mean 'left'"));
}

}  // namespace corridor_test
}  // namespace rhec
