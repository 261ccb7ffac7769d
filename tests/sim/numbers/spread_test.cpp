#include "rhec/sim/numbers/spread.hpp"
#include "rhec/core/base/infinity.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

namespace rhec::sim {
namespace spread_test {

TEST(Spread, QuantilesAreOfTheValuesThatAreNumbers) {
  std::vector<double> values;
  for (int i = 200; i >= 1; --i) values.push_back(i);
  values.push_back(std::numeric_limits<double>::quiet_NaN());
  const Spread spread = spread_of(values);
  EXPECT_EQ(spread.median, 100.0);
  EXPECT_EQ(spread.p99, 198.0);
  EXPECT_EQ(spread.max, 200.0);
  EXPECT_TRUE(std::isnan(spread_of(std::vector<double>()).median));
}

TEST(Spread, AQuantileIsOneOfTheValues) {
  // The least one that is at least as large as that share of all: the second of four is half of them.
  EXPECT_EQ(spread_of({4.0, 1.0, 3.0, 2.0}).median, 2.0);
  EXPECT_EQ(spread_of({5.0, 1.0, 3.0}).median, 3.0);
  EXPECT_EQ(spread_of({4.0, 1.0, 3.0, 2.0}).p99, 4.0);
  const Spread one = spread_of({-7.0});
  EXPECT_EQ(one.median, -7.0);
  EXPECT_EQ(one.p99, -7.0);
  EXPECT_EQ(one.max, -7.0);
}

TEST(Spread, WhatIsMissingDoesNotCount) {
  constexpr double missing = std::numeric_limits<double>::quiet_NaN();
  const Spread spread = spread_of({missing, 1.0, missing, 3.0, 2.0, missing, missing});
  EXPECT_EQ(spread.median, 2.0);
  EXPECT_EQ(spread.p99, 3.0);
  EXPECT_EQ(spread.max, 3.0);
  EXPECT_TRUE(std::isnan(spread_of({missing, missing}).max)) << "none of them is a number";
}

TEST(Spread, WhatIsInfiniteCounts) {
  const Spread spread = spread_of({infinity, 1.0, 2.0});
  EXPECT_EQ(spread.median, 2.0);
  EXPECT_EQ(spread.max, infinity);
}

}  // namespace spread_test
}  // namespace rhec::sim
