#include "plugins/equations/node_number.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <string>

#include "rhec/core/base/infinity.hpp"
#include "support/error_of.hpp"

namespace rhec::equations {
namespace node_number_test {

using ::testing::HasSubstr;

NodeNumber number(std::string_view text, bool may_use_place = true) {
  const SourceText source{"scenario.yaml", {{text, 3, 1}}};
  return {"scenario.yaml", parse_term(source, Functions::with_corners), {{"most", 2.5}}, may_use_place};
}
double at(std::string_view text, const TermPlace& place = {}) { return number(text).at(place); }

TEST(NodeNumber, HasTheValueOfItsTerm) {
  EXPECT_EQ(at("1 + 2 * 3 - 4 / 8"), 6.5);
  EXPECT_EQ(at("-most^2"), -6.25);
  EXPECT_EQ(at("2^-most"), std::pow(2.0, -2.5));
  EXPECT_EQ(at("sqrt(16) + exp(0) + log(1) + tanh(0)"), 5.0);
  EXPECT_EQ(at("sin(most)"), std::sin(2.5));
  EXPECT_EQ(at("cos(pi)"), std::cos(std::numbers::pi));
  EXPECT_EQ(at("tan(1) + asin(1) + acos(1) + atan(1)"),
            std::tan(1.0) + std::asin(1.0) + std::acos(1.0) + std::atan(1.0));
  EXPECT_EQ(at("atan2(1, -1)"), std::atan2(1.0, -1.0));
  EXPECT_EQ(at("hypot(3, 4)"), 5.0);
  EXPECT_EQ(at("smooth_abs(0, 0.5)"), 0.5);
  EXPECT_NEAR(at("smooth_min(1, 5, 1e-9) + smooth_max(1, 5, 1e-9)"), 6.0, 1e-8);
}

TEST(NodeNumber, HasCornersAndMayBeInfinite) {
  EXPECT_EQ(at("abs(-3) + min(1, 2) + max(1, 2)"), 6.0);
  EXPECT_EQ(at("where(1, 2, 3)"), 2.0);
  EXPECT_EQ(at("where(0, 2, 3)"), 3.0);
  EXPECT_EQ(at("-infinity"), -infinity);
  EXPECT_EQ(at("where(arc_length - 20, infinity, 3)", {.arc_length = 21.0}), infinity);
  EXPECT_EQ(at("min(room_left, 7)"), 7.0);
  EXPECT_EQ(at("where(infinity - infinity, 1, 2)"), 2.0);  // what is no number is not above 0
}

TEST(NodeNumber, KnowsTheNode) {
  const TermPlace place{
      .time = 1.0, .x = 2.0, .y = 3.0, .heading = 4.0, .speed = 5.0, .arc_length = 6.0, .left = 7.0, .right = 8.0};
  EXPECT_EQ(at("time + 10 * path_x + 100 * path_y + 1e3 * path_heading + 1e4 * path_speed + 1e5 * arc_length", place),
            654321.0);
  EXPECT_EQ(at("room_left - room_right", place), -1.0);
}

TEST(NodeNumber, SaysWhatItDoesNotKnow) {
  EXPECT_THAT(error_of([] { number("mots"); }),
              HasSubstr("scenario.yaml:3:1: 'mots' is not known here; expected a term of pi, "
                        "infinity, most, path_x"));
  EXPECT_THAT(error_of([] { number("arc_length", false); }), HasSubstr("expected a term of pi, infinity, most"));
  EXPECT_THAT(error_of([] { number("sine(1)"); }), HasSubstr("there is no function 'sine'; did you mean 'sin'?"));
}

TEST(NodeNumber, HasRoomForManyNumbersAndNoMore) {
  const auto nested = [](int count) {
    std::string text = "most";
    for (int k = 1; k < count; ++k) text = "1 + (" + text + ")";
    return text;
  };
  EXPECT_EQ(at(nested(30)), 31.5);
  // Operands first: a sum that is nested to the right keeps all of its numbers.
  EXPECT_EQ(at(nested(49)), 50.5);
  std::string wide = "max(1, 2)";
  for (int k = 0; k < 33; ++k) wide = "where(1, 2, " + wide + ")";
  EXPECT_THAT(error_of([&] { number(wide); }), HasSubstr("more than 64 numbers at a time"));
}

}  // namespace node_number_test
}  // namespace rhec::equations
