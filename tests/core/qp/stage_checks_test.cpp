#include "rhec/core/qp/stage_checks.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "support/random_qp.hpp"

namespace rhec {
namespace stage_checks_test {

using ::testing::ElementsAre;
using testing::RandomQp;

class StageChecks : public ::testing::Test {
 protected:
  StageChecks() : step(qp.capacity()) {
    for (int i = 0; i <= 4; ++i) {
      for (int j = 0; j < 3; ++j) {
        qp.state_lower(i)[j] = -1.0;
        qp.state_upper(i)[j] = 1.0;
      }
      for (int j = 0; j < qp.controls(i); ++j) {
        qp.control_lower(i)[j] = -2.0;
        qp.control_upper(i)[j] = 2.0;
      }
    }
  }
  /// An interval that has a control.
  int controlled() const {
    int i = 0;
    while (qp.controls(i) == 0) ++i;
    return i;
  }
  std::vector<int> marks(bool& contradicts) const {
    std::vector<std::uint8_t> found(5, 7);
    contradicts = mark_bounds(qp, step, 1e-9, found.data());
    return {found.begin(), found.end()};
  }

  StageQp qp = RandomQp(5).make(4, 3, 2, true);
  Iterate step;
};

TEST_F(StageChecks, StepsAreFiniteOrNot) {
  EXPECT_TRUE(check_step(qp, step, 1e-9).is_finite);
  for (int row = 0; row < 3; ++row) {
    Iterate broken = step;
    double* rows[] = {broken.state(4), broken.control(controlled()), broken.costate(2)};
    rows[row][0] = row == 1 ? HUGE_VAL : std::nan("");
    EXPECT_FALSE(check_step(qp, broken, 1e-9).is_finite) << row;
  }
}

TEST_F(StageChecks, StepsViolateBoundsByMoreThanTheTolerance) {
  step.state(4)[2] = 1.0 + 1.9e-3;  // of a bound b, tolerance (1 + |b|) is allowed
  EXPECT_FALSE(check_step(qp, step, 1e-3).violates);
  step.state(4)[2] = 1.0 + 2.1e-3;
  EXPECT_TRUE(check_step(qp, step, 1e-3).violates);
  step.state(4)[2] = 0.0;
  step.control(controlled())[0] = -2.1;
  EXPECT_TRUE(check_step(qp, step, 1e-3).violates);
}

TEST_F(StageChecks, StepsHaveALargestCostate) {
  step.costate(1)[1] = 2.0;
  step.costate(3)[2] = -5.0;
  EXPECT_EQ(check_step(qp, step, 1e-9).largest_costate, 5.0);
}

TEST_F(StageChecks, MarksStagesWhoseBoundsMatter) {
  bool contradicts = true;
  EXPECT_THAT(marks(contradicts), ElementsAre(0, 0, 0, 0, 0));
  EXPECT_FALSE(contradicts);
  step.state_bound(3)[0] = -1e-12;
  qp.state_lower(1)[1] = qp.state_upper(1)[1] = 0.5;
  EXPECT_THAT(marks(contradicts), ElementsAre(0, 1, 0, 1, 0));
  EXPECT_FALSE(contradicts);
}

TEST_F(StageChecks, SeesBoundsThatContradictEachOther) {
  bool contradicts = false;
  qp.state_lower(2)[1] = 1.0 + 1e-12;
  marks(contradicts);
  EXPECT_FALSE(contradicts) << "it is rounding";
  qp.state_lower(2)[1] = 1.1;
  marks(contradicts);
  EXPECT_TRUE(contradicts);
  qp.state_lower(2)[1] = std::nan("");
  marks(contradicts);
  EXPECT_TRUE(contradicts);
}

TEST(Violations, AreTheDistancesBeyondTheNearerBound) {
  const AlignedDoubles values = {0.0, 2.0, -3.0, 1.0, 0.0, 0.0, 0.0, 9.0},
                       least = {-1.0, -1.0, -1.0, 1.0, -HUGE_VAL, 0.5, 0.0, -HUGE_VAL},
                       most = {1.0, 1.0, 1.0, 1.0, HUGE_VAL, 1.0, 0.0, HUGE_VAL};
  AlignedDoubles violations(8);
  const ViolatedBounds found = find_violations(values.data(), least.data(), most.data(), 8, violations.data());
  EXPECT_EQ(found.largest, 2.0);
  EXPECT_EQ(found.count, 3);
  EXPECT_EQ(violations[1], 1.0);
  EXPECT_EQ(violations[2], 2.0);
  EXPECT_EQ(violations[5], 0.5);
  for (const int j : {0, 3, 4, 6, 7}) EXPECT_LE(violations[j], 0.0) << j;
}

TEST(Violations, CountFromWidenedBoundsOn) {
  const AlignedDoubles lower = {-1.0, 0.0, -HUGE_VAL, 3.0, 0.0, 0.0, 0.0, 0.0},
                       upper = {1.0, 0.0, HUGE_VAL, 9.0, 0.0, 0.0, 0.0, 0.0};
  AlignedDoubles least(8), most(8);
  widen_bounds(lower.data(), upper.data(), 0.01, 8, least.data(), most.data());
  EXPECT_DOUBLE_EQ(least[0], -1.02);
  EXPECT_DOUBLE_EQ(most[0], 1.02);
  EXPECT_DOUBLE_EQ(least[1], -0.01);
  EXPECT_EQ(least[2], -HUGE_VAL);
  EXPECT_EQ(most[2], HUGE_VAL);
  EXPECT_DOUBLE_EQ(least[3], 2.96);
  EXPECT_DOUBLE_EQ(most[3], 9.1);
}

TEST_F(StageChecks, AddsAStepToThePointThatItStartsFrom) {
  Iterate from(qp.capacity());
  from.state(4)[1] = 2.0;
  from.costate(4)[1] = 3.0;
  step.state(4)[1] = 0.5;
  step.costate(4)[1] = 0.25;
  add_to_step(4, from, step);
  EXPECT_EQ(step.state(4)[1], 2.5);
  EXPECT_EQ(step.costate(4)[1], 0.25) << "a step's multipliers are the new ones already";
}

}  // namespace stage_checks_test
}  // namespace rhec
