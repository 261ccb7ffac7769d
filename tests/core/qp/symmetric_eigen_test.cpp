#include "rhec/core/qp/symmetric_eigen.hpp"

#include <cmath>
#include <limits>

#include <gtest/gtest.h>

namespace rhec {
namespace symmetric_eigen_test {

TEST(SymmetricEigen, OfTheSecondDifferenceAreKnown) {
  // The matrix of -1, 2, -1 of n rows has the eigenvalues 2 - 2 cos(k pi / (n + 1)).
  constexpr int n = 9;
  Eigen::MatrixXd differences = Eigen::MatrixXd::Zero(n, n);
  for (int i = 0; i < n; ++i) {
    differences(i, i) = 2.0;
    if (i > 0) differences(i, i - 1) = differences(i - 1, i) = -1.0;
  }
  const SymmetricEigen eigen = symmetric_eigen(differences);
  for (int k = 0; k < n; ++k) EXPECT_NEAR(eigen.values[k], 2.0 - 2.0 * std::cos((k + 1) * M_PI / (n + 1)), 1e-14);
  EXPECT_LT((eigen.vectors * eigen.values.asDiagonal() * eigen.vectors.transpose() - differences).norm(), 1e-13);
  EXPECT_LT((eigen.vectors.transpose() * eigen.vectors - Eigen::MatrixXd::Identity(n, n)).norm(), 1e-13);
}

TEST(SymmetricEigen, OnlyTheLowerTriangleIsRead) {
  Eigen::MatrixXd lower(2, 2);
  lower << 2.0, 100.0, 1.0, 2.0;
  const SymmetricEigen eigen = symmetric_eigen(lower);
  EXPECT_NEAR(eigen.values[0], 1.0, 1e-15);
  EXPECT_NEAR(eigen.values[1], 3.0, 1e-15);
}

TEST(SymmetricEigen, AnEmptyMatrixHasNone) { EXPECT_EQ(symmetric_eigen(Eigen::MatrixXd(0, 0)).values.size(), 0); }

TEST(SymmetricEigen, AreNotFiniteWhereTheMatrixIsNot) {
  Eigen::MatrixXd broken = Eigen::MatrixXd::Identity(3, 3);
  broken(2, 1) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(symmetric_eigen(broken).values.allFinite());
}

}  // namespace symmetric_eigen_test
}  // namespace rhec
