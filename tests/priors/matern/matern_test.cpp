#include <cmath>

#include "view.hpp"

namespace rhec {
namespace matern_test {

using namespace testing;

/// The covariance function, against its closed form (Rasmussen and Williams 2006, eq. 4.17).
TEST(MaternPlugin, HasTheCovarianceOfItsSmoothness) {
  for (const double d : {0.0, 0.4, 3.0, 25.0}) {
    const double half = d / 5.0, three = std::sqrt(3.0) * half, five = std::sqrt(5.0) * half;
    const auto covariance = [&](const char* smoothness) {
      return covariance_over(
          *make("matern", std::string("{length: 5, sigma: 0.2, mean_sigma: 0, smoothness: ") + smoothness + "}"), d);
    };
    EXPECT_NEAR(covariance("1/2"), 0.04 * std::exp(-half), 1e-15) << d;
    EXPECT_NEAR(covariance("3/2"), 0.04 * (1.0 + three) * std::exp(-three), 1e-15) << d;
    EXPECT_NEAR(covariance("5/2"), 0.04 * (1.0 + five + five * five / 3.0) * std::exp(-five), 1e-15) << d;
  }
}

TEST(MaternPlugin, ForgetsEverythingButItsMean) {
  const auto matern = make("matern", "{mean: 0.6, mean_sigma: 0.1, mean_walk: 0}");
  EXPECT_NEAR(covariance_over(*matern, 1e4), 0.01, 1e-12) << "the mean's own variance";
  EXPECT_EQ(Start(*matern).mean[0], 0.6);
}

TEST(MaternPlugin, TakesItsSpreadFromTheBounds) {
  Variable wide = slip();
  wide.lower = -2.0;
  wide.upper = 2.0;
  const auto of_unit = make("matern", "{mean_sigma: 0}"), of_wide = make("matern", "{mean_sigma: 0}", wide);
  EXPECT_NEAR(Start(*of_wide).covariance(0, 0), 16.0 * Start(*of_unit).covariance(0, 0), 1e-12);
  EXPECT_NEAR(Start(*of_unit).mean[0], 0.75, 1e-15) << "half way from the middle to no slip";
  EXPECT_NEAR(Start(*of_wide).mean[0], 0.5, 1e-15);
}

}  // namespace matern_test
}  // namespace rhec
