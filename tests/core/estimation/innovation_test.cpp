#include "core/estimation/innovation.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include <Eigen/LU>

namespace rhec::innovation_test {
namespace {

using Value = Innovation::OfSensor<1>;
using Covariance = Innovation::OfSensor<Eigen::Dynamic>;

TEST(Innovation, HasTheSizeAndTheVolumeThatEliminationFinds) {
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  for (int n = 1; n <= most_sensor_outputs; ++n) {
    const Covariance any = Covariance::NullaryExpr(n, n, [&](auto, auto) { return normal(random); });
    const Covariance S = any * any.transpose() + 0.1 * Covariance::Identity(n, n);
    const Value nu = Value::NullaryExpr(n, [&](auto) { return normal(random); });
    const Eigen::FullPivLU<Eigen::MatrixXd> elimination{Eigen::MatrixXd(S)};
    const double size = nu.dot(elimination.solve(Eigen::VectorXd(nu)));
    EXPECT_NEAR(squared_size(nu, S), size, 1e-10 * size) << n << " outputs";
    EXPECT_NEAR(normalised(nu, S).squaredNorm(), size, 1e-10 * size) << n << " outputs";
    EXPECT_NEAR(log_determinant(S), std::log(elimination.determinant()), 1e-10) << n << " outputs";
  }
}

TEST(Innovation, HasNoVolumeWhereTheCovarianceIsNone) {
  const Covariance turned = Eigen::Vector2d(1.0, -1.0).asDiagonal();
  EXPECT_TRUE(std::isnan(log_determinant(turned)));
}

}  // namespace
}  // namespace rhec::innovation_test
