#include "rhec/sim/files/number_text.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>

namespace rhec::sim {
namespace number_text_test {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

std::string text_of(double value, int decimals) {
  std::string text;
  append_number(value, decimals, text);
  return text;
}

TEST(NumberText, HasTheDecimalsAskedForAndNoMore) {
  EXPECT_EQ(text_of(0.0, 4), "0");
  EXPECT_EQ(text_of(-0.00001, 4), "0");
  EXPECT_EQ(text_of(0.5, 4), "0.5");
  EXPECT_EQ(text_of(-0.05, 4), "-0.05");
  EXPECT_EQ(text_of(100.0, 4), "100");
  EXPECT_EQ(text_of(99.99996, 4), "100");
  EXPECT_EQ(text_of(1234.56789, 0), "1235");
  EXPECT_EQ(text_of(-12.3456, 3), "-12.346");
  EXPECT_EQ(text_of(nan, 3), "null");
  EXPECT_EQ(text_of(-std::numeric_limits<double>::infinity(), 3), "null");
}

TEST(NumberText, IsTheNumberToItsDecimals) {
  for (int decimals = 0; decimals <= 12; ++decimals)
    for (double value = 1e-9; value < 1e18; value *= -7.3) {
      const double read = std::stod(text_of(value, decimals));
      EXPECT_NEAR(read, value, 0.51 * std::pow(10.0, -decimals) + 1e-15 * std::abs(value)) << value << ", " << decimals;
    }
}

TEST(NumberText, SeesAHundredThousandthOfTheMagnitude) {
  EXPECT_EQ(decimals_for(1.0), 5);
  EXPECT_EQ(decimals_for(10.0), 4);
  EXPECT_EQ(decimals_for(0.3), 6);
  EXPECT_EQ(decimals_for(1e9), 0);
}

}  // namespace number_text_test
}  // namespace rhec::sim
