#include "core/horizon/point_sums.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <vector>

#include <Eigen/Dense>

#include "rhec/core/kernels/kernel_sets.hpp"
#include "rhec/core/kernels/transcription_kernels.hpp"

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
  ASSERT_LE(PointSums::size(outputs), std::size(memory));
  PointSums sums(points, outputs, memory);
  sums.begin(said.data(), step);
  sums.begin_weights();
  Eigen::MatrixXd H = Eigen::MatrixXd::Zero(width, width), own_H = H;
  Eigen::VectorXd h = Eigen::VectorXd::Zero(width), own_h = h;
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
    double room[PointSums::Kept::size];
    const PointSums::Kept kept(room);
    sums.keep_weights(j, kept);
    for (int k = 0; k < points; ++k)
      for (int l = 0; l < points; ++l)
        own_H += kept.weights()[k * PointSums::row + l] * gradients(k, j) * gradients(l, j).transpose();
    for (int k = 0; k < points; ++k) own_h += sums.pulls(j)[k] * gradients(k, j);
    // The same by kernels, for every instruction set that runs here.
    for (const KernelSet& set : runnable_kernels()) {
      Eigen::MatrixXd by_kernel = Eigen::MatrixXd::Zero(width, width);
      Eigen::VectorXd h_by_kernel = Eigen::VectorXd::Zero(width), h_alone = h_by_kernel;
      const SumsView view{said.data() + 3 + j * width, step, points, kept.weights(), PointSums::row, sums.pulls(j)};
      set.transcription->add_sums(view, width - 1, width, by_kernel.data(), h_by_kernel.data());
      set.transcription->add_sums(view, width - 1, width, nullptr, h_alone.data());
      Eigen::MatrixXd expected = Eigen::MatrixXd::Zero(width, width);
      for (int k = 0; k < points; ++k)
        for (int l = 0; l < points; ++l)
          expected += kept.weights()[k * PointSums::row + l] * gradients(k, j) * gradients(l, j).transpose();
      EXPECT_LE((by_kernel - expected).leftCols(width - 1).cwiseAbs().maxCoeff(),
                1e-12 * (1e-300 + expected.cwiseAbs().maxCoeff()));
      EXPECT_EQ(by_kernel.col(width - 1).cwiseAbs().maxCoeff(), 0.0) << "a column that is not there";
      EXPECT_EQ(h_by_kernel, h_alone);
      Eigen::VectorXd expected_h = Eigen::VectorXd::Zero(width);
      for (int k = 0; k < points; ++k) expected_h += sums.pulls(j)[k] * gradients(k, j);
      EXPECT_LE((h_alone - expected_h).cwiseAbs().maxCoeff(), 1e-12 * (1e-300 + expected_h.cwiseAbs().maxCoeff()));
    }
  }
  EXPECT_LE((own_H - H).cwiseAbs().maxCoeff(), 1e-11 * H.cwiseAbs().maxCoeff());
  EXPECT_LE((own_h - h).cwiseAbs().maxCoeff(), 1e-11 * (1.0 + h.cwiseAbs().maxCoeff()));
}

TEST(PointSums, AreTheProductsOfAllRows) {
  compare(20, {400.0, 1e4, 30.0});
  compare(5, {1.0, 1e-6});
  compare(300, {1e8, 0.0, 2.0});
}

/// Cost and pulls of measurements of one output where the model says `said` at the points, one after the other.
struct Quadratic {
  static constexpr int points = 5;
  std::vector<double> shares = PointSums::shares(points), weights, measured;
  double period = 0.0;

