#include "core/estimation/innovation_whiteness.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include <Eigen/Cholesky>

namespace rhec::innovation_whiteness_test {
namespace {

/// Innovations of two values with a covariance, of which each has this correlation with the one before.
struct Sequence {
  explicit Sequence(unsigned seed, double correlation_, double size_ = 1.0)
      : random(seed), correlation(correlation_), size(size_) {
    innovation.covariance = Eigen::Matrix2d{{4.0, 1.5}, {1.5, 0.9}};
    root = Eigen::Matrix2d(innovation.covariance).llt().matrixL();
  }
  const Innovation& next() {
    const Eigen::Vector2d drawn{normal(random), normal(random)};
    value = correlation * value + std::sqrt(1.0 - correlation * correlation) * drawn;
    innovation.value = size * (root * value);
    return innovation;
  }
  /// Mean of the factor over samples, once some have been seen.
  double factor(InnovationWhiteness& whiteness, int samples, int before = 0) {
    double sum = 0.0;
    for (int k = 0; k < before + samples; ++k) {
      whiteness.take(next(), 2);
      if (k >= before) sum += whiteness.factor();
    }
    return sum / samples;
  }
  std::mt19937 random;
  std::normal_distribution<double> normal;
  double correlation, size;
  Eigen::Vector2d value = Eigen::Vector2d::Zero();
  Eigen::Matrix2d root;
  Innovation innovation;
};

TEST(InnovationWhiteness, OfWhiteInnovationsTheCovarianceStays) {
  double sum = 0.0;
  constexpr int sequences = 40;
  for (unsigned seed = 0; seed < sequences; ++seed) {
    InnovationWhiteness whiteness;
    EXPECT_EQ(whiteness.factor(), 1.0);
    sum += Sequence(seed, 0.0).factor(whiteness, 1000);
  }
  EXPECT_LT(sum / sequences, 1.05);
}

/// The mean of n values with the correlations r^k has the variance (1 + r) / (1 - r) / n.
TEST(InnovationWhiteness, OfCorrelatedOnesItGrowsByWhatTheirMeanKnowsLess) {
  for (const double r : {0.3, 0.6, 0.8}) {
    double sum = 0.0;
    constexpr int sequences = 20;
    for (unsigned seed = 0; seed < sequences; ++seed) {
      InnovationWhiteness whiteness;
      sum += Sequence(seed, r).factor(whiteness, 1000, 500);
    }
    const double exact = (1.0 + r) / (1.0 - r);
    EXPECT_GT(sum / sequences, 0.75 * exact) << r;
    EXPECT_LT(sum / sequences, 1.25 * exact) << r;
  }
}

TEST(InnovationWhiteness, OfAlternatingOnesItStays) {
  InnovationWhiteness whiteness;
  EXPECT_NEAR(Sequence(3, -0.7).factor(whiteness, 1000, 100), 1.0, 0.01);
}

TEST(InnovationWhiteness, LargeOnesCountAsWell) {
  InnovationWhiteness whiteness;
  EXPECT_NEAR(Sequence(4, 0.0, 1.5).factor(whiteness, 1000, 500), 2.25, 0.4);
}

TEST(InnovationWhiteness, WhatLastedIsForgotten) {
  InnovationWhiteness whiteness;
  EXPECT_GT(Sequence(5, 0.8).factor(whiteness, 500, 500), 4.0);
  EXPECT_LT(Sequence(6, 0.0).factor(whiteness, 100, 2000), 1.3);
}

TEST(InnovationWhiteness, ALargeOneThatIsAloneChangesLittle) {
  InnovationWhiteness whiteness;
  Sequence sequence(7, 0.0);
  sequence.factor(whiteness, 500);
  Innovation large = sequence.next();
  large.value *= 1000.0;
  whiteness.take(large, 2);
  EXPECT_LT(whiteness.factor(), 1.3);
}

/// Of white innovations that are off by a constant since some time, or by more and more, sums are larger for that
/// reason only; of correlated ones they are larger whatever is taken out.
TEST(InnovationWhiteness, AConstantIsNoCorrelation) {
  constexpr int sequences = 20, before = 150, count = 120;
  double constant = 0.0, of_late = 0.0, slope = 0.0, correlated = 0.0, correlated_of_late = 0.0;
  for (unsigned seed = 0; seed < sequences; ++seed) {
    InnovationWhiteness always, stepped, sloping, lasting;
    EXPECT_EQ(always.correlation(), 1.0);
    EXPECT_EQ(always.correlation_of_last(100), 1.0);
    Sequence white(seed, 0.0), same(seed, 0.0), once_more(seed, 0.0), coloured(seed, 0.8);
    for (int k = 0; k < before + count; ++k) {
      Innovation off = white.next(), later = same.next(), more = once_more.next();
      off.value += white.root * Eigen::Vector2d(1.0, -0.5);
      if (k >= before) later.value += same.root * Eigen::Vector2d(1.0, 1.0);
      if (k >= before) more.value += (k - before) / 40.0 * (same.root * Eigen::Vector2d(1.0, 0.0));
      always.take(off, 2);
      stepped.take(later, 2);
      sloping.take(more, 2);
      lasting.take(coloured.next(), 2);
    }
    EXPECT_GT(always.factor(), 10.0);
    constant += always.correlation() / sequences;
    of_late += stepped.correlation_of_last(count) / sequences;
    slope += sloping.correlation_of_last(count) / sequences;
    correlated += lasting.correlation() / sequences;
    correlated_of_late += lasting.correlation_of_last(count) / sequences;
  }
  EXPECT_LT(constant, 1.1);
  EXPECT_LT(of_late, 1.1);
  EXPECT_LT(slope, 1.1);
  EXPECT_GT(correlated, 4.0);
  EXPECT_GT(correlated_of_late, 3.0);
}

TEST(InnovationWhiteness, WhatIsNoNumberOrIncompleteSaysNothing) {
  InnovationWhiteness whiteness, other;
  Sequence sequence(8, 0.6), same(8, 0.6);
  for (int k = 0; k < 400; ++k) {
    whiteness.take(sequence.next(), 2);
    other.take(same.next(), 2);
    Innovation part;
    part.value = Innovation::OfSensor<1>::Constant(1, 5.0);
    part.covariance = Innovation::OfSensor<Eigen::Dynamic>::Identity(1, 1);
    other.take(part, 2);
    Innovation none = same.innovation;
    none.value[1] = std::numeric_limits<double>::quiet_NaN();
    other.take(none, 2);
    none = same.innovation;
    none.covariance.setZero();
    other.take(none, 2);
  }
  EXPECT_GT(whiteness.factor(), 1.5);
  EXPECT_EQ(whiteness.factor(), other.factor());
  whiteness.reset();
  EXPECT_EQ(whiteness.factor(), 1.0);
}

}  // namespace
}  // namespace rhec::innovation_whiteness_test
