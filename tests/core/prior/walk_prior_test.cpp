#include "rhec/core/prior/walk_prior.hpp"

#include <gtest/gtest.h>

#include "rhec/core/model/model.hpp"

namespace rhec {
namespace walk_prior_test {

TEST(WalkPrior, StartsFromTheBoundsUnlessToldOtherwise) {
  Variable slip;
  slip.lower = 0.0;
  slip.upper = 1.0;
  double mean = 0.0, variance = 0.0;
  WalkPrior open({{}, 0.1});
  open.set_up(slip);
  open.start(&mean, &variance);
  EXPECT_DOUBLE_EQ(mean, 0.75);
  EXPECT_DOUBLE_EQ(variance, 0.04);
  WalkPrior told({{{.mean = 0.5, .mean_sigma = 0.3}}, 0.1});
  told.set_up(slip);
  told.start(&mean, &variance);
  EXPECT_DOUBLE_EQ(mean, 0.5);
  EXPECT_DOUBLE_EQ(variance, 0.09);
  double F = 0.0, Q = 0.0;
  told.advance(4.0, &F, &Q);
  EXPECT_DOUBLE_EQ(F, 1.0);
  EXPECT_DOUBLE_EQ(Q, 0.04);
}

}  // namespace walk_prior_test
}  // namespace rhec
