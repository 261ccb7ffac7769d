#include "rhec/core/estimation/curvature.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <random>
#include <vector>

#include "support/cart.hpp"
#include "support/linear_case.hpp"
#include "support/turntable.hpp"

namespace rhec {
namespace curvature_test {

using namespace testing;

Eigen::MatrixXd random_matrix(std::mt19937_64& random, int rows, int columns) {
  std::normal_distribution<double> normal;
  return Eigen::MatrixXd::NullaryExpr(rows, columns, [&] { return normal(random); });
}

TEST(Curvature, IsWhatSecondOrderTermsSpread) {
  constexpr int n = 5, rows = 3, draws = 200000;
  std::mt19937_64 random(1);
  Eigen::MatrixXd root = random_matrix(random, n, n);
  const Eigen::MatrixXd W = root * root.transpose();
  std::vector<Eigen::MatrixXd> H(rows, Eigen::MatrixXd::Zero(n, n));
  Curvature terms(rows, n);
  for (int k = 0; k < rows; ++k) {
    // One variable takes part in none.
    const Eigen::MatrixXd half = random_matrix(random, n - 1, n - 1);
    H[k].topLeftCorner(n - 1, n - 1) = half + half.transpose();
    Eigen::Map<Eigen::MatrixXd>(terms.hessian(k), n, n) = H[k];
  }
  terms.look();
  const auto of_W = [&](std::ptrdiff_t r, std::ptrdiff_t c) { return W(r, c); };
  terms.find_factor(of_W);
  terms.find_means(of_W);
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  Eigen::Matrix3d second = Eigen::Matrix3d::Zero();
  for (int i = 0; i < draws; ++i) {
    const Eigen::VectorXd w = root * random_matrix(random, n, 1);
    Eigen::Vector3d e;
    for (int k = 0; k < rows; ++k) e[k] = 0.5 * w.dot(H[k] * w);
    mean += e / draws;
    second += e * e.transpose() / draws;
  }
  const Eigen::Matrix3d spread = second - mean * mean.transpose();
  for (int k = 0; k < rows; ++k) {
    const double sigma = std::sqrt(spread(k, k));
    EXPECT_NEAR(terms.mean(k), mean[k], 0.01 * sigma) << k;
    EXPECT_NEAR(terms.variance(k) / spread(k, k), 1.0, 0.05) << k;
    for (int l = 0; l < rows; ++l) {
      double product = 0.0;
      for (int f = 0; f < Curvature::factors; ++f) product += terms.factor(k, f) * terms.factor(l, f);
      EXPECT_NEAR(product, spread(k, l), 0.05 * sigma * std::sqrt(spread(l, l))) << k << ", " << l;
    }
  }
}

TEST(Curvature, OfManyRowsOfOneProductHasOneFactor) {
  Curvature terms(6, 2);
  for (int k = 0; k < 6; ++k) Eigen::Map<Eigen::Matrix2d>(terms.hessian(k), 2, 2) << 0.0, 1.0 + k, 1.0 + k, 0.0;
  terms.look();
  terms.find_factor([](std::ptrdiff_t r, std::ptrdiff_t c) { return r == c ? 1.0 : 0.0; });
  for (int k = 0; k < 6; ++k) {
    EXPECT_NEAR(std::abs(terms.factor(k, 0)), 1.0 + k, 1e-12);
    for (int f = 1; f < Curvature::factors; ++f) EXPECT_EQ(terms.factor(k, f), 0.0);
  }
}

TEST(Curvature, HasNoTermsWhereItIsNotFinite) {
  Curvature terms(2, 2);
  for (int k = 0; k < 2; ++k)
    Eigen::Map<Eigen::Matrix2d>(terms.hessian(k), 2, 2) << 0.0, k == 0 ? NAN : 2.0, k == 0 ? HUGE_VAL : 2.0, 0.0;
  terms.look();
  const auto W = [](std::ptrdiff_t r, std::ptrdiff_t c) { return r == c ? 1.0 : 0.25; };
  terms.find_factor(W);
  terms.find_means(W);
  EXPECT_EQ(terms.mean(0), 0.0);
  EXPECT_EQ(terms.variance(0), 0.0);
  EXPECT_NEAR(terms.mean(1), 0.5, 1e-12);
  EXPECT_NEAR(std::abs(terms.factor(1, 0)), std::sqrt(terms.variance(1)), 1e-12);
  for (int f = 0; f < Curvature::factors; ++f) EXPECT_EQ(terms.factor(0, f), 0.0);
}

TEST(Curvature, FindsTheStatesThatHaveIt) {
  EXPECT_EQ(curved_states(*turntable()), (std::vector{0, 1})) << "the angle, and the gyro's value";
  EXPECT_TRUE(curved_states(*linear_model<Trolley>()).empty());
  EXPECT_TRUE(curved_outputs(*turntable(), {0, 1}).empty());
  EXPECT_EQ(curved_outputs(*cart(), {0, 1}), std::vector{1}) << "the square of a speed";
}

}  // namespace curvature_test
}  // namespace rhec
