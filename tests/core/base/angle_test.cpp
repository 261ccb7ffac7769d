#include "rhec/core/base/angle.hpp"

#include <numbers>

#include <gtest/gtest.h>

namespace rhec {
namespace angle_test {

TEST(AngleDifference, IsTakenOnTheCircle) {
  EXPECT_NEAR(angle_difference(3.1, -3.1), 6.2 - 2.0 * M_PI, 1e-15);
  EXPECT_NEAR(angle_difference(0.1, 2.0 * M_PI * 5.0), 0.1, 1e-14);
  EXPECT_EQ(angle_difference(1.0, 0.25), 0.75);
}

}  // namespace angle_test
}  // namespace rhec
