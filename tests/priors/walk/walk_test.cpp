#include "view.hpp"

namespace rhec {
namespace walk_test {

using namespace testing;

TEST(Walk, GrowsByItsVariancePerMetre) {
  const auto walk = make("walk", "{sigma: 0.1}");
  EXPECT_EQ(walk->state_count(), 1);
  EXPECT_EQ(walk->along(), Along::distance);
  EXPECT_EQ(walk->course(), Course::ramp);
  EXPECT_NEAR(Advance(*walk, 9.0).Q(0, 0), 0.09, 1e-15);
  EXPECT_EQ(Advance(*walk, 9.0).F(0, 0), 1.0);
}

TEST(Walk, CanBePerSecondAndInSteps) {
  const auto walk = make("walk", "{along: time, course: held}");
  EXPECT_EQ(walk->along(), Along::time);
  EXPECT_EQ(walk->course(), Course::held);
}

}  // namespace walk_test
}  // namespace rhec
