#include <cmath>

#include "view.hpp"

namespace rhec {
namespace jumps_test {

using namespace testing;

TEST(Jumps, HaveTheCovarianceOfLevelsThatChangeAtRandom) {
  const auto jumps = make("jumps", "{length: 8, sigma: 0.1, mean_sigma: 0}");
  for (const double d : {0.0, 2.0, 30.0}) EXPECT_NEAR(covariance_over(*jumps, d), 0.01 * std::exp(-d / 8.0), 1e-15);
  EXPECT_EQ(jumps->course(), Course::held);
}

}  // namespace jumps_test
}  // namespace rhec
