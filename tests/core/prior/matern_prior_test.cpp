#include "rhec/core/prior/matern_prior.hpp"

#include <gtest/gtest.h>

#include <Eigen/Core>

#include "rhec/core/model/model.hpp"

namespace rhec {
namespace matern_prior_test {

/// The parameter is the sum of a deviation and of a mean: the moments are those of the two, each on its own.
TEST(MaternPrior, IsADeviationAndAMeanThatWalks) {
  Variable parameter;
  parameter.lower = 0.0;
  parameter.upper = 2.0;
  MaternPrior::Law law;
  law.states = 3;
  law.length = 4.0;
  law.mean = 0.3;
  MaternPrior prior(law);
  prior.set_up(parameter);
  const int n = prior.state_count();
  ASSERT_EQ(n, 4);
  Eigen::MatrixXd F(n, n), Q(n, n), P(n, n);
  Eigen::VectorXd mean(n);
  prior.start(mean.data(), P.data());
  prior.advance(1.7, F.data(), Q.data());

  // Coordinates [e; e'; e''; m], from which z = T y.
  const Matern matern{3, 4.0, 0.3};  // 0.15 of the width
  Eigen::MatrixXd A = Eigen::MatrixXd::Identity(n, n), N = Eigen::MatrixXd::Zero(n, n), S = N, T = A;
  matern.transition(1.7, A.data(), N.data(), n);
  matern.stationary(S.data(), n);
  N(3, 3) = 0.01 * 0.01 * 1.7;  // 0.005 of the width per square root of a metre
  S(3, 3) = 0.4 * 0.4;          // a fifth of the width
  T(0, 3) = 1.0;
  const auto largest = [](const Eigen::MatrixXd& matrix) { return matrix.cwiseAbs().maxCoeff(); };
  EXPECT_LT(largest(F * T - T * A), 1e-14);
  EXPECT_LT(largest(Q - T * N * T.transpose()), 1e-15);
  EXPECT_LT(largest(P - T * S * T.transpose()), 1e-15);
  EXPECT_EQ(mean, Eigen::Vector4d(0.3, 0.0, 0.0, 0.3));
}

}  // namespace matern_prior_test
}  // namespace rhec
