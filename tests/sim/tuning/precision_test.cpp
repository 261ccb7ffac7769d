#include "rhec/sim/tuning/precision.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include <Eigen/LU>

#include "rhec/sim/numbers/random.hpp"

namespace rhec::sim {
namespace precision_test {

PrecisionOptions within(Eigen::Index size, double half) {
  PrecisionOptions options;
  options.lower = Eigen::VectorXd::Constant(size, -half);
  options.upper = Eigen::VectorXd::Constant(size, half);
  return options;
}

/// Least squares: y_i = a_i' z + noise, with terms -(y_i - a_i' z)^2 / 2.
struct Line {
  Eigen::MatrixXd A;
  Eigen::VectorXd y;
  Line(int count, double correlated, double noise) : A(count, 2), y(count) {
    RandomStream random(3, "line");
    double shared = 0.0;
    for (int i = 0; i < count; ++i) {
      A(i, 0) = random.normal();
      A(i, 1) = 0.9 * A(i, 0) + 0.4 * random.normal();
      shared = correlated * shared + random.normal();
      y[i] = noise * shared;
    }
  }
  Eigen::VectorXd best() const {
    const Eigen::MatrixXd information = A.transpose() * A + Eigen::MatrixXd::Identity(2, 2);
    return information.inverse() * A.transpose() * y;
  }
  LikelihoodTerms terms() const {
    return [this](const Eigen::VectorXd& at) -> Eigen::VectorXd { return -0.5 * (y - A * at).array().square(); };
  }
};

TEST(Precision, IsThatOfLeastSquares) {
  const Line line(400, 0.0, 1.0);
  const Precision found = precision_at(line.terms(), line.best(), within(2, 3.0));
  const Eigen::MatrixXd exact = (line.A.transpose() * line.A + Eigen::MatrixXd::Identity(2, 2)).inverse();
  EXPECT_NEAR((found.hessian - line.A.transpose() * line.A).norm(), 0.0, 1e-6 * found.hessian.norm());
  for (int i = 0; i < 2; ++i) {
    EXPECT_NEAR(found.hessian_errors[i], std::sqrt(exact(i, i)), 1e-6);
    EXPECT_NEAR(found.error(i), std::sqrt(exact(i, i)), 0.4 * std::sqrt(exact(i, i)));
  }
  EXPECT_NEAR(found.correlation(0, 1), exact(0, 1) / std::sqrt(exact(0, 0) * exact(1, 1)), 1e-6);
  EXPECT_LT(found.roughness, 1e-6);
}

TEST(Precision, IsLessWhereNoiseIsLargerThanStated) {
  const Line line(400, 0.0, 3.0);
  const Precision found = precision_at(line.terms(), line.best(), within(2, 3.0));
  for (int i = 0; i < 2; ++i) EXPECT_NEAR(found.error(i) / found.hessian_errors[i], 3.0, 1.0);
}

TEST(Precision, SaysWhatIsAtABoundAndWhatIsFlat) {
  // The first coordinate is at its bound, and nothing depends on the second.
  const auto terms = [](const Eigen::VectorXd& at) -> Eigen::VectorXd {
    return Eigen::VectorXd::Constant(100, at[0] - 0.5 * at[2] * at[2]);
  };
  Eigen::VectorXd at = Eigen::VectorXd::Zero(3);
  at[0] = 3.0;
  const Precision found = precision_at(terms, at, within(3, 3.0));
  EXPECT_FALSE(found.is_free[0]);
  EXPECT_TRUE(found.is_free[1]);
  EXPECT_NEAR(found.error(1), 1.0, 1e-9);  // of the prior alone
  EXPECT_NEAR(found.hessian(2, 2), 100.0, 1e-6);
}

TEST(Precision, LooksPastRoughness) {
  // A parabola of curvature 400 with steps as of a filter that is lost or not.
  const auto terms = [](const Eigen::VectorXd& at) -> Eigen::VectorXd {
    const double value = -200.0 * at.squaredNorm() + 3.0 * std::sin(1e4 * at[0]) + 3.0 * std::sin(2e4 * at[1]);
    return Eigen::VectorXd::Constant(50, value / 50.0);
  };
  const Precision found = precision_at(terms, Eigen::VectorXd::Zero(2), within(2, 3.0));
  for (int i = 0; i < 2; ++i) EXPECT_NEAR(found.hessian_errors[i], 1.0 / std::sqrt(401.0), 0.5 / std::sqrt(401.0));
  EXPECT_GT(found.roughness, 0.5);
  EXPECT_LT(std::abs(found.correlation(0, 1)), 0.6);
}

}  // namespace precision_test
}  // namespace rhec::sim
