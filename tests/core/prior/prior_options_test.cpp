#include "rhec/core/prior/prior_options.hpp"

#include <gtest/gtest.h>

#include "rhec/core/model/model.hpp"

namespace rhec {
namespace prior_options_test {

TEST(ParameterRange, IsHalfWayToNoSlipWithinTheBounds) {
  Variable slip;
  slip.lower = 0.2;
  slip.upper = 1.0;
  const ParameterRange range(slip);
  EXPECT_DOUBLE_EQ(range.width, 0.8);
  EXPECT_DOUBLE_EQ(range.mean, 0.8);
  slip.nominal = 5.0;  // not within the bounds
  EXPECT_DOUBLE_EQ(ParameterRange(slip).mean, 0.8);
}

TEST(ParameterRange, IsAboutNoSlipWithoutBounds) {
  Variable offset;
  offset.nominal = 0.0;
  offset.scale = 0.3;
  const ParameterRange range(offset);
  EXPECT_DOUBLE_EQ(range.width, 0.6);
  EXPECT_DOUBLE_EQ(range.mean, 0.0);
  offset.lower = 0.1;  // on one side alone
  EXPECT_DOUBLE_EQ(ParameterRange(offset).mean, 0.1);
}

}  // namespace prior_options_test
}  // namespace rhec
