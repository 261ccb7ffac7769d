// The recursion's last step, core/qp/free_initial_state.cpp: a free initial state is a decision variable too.
#include <cmath>

#include <gtest/gtest.h>

#include "rhec/core/qp/riccati.hpp"
#include "rhec/core/qp/stage_qp_views.hpp"
#include "support/dense_solution.hpp"

namespace rhec {
namespace free_initial_state_test {

using namespace testing;

TEST(FreeInitialState, IsDecidedWithAllElse) {
  RandomQp random(31);
  for (int trial = 0; trial < 60; ++trial) {
    const StageQp qp = random.make(random.integer(1, 6), random.integer(1, 6), random.integer(1, 3), false);
    expect_solved(qp, ActiveSet(qp.capacity()), 1e-8);
  }
}

TEST(FreeInitialState, IsHeldAtItsBounds) {
  RandomQp random(32);
  int held = 0;
  for (int trial = 0; trial < 60; ++trial) {
    const int states = random.integer(1, 5);
    StageQp qp = random.make(4, states, 2, false);
    ActiveSet active(qp.capacity());
    for (int j = 0; j < states; ++j) {
      if (random.integer(0, 1) == 0) continue;
      active.state(0)[j] = random.integer(0, 1) == 0 ? -1 : 1;
      (active.state(0)[j] < 0 ? qp.state_lower(0)[j] : qp.state_upper(0)[j]) = random.uniform(-1.0, 1.0);
      ++held;
    }
    expect_solved(qp, active, 1e-8);
  }
  EXPECT_GT(held, 50);
}

TEST(FreeInitialState, MayHaveAPriorOfVeryDifferentScales) {
  RandomQp random(33);
  for (int trial = 0; trial < 20; ++trial) {
    StageQp qp = random.make(4, 3, 2, false);
    Q_of(qp, 0)(0, 0) += 1e8;
    Q_of(qp, 0)(2, 2) += 1e4;
    expect_solved(qp, ActiveSet(qp.capacity()), 1e-6);
  }
}

TEST(FreeInitialState, IsConvexifiedWhereItHasNoMinimum) {
  RandomQp random(34);
  int convexified = 0;
  for (int trial = 0; trial < 20; ++trial) {
    StageQp qp = random.make(3, 3, 2, false);
    Q_of(qp, 0)(1, 1) -= 20.0;
    Riccati riccati(qp.capacity());
    const ActiveSet none(qp.capacity());
    Iterate step(qp.capacity());
    riccati.factor(qp, none);
    convexified += riccati.was_convexified();
    ASSERT_EQ(riccati.solve(qp, none, step), Riccati::Outcome::done);
    EXPECT_TRUE(step.is_finite());
  }
  EXPECT_EQ(convexified, 20);
}

TEST(FreeInitialState, HasNoCostate) {
  RandomQp random(35);
  const StageQp qp = random.make(4, 3, 2, false);
  Riccati riccati(qp.capacity());
  const ActiveSet none(qp.capacity());
  Iterate step(qp.capacity());
  riccati.factor(qp, none);
  ASSERT_EQ(riccati.solve(qp, none, step), Riccati::Outcome::done);
  for (int j = 0; j < 3; ++j) EXPECT_EQ(step.costate(0)[j], 0.0);
}

}  // namespace free_initial_state_test
}  // namespace rhec
