// What a filter knew some time ago, for measurements that are very late.
#include "core/estimation/past_moments.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "support/linear_case.hpp"

namespace rhec {
namespace past_moments_test {

using namespace rhec::testing;

/// A boat's filter that goes on by a tenth of a second at a time, each with an input of its own, from 0 s on.
struct Course : ::testing::Test {
  std::shared_ptr<const Model> model = linear_model<Boat>();
  WalkingFilter filter{model, {.noise = variances_of(*model), .walk = {0.1}, .step = 0.1, .substeps = 2}};
  PastMoments past{4, filter, 1};
  double time = 0.0;

  void SetUp() override {
    filter.mean() = initial_mean(*model);
    filter.covariance() = initial_covariance(*model);
  }
  void sail(int steps) {
    for (int k = 0; k < steps; ++k) {
      const double input = std::sin(3.0 * time), duration = 0.1;
      filter.predict(&input, duration);
      past.advance(duration, &input);
      time += duration;
      past.note(time, filter);
    }
  }
};

TEST_F(Course, LeadsBackToWhatWasKnownThen) {
  past.cover(0.4);  // four of them, a step apart
  sail(6);
  const Eigen::VectorXd mean = filter.mean();
  const Eigen::MatrixXd covariance = filter.covariance();
  sail(3);
  WalkingFilter back = filter;
  ASSERT_TRUE(past.go_to(0.6 + 1e-9, back));
  EXPECT_LT((back.mean() - mean).norm(), 1e-6);
  EXPECT_LT((back.covariance() - covariance).norm(), 1e-6);
}

/// Between two of them the filter predicts, with the mean of the inputs since the earlier one.
TEST_F(Course, LeadsToTimesBetween) {
  past.cover(2.0);  // half a second apart
  sail(18);
  WalkingFilter back = filter;
  ASSERT_TRUE(past.go_to(1.3, back));
  // Noted at 0.1, 0.6, 1.1 and 1.6 s; inputs of 1.1 s to 1.6 s.
  WalkingFilter there = filter;
  double mean = 0.0;
  for (int k = 11; k < 16; ++k) mean += std::sin(0.3 * k) / 5.0;
  ASSERT_TRUE(past.go_to(1.1 + 1e-9, there));
  there.predict(&mean, 0.2 - 1e-9);
  EXPECT_LT((back.mean() - there.mean()).norm(), 1e-6);
}

TEST_F(Course, SaysWhereItDoesNotReach) {
  past.cover(0.4);
  WalkingFilter back = filter;
  EXPECT_FALSE(past.go_to(1.0, back));
  sail(20);
  EXPECT_FALSE(past.go_to(1.0, back));
  EXPECT_TRUE(past.go_to(1.8, back));
  past.forget();
  EXPECT_FALSE(past.go_to(2.0, back));
}

TEST(PastMoments, MeanOfInputsSkipsThoseThatAreMissing) {
  std::vector<double> mean{nan, nan};
  double duration = 0.0;
  const double first[] = {1.0, nan}, second[] = {4.0, 2.0}, third[] = {nan, nan};
  PastMoments::add_to_mean(0.2, first, duration, mean);
  EXPECT_EQ(mean[0], 1.0);
  EXPECT_TRUE(std::isnan(mean[1]));
  PastMoments::add_to_mean(0.1, second, duration, mean);
  EXPECT_NEAR(mean[0], 2.0, 1e-12);
  EXPECT_EQ(mean[1], 2.0);
  PastMoments::add_to_mean(0.3, third, duration, mean);
  EXPECT_NEAR(mean[0], 2.0, 1e-12);
  EXPECT_NEAR(duration, 0.6, 1e-12);
}

}  // namespace past_moments_test
}  // namespace rhec
