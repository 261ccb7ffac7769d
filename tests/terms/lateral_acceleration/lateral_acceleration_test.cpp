#include "view.hpp"

#include <cmath>

namespace rhec {
namespace lateral_acceleration_test {

using namespace testing;

TEST(LateralAcceleration, IsSpeedOverGroundTimesRateOfTurn) {
  const auto term = make("lateral_acceleration", "{most: 1.25}");
  const double kappa = 0.7, mu = 0.9, u1 = 5.0, delta = 0.2;
  const At at(bicycle(), term, {}, {3.0, 4.0, 1.0, delta}, {u1, 0.1}, {kappa, mu});
  ASSERT_EQ(at.values.size(), 1u);
  EXPECT_NEAR(at.values[0], std::pow(kappa * u1, 2) * std::tan(mu * delta) / 1.4, 1e-12);
  EXPECT_EQ(at.lower[0], -1.25);
  EXPECT_EQ(at.upper[0], 1.25);
}

TEST(LateralAcceleration, IsPositive) {
  EXPECT_THAT(error_of([] { make("lateral_acceleration", "{most: 0}"); }), HasSubstr("greater than 0"));
}

}  // namespace lateral_acceleration_test
}  // namespace rhec
