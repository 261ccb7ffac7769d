#include "core/horizon/checks.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "rhec/core/base/error.hpp"
#include "support/error_of.hpp"

namespace rhec {
namespace checks_test {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr double infinity = HUGE_VAL;
const std::vector<Variable> variables = {{.name = "x", .unit = "m", .meaning = "place", .lower = -1.0, .upper = 2.0},
                                         {.name = "v", .unit = "m/s", .meaning = "speed", .lower = 0.0}};

TEST(Weights, AreOneFiniteNumberOfAtLeastZeroEach) {
  const auto said = [](const std::vector<double>& weights) {
    return error_of([&] { check_weights("state weights", weights, variables); });
  };
  EXPECT_EQ(said({0.0, 3.0}), "");
  EXPECT_THAT(said({1.0}), HasSubstr("state weights: 1 given; expected 2, one for each variable"));
  EXPECT_THAT(said({1.0, -1.0}), HasSubstr("state weights: -1 for 'v'; expected a finite number of at least 0"));
  EXPECT_THAT(said({infinity, 1.0}), HasSubstr("inf for 'x'"));
  EXPECT_THAT(said({1.0, std::nan("")}), HasSubstr("nan for 'v'"));
}

TEST(DefaultBounds, AreTheVariablesOwnOrNone) {
  std::vector<double> lower, upper;
  fill_default_bounds("bounds", lower, upper, variables, true);
  EXPECT_THAT(lower, ElementsAre(-1.0, 0.0));
  EXPECT_THAT(upper, ElementsAre(2.0, infinity));
  lower.clear();
  upper.clear();
  fill_default_bounds("bounds", lower, upper, variables, false);
  EXPECT_THAT(lower, ElementsAre(-infinity, -infinity));
  EXPECT_THAT(upper, ElementsAre(infinity, infinity));
}

TEST(DefaultBounds, LeaveWhatIsGiven) {
  std::vector<double> lower = {-5.0, -6.0}, upper;
  fill_default_bounds("bounds", lower, upper, variables, true);
  EXPECT_THAT(lower, ElementsAre(-5.0, -6.0));
  EXPECT_THAT(upper, ElementsAre(2.0, infinity));
}

TEST(DefaultBounds, MustFit) {
  const auto said = [](std::vector<double> lower, std::vector<double> upper) {
    return error_of([&] { fill_default_bounds("input bounds", lower, upper, variables, true); });
  };
  EXPECT_EQ(said({1.0, 1.0}, {1.0, 1.0}), "");
  EXPECT_THAT(said({1.0}, {1.0}), HasSubstr("input bounds: expected 2 of each side"));
  EXPECT_THAT(said({1.0, 3.0}, {1.0, 2.0}), HasSubstr("input bounds: [3, 2] for 'v'; expected lower <= upper"));
  EXPECT_THAT(said({1.0, std::nan("")}, {1.0, 2.0}), HasSubstr("for 'v'; expected lower <= upper"));
  EXPECT_THAT(said({2.5, 0.0}, {}), HasSubstr("[2.5, 2] for 'x'")) << "against the variable's own";
}

}  // namespace checks_test
}  // namespace rhec
