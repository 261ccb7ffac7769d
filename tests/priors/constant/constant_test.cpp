#include "view.hpp"

namespace rhec {
namespace constant_test {

using namespace testing;

TEST(Constant, NeverChanges) {
  const auto constant = make("constant", "{mean: 0.7, mean_sigma: 0.1}");
  EXPECT_EQ(Start(*constant).mean[0], 0.7);
  EXPECT_NEAR(Start(*constant).covariance(0, 0), 0.01, 1e-15);
  EXPECT_EQ(Advance(*constant, 1e6).Q(0, 0), 0.0);
  EXPECT_EQ(Advance(*constant, 1e6).F(0, 0), 1.0);
}

}  // namespace constant_test
}  // namespace rhec
