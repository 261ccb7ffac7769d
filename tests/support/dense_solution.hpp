#pragma once

#include <gtest/gtest.h>

#include <cmath>

#include "rhec/core/qp/riccati.hpp"
#include "support/random_qp.hpp"

namespace rhec::testing {

inline void expect_same_as_dense(const StageQp& qp, const ActiveSet& active, const Iterate& step, double tolerance) {
  const DenseQp dense(qp, active);
  const Eigen::VectorXd z = dense.solve();
  const int N = qp.intervals();
  int row = 0;
  const auto size = dense.H.rows();
  for (int i = 0; i <= N; ++i) {
    for (int j = 0; j < qp.states(i); ++j)
      ASSERT_NEAR(step.state(i)[j], z[dense.state_at[i] + j], tolerance) << "state " << i << "," << j;
    for (int j = 0; j < qp.controls(i); ++j)
      ASSERT_NEAR(step.control(i)[j], z[dense.control_at[i] + j], tolerance) << "control " << i << "," << j;
    if (i == N) break;
    for (int j = 0; j < qp.states(i + 1); ++j)
      ASSERT_NEAR(step.costate(i + 1)[j], z[size + row++], tolerance) << "costate " << i + 1 << "," << j;
  }
  row = dense.dynamics_rows;
  for (int i = 0; i <= N; ++i) {
    if (i > 0 || !qp.initial_state_is_given) {
      for (int j = 0; j < qp.states(i); ++j) {
        ASSERT_NEAR(step.state_bound(i)[j], active.state(i)[j] ? z[size + row++] : 0.0, tolerance);
      }
    }
    for (int j = 0; j < qp.controls(i); ++j) {
      ASSERT_NEAR(step.control_bound(i)[j], active.control(i)[j] ? z[size + row++] : 0.0, tolerance);
    }
  }
}

/// The step of least cost with the bounds of a set held, which is compared with that of the dense system.
inline void expect_solved(const StageQp& qp, const ActiveSet& active, double tolerance) {
  Riccati riccati(qp.capacity());
  Iterate step(qp.capacity());
  riccati.factor(qp, active);
  EXPECT_FALSE(riccati.was_convexified());
  ASSERT_EQ(riccati.solve(qp, active, step), Riccati::Outcome::done);
  expect_same_as_dense(qp, active, step, tolerance);
}

}  // namespace rhec::testing
