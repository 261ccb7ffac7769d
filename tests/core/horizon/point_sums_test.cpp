#include "core/horizon/point_sums.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

#include <Eigen/Dense>

namespace rhec {
namespace point_sums_test {

using namespace testing;

TEST(PointSums, APolynomialIsWhatItIsAtItsPoints) {
  for (const int points : {3, 5, 9}) {
    const std::vector<double> shares = PointSums::shares(points);
    const auto polynomial = [&](double x) { return std::pow(x - 0.3, points - 1) + 2.0 * x; };
    double parts[padded(PointSums::most_points)];
    for (const double share : {0.0, 0.123, shares[1], 0.5, 1.0}) {
      PointSums::write_parts(shares.data(), points, share, parts);
      double value = 0.0, sum = 0.0;
      for (int k = 0; k < points; ++k) {
        value += parts[k] * polynomial(shares[static_cast<std::size_t>(k)]);
        sum += parts[k];
      }
      EXPECT_NEAR(value, polynomial(share), 1e-13) << points << ", " << share;
      EXPECT_NEAR(sum, 1.0, 1e-14);
    }
  }
}

TEST(PointSums, LiesCloseToAnAnalyticFunction) {
  const std::vector<double> shares = PointSums::shares(5);
  double parts[padded(PointSums::most_points)], largest = 0.0;
  for (double share = 0.0; share <= 1.0; share += 0.01) {
    PointSums::write_parts(shares.data(), 5, share, parts);
    double value = 0.0;
    for (int k = 0; k < 5; ++k) value += parts[k] * std::sin(0.8 * shares[static_cast<std::size_t>(k)]);
    largest = std::max(largest, std::abs(value - std::sin(0.8 * share)));
  }
  // M / (n! 2^(2n-1)) with the fifth derivative's bound M = 0.8^5.
  EXPECT_LE(largest, 1.001 * std::pow(0.8, 5) / (120.0 * 512.0));
}

/// H and h of measurements, row by row and by their sums.
void compare(int measurements, const std::vector<double>& weights_of_outputs) {
  constexpr int points = 5, width = 8;
  const int outputs = static_cast<int>(weights_of_outputs.size());
  std::mt19937 generator(7);
  std::normal_distribution<double> normal;
  const std::vector<double> shares = PointSums::shares(points);
  const std::ptrdiff_t step = 3 + outputs * width;
  std::vector<double> said(static_cast<std::size_t>(points * step));
  for (double& value : said) value = normal(generator);
  const auto gradients = [&](int k, int j) {
    return Eigen::Map<const Eigen::VectorXd>(said.data() + k * step + 3 + j * width, width);
  };
  alignas(64) double memory[2000];
  ASSERT_LE(PointSums::size(outputs, width), std::size(memory));
  PointSums sums(points, outputs, width, memory);
  sums.begin(said.data(), step);
  sums.begin_weights();
  Eigen::MatrixXd H = Eigen::MatrixXd::Zero(width, width), own_H = H;
  Eigen::VectorXd h = Eigen::VectorXd::Zero(width), own_h = h, own_h_alone = h;
  std::vector<double> weights(weights_of_outputs), pulls(weights.size());
  for (int m = 0; m < measurements; ++m) {
    double parts[padded(PointSums::most_points)];
    PointSums::write_parts(shares.data(), points, (m + 0.5) / measurements, parts);
    for (int j = 0; j < outputs; ++j) {
      const auto at = static_cast<std::size_t>(j);
      // The last output is measured twice alone.
      weights[at] = j + 1 == outputs && m > 1 ? 0.0 : weights_of_outputs[at] * (1.0 + 0.1 * m);
      pulls[at] = weights[at] * normal(generator);
      Eigen::VectorXd row = Eigen::VectorXd::Zero(width);
      for (int k = 0; k < points; ++k) row += parts[k] * gradients(k, j);
      H += weights[at] * row * row.transpose();
      h += pulls[at] * row;
    }
    sums.add_pulls(parts, pulls.data());
    sums.add_weights(parts, weights.data());
    double predicted[3], expected = 0.0;
    sums.predict(parts, predicted);
    for (int k = 0; k < points; ++k) expected += parts[k] * said[static_cast<std::size_t>(k * step)];
    EXPECT_NEAR(predicted[0], expected, 1e-13);
  }
  for (int j = 0; j < outputs; ++j) {
    const double* const first = said.data() + 3 + j * width;
    const auto row_of = [&](const PointSums::Rows& rows, int k) {
      return Eigen::Map<const Eigen::VectorXd>(rows.rows + k * width, width);
    };
    const PointSums::Rows alone = sums.rows(j, first, step, nullptr);
    EXPECT_EQ(alone.weights, nullptr);
    for (int k = 0; k < points; ++k) own_h_alone += alone.pulls[k] * row_of(alone, k);
    double room[PointSums::Factors::size];
    const PointSums::Factors factors(room);
    sums.factor(j, factors);
    const PointSums::Rows rows = sums.rows(j, first, step, &factors);
    for (int k = 0; k < points; ++k) {
      EXPECT_GE(rows.weights[k], 0.0);
      own_H += rows.weights[k] * row_of(rows, k) * row_of(rows, k).transpose();
      own_h += rows.pulls[k] * row_of(rows, k);
    }
  }
  EXPECT_LE((own_H - H).cwiseAbs().maxCoeff(), 1e-11 * H.cwiseAbs().maxCoeff());
  EXPECT_LE((own_h - h).cwiseAbs().maxCoeff(), 1e-11 * (1.0 + h.cwiseAbs().maxCoeff()));
  EXPECT_LE((own_h_alone - h).cwiseAbs().maxCoeff(), 1e-11 * (1.0 + h.cwiseAbs().maxCoeff()));
}

TEST(PointSums, AreTheProductsOfAllRows) {
  compare(20, {400.0, 1e4, 30.0});
  compare(5, {1.0, 1e-6});
  compare(300, {1e8, 0.0, 2.0});
}

}  // namespace point_sums_test
}  // namespace rhec
