#include "rhec/core/ocp/tracking_start.hpp"

#include <gtest/gtest.h>

#include <vector>

#include "support/cart.hpp"
#include "support/limited_ocp.hpp"

namespace rhec {
namespace tracking_start_test {

using testing::cart_control;
using testing::Limit;
using testing::LimitedOcp;

constexpr int intervals = 8, limited_node = 6;
constexpr auto no_deadline = Clock::time_point::max();

/// A cart whose place is limited at one node, and guesses by its inputs.
class TrackingStartTest : public ::testing::Test {
 protected:
  void SetUp() override {
    limited_.add(limited_node, {Limit::Kind::linear, {0}, {1.0}, -2.0, 2.0});
    tracking_.setup(limited_);
  }

  Iterate guess(double input) {
    Iterate plain(cart_->capacity());
    for (int i = 0; i < intervals; ++i)
      for (int j = 0; j < cart_->control_count(i); ++j) plain.control(i)[j] = input;
    roll_out(*cart_, plain, scratch_);
    return with_limits(limited_, plain);
  }
  double objective(const Iterate& of) { return limited_.evaluate(of, nullptr, scratch_); }

  std::unique_ptr<RhcProblem> cart_ = cart_control(intervals);
  LimitedOcp limited_{*cart_, 2};
  std::vector<double> scratch_ = std::vector<double>(limited_.scratch_size());
  TrackingStart tracking_;
};

TEST_F(TrackingStartTest, FollowsTheObjectiveWhereAGuessIsFarAway) {
  const Iterate far = guess(1e5);
  Iterate found = far;
  ASSERT_TRUE(tracking_.find(limited_, far, no_deadline, scratch_, found));
  EXPECT_LT(objective(found), 0.1 * objective(far));
  // A trajectory of the problem, within the bounds of its controls and without multipliers.
  Iterate simulated = found;
  roll_out(limited_, simulated, scratch_);
  for (int i = 0; i <= intervals; ++i)
    for (int j = 0; j < limited_.state_count(i); ++j) {
      EXPECT_EQ(found.state(i)[j], simulated.state(i)[j]) << i;
      EXPECT_EQ(found.costate(i)[j], 0.0);
    }
  for (int i = 0; i < intervals; ++i)
    for (int j = 0; j < limited_.control_count(i); ++j) {
      EXPECT_GE(found.control(i)[j], limited_.control_lower(i)[j]);
      EXPECT_LE(found.control(i)[j], limited_.control_upper(i)[j]);
    }
  // From what it found there is nothing better of its kind.
  Iterate again = found;
  EXPECT_FALSE(tracking_.find(limited_, found, no_deadline, scratch_, again));
  EXPECT_EQ(again.control(0)[0], found.control(0)[0]);
}

TEST_F(TrackingStartTest, LeavesAGuessThatIsNear) {
  Iterate near = guess(1e5);
  ASSERT_TRUE(tracking_.find(limited_, near, no_deadline, scratch_, near));
  near.control(0)[0] += 0.01;
  roll_out(limited_, near, scratch_);
  Iterate found = near;
  EXPECT_FALSE(tracking_.find(limited_, near, no_deadline, scratch_, found));
  EXPECT_EQ(found.control(0)[0], near.control(0)[0]);
}

TEST_F(TrackingStartTest, HasNoTimeAfterItsDeadline) {
  const Iterate far = guess(1e5);
  Iterate found = far;
  EXPECT_FALSE(tracking_.find(limited_, far, Clock::now() - std::chrono::seconds(1), scratch_, found));
}

}  // namespace tracking_start_test
}  // namespace rhec
