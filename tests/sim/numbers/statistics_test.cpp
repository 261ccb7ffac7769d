#include "rhec/sim/numbers/statistics.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace rhec::sim {
namespace statistics_test {

TEST(Student, IsThatOfTheTables) {
  EXPECT_NEAR(student_975(1), 12.7062047364, 1e-8);
  EXPECT_NEAR(student_975(2), 4.3026527297, 1e-9);
  EXPECT_NEAR(student_975(19), 2.0930240544, 1e-9);
  EXPECT_NEAR(student_975(100000), 1.9599877075, 1e-7);
}

TEST(Moments, AreThoseOfTheNumbers) {
  StudentQuantiles quantiles;
  Moments moments;
  EXPECT_TRUE(std::isnan(moments.mean()));
  moments.add(1.0);
  EXPECT_TRUE(std::isnan(moments.half_width(quantiles)));
  moments.add(3.0);
  moments.add(8.0);
  EXPECT_DOUBLE_EQ(moments.mean(), 4.0);
  EXPECT_NEAR(moments.half_width(quantiles), 4.3026527297 * std::sqrt(13.0 / 3.0), 1e-8);
}

}  // namespace statistics_test
}  // namespace rhec::sim
