// The stages of the recursion that core/qp/special_stages.cpp handles: controls that must satisfy bounds of the next
// state, a free initial state that is held at bounds, and reduced Hessians that are not positive definite.
#include <Eigen/SVD>
#include <array>
#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "rhec/core/qp/riccati.hpp"
#include "rhec/core/qp/stage_qp_views.hpp"
#include "support/dense_solution.hpp"

namespace rhec {
namespace special_stages_test {

using testing::DenseQp;
using testing::expect_same_as_dense;
using testing::RandomQp;

TEST(SpecialStages, AgreesWithTheDenseSystemWithActiveControlsAndStates) {
  RandomQp random(2);
  int compared = 0;
  for (int trial = 0; trial < 400; ++trial) {
    StageQp qp = random.make(random.integer(1, 8), random.integer(1, 5), random.integer(1, 4), trial % 2 == 0);
    ActiveSet active(qp.capacity());
    for (int i = 0; i <= qp.intervals(); ++i) {
      for (int j = 0; j < qp.states(i); ++j) {
        if ((i == 0 && qp.initial_state_is_given) || random.uniform(0.0, 1.0) > 0.12) continue;
        active.state(i)[j] = 1;
        qp.state_upper(i)[j] = random.uniform(-0.5, 0.5);
      }
      for (int j = 0; j < qp.controls(i); ++j) {
        if (random.uniform(0.0, 1.0) > 0.2) continue;
        active.control(i)[j] = -1;
        qp.control_lower(i)[j] = random.uniform(-0.5, 0.5);
      }
    }
    // If the active rows are linearly dependent, there is no unique solution to compare with.
    const DenseQp dense(qp, active);
    if (dense.E.rows() > dense.E.cols()) continue;
    const Eigen::JacobiSVD<Eigen::MatrixXd> svd(dense.E);
    if (svd.singularValues().tail(1)[0] < 1e-2) continue;
    ++compared;
    Riccati riccati(qp.capacity());
    Iterate step(qp.capacity());
    riccati.factor(qp, active);
    ASSERT_EQ(riccati.solve(qp, active, step), Riccati::Outcome::done);
    expect_same_as_dense(qp, active, step, 1e-7);
  }
  EXPECT_GT(compared, 150);
}

TEST(SpecialStages, HasNoResponsesWhereStateBoundsHold) {
  RandomQp random(9);
  const StageQp qp = random.make(4, 3, 2, true);
  ActiveSet active(qp.capacity());
  active.state(2)[1] = 1;
  Riccati riccati(qp.capacity());
  riccati.factor(qp, active);
  Riccati::Sensitivities sensitivities(qp.capacity());
  const Riccati::Entry gradient{1, 0};
  EXPECT_FALSE(riccati.find_sensitivities(qp, active, &gradient, 1, sensitivities));
}

TEST(SpecialStages, RefusesActiveBoundsThatContradictEachOther) {
  RandomQp random(3);
  StageQp qp = random.make(2, 1, 1, true);
  for (int i = 0; i < 2; ++i) {
    qp.set_sizes(i, 1, 0);
    qp.AB(i)[0] = 1.0;
    qp.b(i)[0] = 0.0;
  }
  ActiveSet active(qp.capacity());
  active.state(2)[0] = 1;
  qp.state_upper(2)[0] = qp.initial_step()[0] - 1.0;
  Riccati riccati(qp.capacity());
  Iterate step(qp.capacity());
  riccati.factor(qp, active);
  EXPECT_EQ(riccati.solve(qp, active, step), Riccati::Outcome::inconsistent);
}

TEST(SpecialStages, ConvexifiesWhatIsNotPositiveDefiniteAndCanWriteItBack) {
  RandomQp random(5);
  int convexified = 0;
  for (int trial = 0; trial < 50; ++trial) {
    StageQp qp = random.make(5, 3, 2, true);
    for (int i = 0; i < 5; ++i)
      for (int j = 0; j < qp.controls(i); ++j) R_of(qp, i)(j, j) -= 4.0;
    Riccati riccati(qp.capacity());
    const ActiveSet none(qp.capacity());
    Iterate step(qp.capacity()), again(qp.capacity());
    riccati.factor(qp, none);
    convexified += riccati.was_convexified();
    ASSERT_EQ(riccati.solve(qp, none, step), Riccati::Outcome::done);
    ASSERT_TRUE(step.is_finite());
    riccati.write_convexified(qp);
    riccati.factor(qp, none);
    EXPECT_FALSE(riccati.was_convexified());
    ASSERT_EQ(riccati.solve(qp, none, again), Riccati::Outcome::done);
    for (int i = 0; i <= 5; ++i)
      for (int j = 0; j < 3; ++j) EXPECT_NEAR(step.state(i)[j], again.state(i)[j], 1e-6);
  }
  EXPECT_GT(convexified, 25);
}

TEST(SpecialStages, ConvexifiesStageByStageAsItDoesTheWhole) {
  RandomQp random(41);
  int convexified = 0;
  for (int trial = 0; trial < 60; ++trial) {
    StageQp qp = random.make(random.integer(1, 7), random.integer(1, 8), random.integer(1, 3), trial % 2 == 0);
    for (int i = 0; i < qp.intervals(); ++i)
      for (int j = 0; trial % 4 > 0 && j < qp.controls(i); ++j) R_of(qp, i)(j, j) -= random.uniform(0.0, 4.0);
    const ActiveSet none(qp.capacity());
    Riccati whole(qp.capacity()), stages(qp.capacity());
    whole.factor(qp, none);
    StageQp expected = qp, found = qp;
    EXPECT_EQ(stages.factor_if_convex(qp, none), !whole.was_convexified());
    if (whole.was_convexified()) whole.write_convexified(expected);
    ASSERT_TRUE(stages.convexify(found, none));
    EXPECT_EQ(stages.was_convexified(), whole.was_convexified());
    convexified += whole.was_convexified();
    for (int i = 0; i <= qp.intervals(); ++i)
      for (int k = 0; k < (qp.capacity().states + qp.controls(i)) * qp.stride(); ++k)
        EXPECT_NEAR(found.H(i)[k], expected.H(i)[k], 1e-8 * (1.0 + std::abs(expected.H(i)[k]))) << trial << ": " << i;
    if (qp.initial_state_is_given) {
      EXPECT_TRUE(stages.factor_if_convex(found, none));
    }
  }
  EXPECT_GT(convexified, 10);
  StageQp wrong = random.make(3, 2, 2, true);
  R_of(wrong, 1)(0, 0) = std::nan("");
  Riccati riccati(wrong.capacity());
  EXPECT_FALSE(riccati.convexify(wrong, ActiveSet(wrong.capacity())));
}

}  // namespace special_stages_test
}  // namespace rhec
