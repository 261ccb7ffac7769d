#include "rhec/core/ocp/start_search.hpp"

#include <gtest/gtest.h>

#include <vector>

#include "support/cart.hpp"
#include "support/limited_ocp.hpp"

namespace rhec {
namespace start_search_test {

using testing::cart_control;
using testing::Limit;
using testing::LimitedOcp;

constexpr int intervals = 8, limited_node = 6;
constexpr auto no_deadline = Clock::time_point::max();

/// A cart that is not to be at a place at one node, and a guess that leads there exactly.
class StartSearchTest : public ::testing::Test {
 protected:
  void SetUp() override {
    Iterate plain(cart_->capacity());
    for (int i = 0; i < intervals; ++i)
      for (int j = 0; j < cart_->control_count(i); ++j) plain.control(i)[j] = 0.3;
    roll_out(*cart_, plain, scratch_);
    guess_ = with_limits(limited_, plain);
    search_.setup(limited_);
  }

  void keep_out(double distance) {
    limited_.add(limited_node, {Limit::Kind::distance, {0}, {guess_.state(limited_node)[0]}, distance});
  }
  bool find(double least, Iterate& to) { return search_.find(limited_, guess_, least, no_deadline, scratch_, to); }
  double violation(const Iterate& of) { return search_.violation(limited_, of, scratch_); }

  std::unique_ptr<RhcProblem> cart_ = cart_control(intervals);
  LimitedOcp limited_{*cart_, 2};
  std::vector<double> scratch_ = std::vector<double>(limited_.scratch_size());
  Iterate guess_;
  StartSearch search_;
};

TEST_F(StartSearchTest, LeavesAPlaceAtWhichAViolationHasNoGradient) {
  const double distance = 0.05;
  keep_out(distance);
  EXPECT_NEAR(violation(guess_), distance - Limit::roundness, 1e-12);
  Iterate found = guess_;
  ASSERT_TRUE(find(violation(guess_), found));
  EXPECT_EQ(violation(found), 0.0);
  EXPECT_GT(std::abs(found.state(limited_node)[0] - guess_.state(limited_node)[0]), 0.5 * distance);
  // A trajectory of the problem: from the given state, with the states that its controls lead to.
  Iterate simulated = found;
  roll_out(limited_, simulated, scratch_);
  for (int i = 0; i <= intervals; ++i)
    for (int j = 0; j < limited_.state_count(i); ++j) EXPECT_EQ(found.state(i)[j], simulated.state(i)[j]) << i;
}

TEST_F(StartSearchTest, FindsNothingWhereTheViolationIsTheLeastThereIs) {
  // At one node both beyond a place and before it: the sum of the two violations is the same between them.
  const double here = guess_.state(limited_node)[0], off = 0.1;
  limited_.add(limited_node, {Limit::Kind::linear, {0}, {1.0}, here + off});
  Limit other{Limit::Kind::linear, {0}, {1.0}};
  other.upper = here - off;
  limited_.add(limited_node, other);
  EXPECT_NEAR(violation(guess_), 2.0 * off, 1e-12);
  Iterate found = guess_;
  found.state(1)[0] = 7.0;
  EXPECT_FALSE(find(0.99 * violation(guess_), found));
  EXPECT_EQ(found.state(1)[0], 7.0) << "left as it was";
}

TEST_F(StartSearchTest, IsTheSameEachTime) {
  keep_out(0.4);
  Iterate one = guess_, two = guess_;
  ASSERT_TRUE(find(violation(guess_), one));
  StartSearch fresh;
  fresh.setup(limited_);
  ASSERT_TRUE(fresh.find(limited_, guess_, violation(guess_), no_deadline, scratch_, two));
  for (int i = 0; i < intervals; ++i)
    for (int j = 0; j < limited_.control_count(i); ++j) EXPECT_EQ(one.control(i)[j], two.control(i)[j]);
}

TEST_F(StartSearchTest, KeepsTheDeadline) {
  keep_out(0.05);
  Iterate found = guess_;
  EXPECT_FALSE(search_.find(limited_, guess_, violation(guess_), Clock::now(), scratch_, found));
}

}  // namespace start_search_test
}  // namespace rhec
