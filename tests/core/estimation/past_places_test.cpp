// Where a position was before it moved: displacements, their sums, and how much a known one is worth.
#include "core/estimation/past_places.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include <Eigen/Cholesky>
#include <Eigen/LU>

namespace rhec {
namespace past_places_test {

using Vector = Innovation::OfSensor<1>;
using Matrix = Innovation::OfSensor<Eigen::Dynamic>;

/// Log density of a Gaussian variable of two values, with its covariance.
double log_density(const Eigen::Vector2d& value, const Eigen::Matrix2d& covariance) {
  return -0.5 * value.dot(covariance.inverse() * value) - std::log(2.0 * std::numbers::pi) -
         0.5 * std::log(covariance.determinant());
}

/// Three values of a position: two in other directions and another unit, one of both coordinates.
TEST(PastPlaces, ADisplacementIsTheBestOneOfAllValues) {
  PositionDerivatives C(3, 2);
  C << 0.6, 0.8, -80.0, 60.0, 1.0, 1.0;
  Matrix S(3, 3);
  S << 0.5, 1.0, 0.05, 1.0, 900.0, 0.0, 0.05, 0.0, 0.3;
  const Eigen::Vector2d truth(3.0, -7.0);
  Displacement found;
  ASSERT_TRUE(displacement_of(C * truth, S, C, found));
  EXPECT_LT((found.mean - truth).norm(), 1e-10);
  const Eigen::Matrix2d information = C.transpose() * S.inverse() * C;
  EXPECT_LT((found.covariance * information - Eigen::Matrix2d::Identity()).norm(), 1e-10);
  // What contradicts itself is weighed: no other displacement leaves less of nu' S^-1 nu.
  const Vector torn = C * truth + Vector::Constant(3, 2.0);
  ASSERT_TRUE(displacement_of(torn, S, C, found));
  const auto left = [&](const Eigen::Vector2d& at) { return (torn - C * at).dot(S.inverse() * (torn - C * at)); };
  for (const Eigen::Vector2d& step : {Eigen::Vector2d(1e-3, 0.0), Eigen::Vector2d(0.0, 1e-3)}) {
    EXPECT_LT(left(found.mean), left(found.mean + step));
    EXPECT_LT(left(found.mean), left(found.mean - step));
  }
}

TEST(PastPlaces, OneCoordinateDoesNotSayWhere) {
  PositionDerivatives C(1, 2);
  C << 1.0, 0.0;
  Displacement found{.mean = {5.0, 5.0}};
  EXPECT_FALSE(displacement_of(Vector::Constant(1, 3.0), Matrix::Identity(1, 1), C, found));
  EXPECT_EQ(found.mean, Eigen::Vector2d(5.0, 5.0));
  C.resize(2, 2);
  C << 1.0, 2.0, 2.0, 4.0;
  EXPECT_FALSE(displacement_of(Vector::Constant(2, 3.0), Matrix::Identity(2, 2), C, found));
  C << 1.0, 0.0, 0.0, 1.0;
  EXPECT_FALSE(displacement_of(Vector::Constant(2, 3.0), -Matrix::Identity(2, 2), C, found)) << "not a covariance";
}

/// Against all unknown displacements that are as probable in every direction, of which the best one counts.
TEST(PastPlaces, OddsAreAgainstTheUnknownDisplacementThatSuitsBest) {
  const Vector jump = Eigen::Vector2d(3.0, -4.0), rest = Eigen::Vector2d(0.1, 0.2);
  Matrix S(2, 2);
  S << 0.04, 0.01, 0.01, 0.09;
  double best = -std::numeric_limits<double>::infinity();
  for (double sigma = 0.1; sigma < 100.0; sigma *= 1.001)
    best = std::max(best, log_density(jump, sigma * sigma * Eigen::Matrix2d::Identity()));
  EXPECT_NEAR(log_odds_of_return(rest, S, jump), log_density(rest, S) - best, 1e-5);
  // One that is known as roughly as it is large is worth little.
  EXPECT_LT(log_odds_of_return(rest, 25.0 * Matrix::Identity(2, 2), jump), 0.5);
}

TEST(PastPlaces, DisplacementsAddUp) {
  PastPlaces places;
  places.leave(1, {.mean = {10.0, 0.0}, .covariance = 0.1 * Eigen::Matrix2d::Identity()}, 0.0);
  places.leave(1, {.mean = {-2.0, 5.0}, .covariance = 0.2 * Eigen::Matrix2d::Identity()}, 10.0);
  ASSERT_EQ(places.count(), 2U);
  EXPECT_EQ(places.sensor(), 1);
  EXPECT_EQ(places.to(1).mean, Eigen::Vector2d(2.0, -5.0));
  EXPECT_EQ(places.to(0).mean, Eigen::Vector2d(-8.0, -5.0));
  EXPECT_NEAR(places.to(0).covariance(0, 0), 0.3, 1e-15);
  EXPECT_NEAR(places.to(1).covariance(1, 1), 0.2, 1e-15);
  // Back at the second place, the first one is as far as it was.
  places.come_back(1);
  ASSERT_EQ(places.count(), 1U);
  EXPECT_EQ(places.to(0).mean, Eigen::Vector2d(-10.0, 0.0));
  places.come_back(0);
  EXPECT_EQ(places.count(), 0U);
}

TEST(PastPlaces, TheLastTwoAreRememberedForSomeTime) {
  PastPlaces places;
  for (int k = 0; k < 3; ++k) places.leave(0, {.mean = {1.0 + k, 0.0}}, 100.0 * k);
  ASSERT_EQ(places.count(), PastPlaces::capacity);
  EXPECT_EQ(places.to(0).mean, Eigen::Vector2d(-5.0, 0.0));
  places.forget_before(100.0 + PastPlaces::longest_memory);
  EXPECT_EQ(places.count(), 2U);
  places.forget_before(101.0 + PastPlaces::longest_memory);
  ASSERT_EQ(places.count(), 1U);
  EXPECT_EQ(places.to(0).mean, Eigen::Vector2d(-3.0, 0.0));
  places.forget_before(std::numeric_limits<double>::quiet_NaN());
  EXPECT_EQ(places.count(), 0U);
}

TEST(PastPlaces, AnotherSensorHasNone) {
  PastPlaces places;
  places.leave(0, {.mean = {1.0, 0.0}}, 0.0);
  places.leave(2, {.mean = {3.0, 0.0}}, 1.0);
  ASSERT_EQ(places.count(), 1U);
  EXPECT_EQ(places.sensor(), 2);
  places.clear();
  EXPECT_EQ(places.count(), 0U);
}

}  // namespace past_places_test
}  // namespace rhec