  double add_up(const std::vector<double>& said, PointSums& sums, double& largest) const {
    double cost = 0.0;
    largest = 0.0;
    sums.begin(said.data(), 1);
    sums.begin_weights();
    for (std::size_t m = 0; m < measured.size(); ++m) {
      double parts[padded(PointSums::most_points)], predicted;
      PointSums::write_parts(shares.data(), points,
                             (static_cast<double>(m) + 0.5) / static_cast<double>(measured.size()), parts);
      sums.predict(parts, &predicted);
      double residual = predicted - measured[m];
      if (period > 0.0) residual -= period * std::round(residual / period);
      const double weight = weights[m], pull = weight * residual;
      sums.add_pulls(parts, &pull);
      sums.add_weights(parts, &weight);
      cost += 0.5 * weight * residual * residual;
      largest = std::max(largest, std::abs(residual));
    }
    return cost;
  }
};

class KeptSums : public ::testing::Test {
 protected:
  KeptSums() : sums_(Quadratic::points, 1, memory_), again_(Quadratic::points, 1, more_memory_) {
    std::mt19937 generator(3);
    std::normal_distribution<double> normal;
    for (int m = 0; m < 20; ++m) {
      data_.weights.push_back(m == 7 ? 0.0 : 2.0 + 0.1 * m);
      data_.measured.push_back(1000.0 + 0.3 * m + 0.1 * normal(generator));
    }
    for (const double share : data_.shares) said_.push_back(1000.0 + 6.0 * share);
  }
  void keep(const std::vector<double>& said) {
    double largest = 0.0;
    const double cost = data_.add_up(said, sums_, largest);
    sums_.keep(0, cost, largest, kept_);
  }
  bool revise(const std::vector<double>& said) {
    sums_.begin(said.data(), 1);
    return sums_.revise(0, kept_, data_.period, cost_);
  }
  /// Whether the revised sums are those of all measurements.
  void expect_same(const std::vector<double>& said, double tolerance) {
    double largest = 0.0;
    const double cost = data_.add_up(said, again_, largest);
    EXPECT_NEAR(cost_, cost, tolerance * cost);
    double scale = 0.0;
    for (int k = 0; k < Quadratic::points; ++k) scale = std::max(scale, std::abs(again_.pulls(0)[k]));
    for (int k = 0; k < Quadratic::points; ++k) EXPECT_NEAR(sums_.pulls(0)[k], again_.pulls(0)[k], tolerance * scale);
  }

  alignas(64) double memory_[500], more_memory_[500], room_[PointSums::Kept::size];
  Quadratic data_;
  PointSums sums_, again_;
  PointSums::Kept kept_{room_};
  std::vector<double> said_;
  double cost_ = 0.0;
};

TEST_F(KeptSums, AreThoseOfAllMeasurementsWhateverTheModelSays) {
  keep(said_);
  std::mt19937 generator(5);
  std::normal_distribution<double> normal;
  for (const double size : {0.0, 1e-6, 0.01, 1.0, 100.0}) {
    std::vector<double> said = said_;
    for (double& value : said) value += size * normal(generator);
    ASSERT_TRUE(revise(said)) << size;
    expect_same(said, 1e-9);
  }
}

TEST_F(KeptSums, AreFormedAnewWhereRoundingMatters) {
  std::vector<double> far = said_;
  for (double& value : far) value += 1e4;
  keep(far);
  EXPECT_FALSE(revise(said_));
  for (double& value : far) value += 10.0;
  EXPECT_TRUE(revise(far));
  said_[2] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(revise(said_));
}

TEST_F(KeptSums, KnowHowFarAnAngleMayTurn) {
  data_.period = 2.0 * std::numbers::pi;
  data_.measured.assign(data_.measured.size(), 3.1);
  std::vector<double> said(Quadratic::points, -3.1);
  keep(said);
  for (const double turn : {0.1, 0.5, 1.2}) {
    std::vector<double> turned = said;
    for (double& value : turned) value += turn;
    ASSERT_TRUE(revise(turned)) << turn;
    expect_same(turned, 1e-9);
  }
  for (double& value : said) value += 2.9;
  EXPECT_FALSE(revise(said)) << "the nearest turn is another one for some, perhaps";
}

}  // namespace point_sums_test
}  // namespace rhec
