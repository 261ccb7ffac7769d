#include "solvers/nlopt/active_set.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace rhec::nlopt {
namespace active_set_test {

using Vector = Eigen::VectorXd;
using Matrix = Eigen::MatrixXd;

TEST(ActiveSet, SolvesAProgramWithKnownMultipliers) {
  // min (x-2)^2 + (y-2)^2 with x <= 1 and x + y <= 2.5: x = 1, y = 1.5, multipliers 1 and 1.
  const Vector gradient = Vector::Constant(2, -4.0);
  const Matrix jacobian = Matrix::Ones(1, 2), hessian = 2.0 * Matrix::Identity(2, 2);
  const CondensedQp qp{gradient, jacobian, Vector::Constant(3, -HUGE_VAL), Eigen::Vector3d(1.0, HUGE_VAL, 2.5)};
  Vector step, multipliers = Vector::Zero(3);
  ASSERT_TRUE(solve_active_set(qp, hessian, step, multipliers));
  EXPECT_NEAR(step[0], 1.0, 1e-12);
  EXPECT_NEAR(step[1], 1.5, 1e-12);
  EXPECT_NEAR(multipliers[0], 1.0, 1e-12);
  EXPECT_NEAR(multipliers[1], 0.0, 1e-12);
  EXPECT_NEAR(multipliers[2], 1.0, 1e-12);
  // The same multipliers from the gradient at the solution alone.
  const Vector there = gradient + hessian * step;
  const CondensedQp solved{there, jacobian, Vector::Constant(3, -HUGE_VAL), Eigen::Vector3d(0.0, HUGE_VAL, 0.0)};
  const Vector found = recover_multipliers(solved, Vector::Ones(2), 1e-9);
  EXPECT_LT((found - multipliers).cwiseAbs().maxCoeff(), 1e-12);
}

TEST(ActiveSet, SaysNoToCurvatureThatIsNotPositive) {
  const Vector gradient = Vector::Constant(1, 1.0);
  const Matrix jacobian(0, 1), hessian = -Matrix::Identity(1, 1);
  const CondensedQp qp{gradient, jacobian, Vector::Constant(1, -HUGE_VAL), Vector::Constant(1, HUGE_VAL)};
  Vector step, multipliers = Vector::Zero(1);
  EXPECT_FALSE(solve_active_set(qp, hessian, step, multipliers));
}

}  // namespace active_set_test
}  // namespace rhec::nlopt
