#include "rhec/core/ocp/iterate_checks.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <vector>

#include "support/cart.hpp"

namespace rhec {
namespace iterate_checks_test {

using testing::cart_control;
using testing::scattered_point;

constexpr double nan = std::numeric_limits<double>::quiet_NaN(), infinity = std::numeric_limits<double>::infinity();

class PointTest : public ::testing::Test {
 protected:
  bool is_sound(const Iterate& at) { return is_sound_start(*problem, at, scratch); }

  std::unique_ptr<RhcProblem> problem = cart_control(4);
  Iterate point = scattered_point(*problem);
  std::vector<double> scratch = std::vector<double>(problem->scratch_size());
};

TEST_F(PointTest, IsSoundAsLongAsAllOfItsNumbersAre) {
  EXPECT_TRUE(is_finite(*problem, point));
  EXPECT_TRUE(is_sound(point));
  for (const double bad : {nan, infinity, -infinity}) {
    for (int row = 0; row < 5; ++row) {
      Iterate broken = point;
      double* rows[] = {broken.state(4), broken.control(3), broken.costate(2), broken.state_bound(1),
                        broken.control_bound(0)};
      rows[row][0] = bad;
      EXPECT_FALSE(is_finite(*problem, broken)) << row;
      EXPECT_FALSE(is_sound(broken)) << row;
    }
  }
}

TEST_F(PointTest, MayHoldAnythingWhereTheProblemUsesNothing) {
  problem->set_intervals(2);
  problem->finish(scratch);
  point.state(4)[0] = nan;
  point.control(2)[0] = nan;
  EXPECT_TRUE(is_finite(*problem, point));
  EXPECT_TRUE(is_sound(point));
}

TEST_F(PointTest, IsNoStartWhereTheProblemIsBroken) {
  EXPECT_FALSE(is_sound(Iterate(cart_control(3)->capacity()))) << "it is another problem's";
  problem->state_reference(1)[0] = nan;
  EXPECT_TRUE(has_sound_numbers(*problem, point));
  EXPECT_FALSE(is_sound(point)) << "the objective is no number";
  problem->state_reference(1)[0] = 0.0;
  problem->input_lower(1, 0) = nan;
  problem->finish(scratch);
  EXPECT_FALSE(has_sound_numbers(*problem, point)) << "a bound is no number";
  problem->input_lower(1, 0) = -infinity;
  problem->finish(scratch);
  EXPECT_TRUE(is_sound(point)) << "and one that is not there may be infinite";
  for (const double bad : {nan, infinity}) {
    problem->given_state()[0] = bad;
    EXPECT_FALSE(is_sound(point)) << "what is given of the first node is no number";
  }
}

TEST_F(PointTest, HasLargestMultipliers) {
  point.clear_multipliers();
  EXPECT_EQ(largest_costate(*problem, point), 0.0);
  EXPECT_EQ(largest_bound_multiplier(*problem, point), 0.0);
  point.costate(0)[0] = 9.0;  // of a given initial state
  point.costate(3)[1] = -2.0;
  EXPECT_EQ(largest_costate(*problem, point), 2.0);
  point.control_bound(1)[0] = -3.0;
  EXPECT_EQ(largest_bound_multiplier(*problem, point), 3.0);
  point.state_bound(4)[1] = 4.0;
  EXPECT_EQ(largest_bound_multiplier(*problem, point), 4.0);
}

TEST_F(PointTest, SumsWhatBoundsAreViolatedBy) {
  for (int i = 0; i <= 4; ++i) point.state(i)[1] = 1.0;
  for (int i = 0; i < 4; ++i) point.control(i)[0] = 0.0;
  EXPECT_EQ(total_violation(*problem, point), 0.0);
  point.state(2)[1] = 5.5;     // of at most 5
  point.state(3)[1] = -6.0;    // of at least -5
  point.control(1)[0] = 1.25;  // of at most 1
  point.state(0)[1] = 100.0;   // is given
  EXPECT_DOUBLE_EQ(total_violation(*problem, point), 0.5 + 1.0 + 0.25);
}

}  // namespace iterate_checks_test
}  // namespace rhec
