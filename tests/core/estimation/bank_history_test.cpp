#include "rhec/core/estimation/bank_history.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "support/bank_case.hpp"
#include "support/turntable.hpp"

namespace rhec {
namespace bank_history_test {

using namespace testing;

BankHistory history_for(const std::shared_ptr<const Model>& model, int nodes, std::vector<RobustLoss> robust = {}) {
  PriorBank::Setup setup = bank_setup(*model, linear_priors());
  setup.memory = 3.0;
  setup.robust = std::move(robust);
  BankHistory history(PriorBank(model, setup), nodes);
  history.bank().reset(initial_mean(*model).head(4), initial_covariance(*model).topLeftCorner(4, 4));
  return history;
}

double difference(BankHistory& a, BankHistory& b) {
  Eigen::VectorXd mean_a, mean_b;
  Eigen::MatrixXd covariance_a, covariance_b;
  a.bank().moments(mean_a, covariance_a);
  b.bank().moments(mean_b, covariance_b);
  double largest =
      std::max((mean_a - mean_b).cwiseAbs().maxCoeff(), (covariance_a - covariance_b).cwiseAbs().maxCoeff());
  for (std::size_t m = 0; m < a.bank().weights().size(); ++m)
    largest = std::max(largest, std::abs(a.bank().weights()[m] - b.bank().weights()[m]));
  return largest;
}

TEST(BankHistory, UsesLateMeasurementsAsIfTheyHadComeInTime) {
  const auto model = linear_model<Hovercraft>();
  const auto samples = simulate(*model, 40, false, 3);
  for (const int late : {0, 1, 4, 9}) {
    BankHistory in_time = history_for(model, 10), too_late = history_for(model, 10);
    const std::vector<double> nothing(3, nan);
    in_time.start(samples[0].outputs.data());
    too_late.start(samples[0].outputs.data());
    for (int k = 1; k <= 40; ++k) {
      const Sample& sample = samples[k];
      in_time.add(sample.duration, sample.inputs.data(), sample.outputs.data());
      too_late.add(sample.duration, sample.inputs.data(), nothing.data());
      ASSERT_TRUE(k <= late || too_late.amend(late, samples[k - late].outputs.data())) << k;
    }
    for (int k = 40 - late + 1; k <= 40; ++k) ASSERT_TRUE(too_late.amend(40 - k, samples[k].outputs.data()));
    EXPECT_LT(difference(in_time, too_late), 1e-12) << late;
  }
}

/// Outputs of motion decide where the interval before them is linearised, and so do late ones.
TEST(BankHistory, LinearisesAnewForLateOutputsOfMotion) {
  const TurntableNoise noise{.gyro = 0.01};
  const auto history = [&] {
    PriorBank::Setup setup;
    setup.members = {{prior("walk", "{sigma: 0.1, along: time}")}, {prior("constant", "{}")}};
    setup.output_variances = {noise.angle * noise.angle, noise.gyro * noise.gyro};
    setup.input_variances = {noise.omega * noise.omega};
    setup.motion_outputs = {1};
    BankHistory made(PriorBank(turntable(), setup), 8);
    made.bank().reset(Eigen::Vector2d::Zero(), Eigen::Matrix2d::Identity());
    return made;
  };
  BankHistory in_time = history(), late = history(), never = history();
  const double nothing[] = {nan, nan};
  for (BankHistory* each : {&in_time, &late, &never}) each->start(nothing);
  double read[2] = {nan, nan};
  for (int k = 1; k <= 30; ++k) {
    const double omega = 0.2 * std::sin(0.4 * k), before = read[1];
    read[1] = 0.15 * std::sin(0.4 * k) + 0.02 * std::cos(7.0 * k);
    in_time.add({.duration = 0.2, .inputs = &omega}, read);
    late.add({.duration = 0.2, .inputs = &omega}, nothing);
    never.add({.duration = 0.2, .inputs = &omega}, nothing);
    const double of_before[] = {nan, before};
    if (k > 1) {
      ASSERT_TRUE(late.amend(1, of_before));
    }
  }
  ASSERT_TRUE(late.amend(0, read));
  EXPECT_LT(difference(in_time, late), 1e-12);
  EXPECT_GT(difference(in_time, never), 1e-3);
}

TEST(BankHistory, ForgetsWhatIsOlderThanItsNodes) {
  const auto model = linear_model<Hovercraft>();
  const auto samples = simulate(*model, 10, false, 3);
  BankHistory history = history_for(model, 4);
  history.start(samples[0].outputs.data(), 7);
  EXPECT_EQ(history.newest(), 7);
  EXPECT_FALSE(history.amend(1, samples[0].outputs.data()));
  for (int k = 1; k <= 10; ++k) history.add(samples[k].duration, samples[k].inputs.data(), samples[k].outputs.data());
  EXPECT_EQ(history.newest(), 17);
  EXPECT_EQ(history.count(), 4);
  EXPECT_TRUE(history.amend(3, samples[7].outputs.data()));
  EXPECT_FALSE(history.amend(4, samples[6].outputs.data()));
  EXPECT_FALSE(history.amend(-1, samples[6].outputs.data()));
  EXPECT_EQ(history.node(17).way.duration, samples[10].duration);
}

/// A robust loss holds a fix back that is far off; the rest goes on as it was.
TEST(BankHistory, BoundsTheInfluenceOfAnOutlier) {
  const auto model = linear_model<Hovercraft>();
  const auto shift_by = [&](double error, std::vector<RobustLoss> robust) {
    BankHistory clean = history_for(model, 4, robust), spoilt = history_for(model, 4, robust);
    auto samples = simulate(*model, 30, false, 3);
    samples[29].outputs = {samples[28].outputs[0], 0.2, 0.1};
    clean.start(samples[0].outputs.data());
    spoilt.start(samples[0].outputs.data());
    for (int k = 1; k <= 29; ++k) {
      clean.add(samples[k].duration, samples[k].inputs.data(), samples[k].outputs.data());
      if (k == 29) samples[k].outputs[0] += error;
      spoilt.add(samples[k].duration, samples[k].inputs.data(), samples[k].outputs.data());
    }
    return difference(clean, spoilt);
  };
  const std::vector<RobustLoss> robust = {{{0}, 3.0}};
  const double quadratic = shift_by(1000.0, {}), bounded = shift_by(1000.0, robust);
  EXPECT_LT(bounded, 0.05 * quadratic);
  // Its influence grows no further with the error.
  EXPECT_LT(shift_by(10000.0, robust), 1.5 * bounded);
}

/// A weight that is next to nothing, given later, makes the node one without that output.
TEST(BankHistory, TakesBetterWeightsOfARobustLoss) {
  const auto model = linear_model<Hovercraft>();
  auto samples = simulate(*model, 30, false, 3);
  samples[25].outputs = {100.0, 0.2, 0.1};
  const std::vector<RobustLoss> robust = {{{0}, 3.0}};
  BankHistory told = history_for(model, 8, robust), without = history_for(model, 8, robust);
  told.start(samples[0].outputs.data());
  without.start(samples[0].outputs.data());
  for (int k = 1; k <= 30; ++k) {
    told.add(samples[k].duration, samples[k].inputs.data(), samples[k].outputs.data());
    std::vector<double> outputs = samples[k].outputs;
    if (k == 25) outputs[0] = nan;
    without.add(samples[k].duration, samples[k].inputs.data(), outputs.data());
  }
  const double before = difference(told, without);
  EXPECT_GT(before, 1e-3);
  const std::vector<double> next_to_nothing = {1e-14, 1.0, 1.0};
  told.reweigh(22, next_to_nothing.data());  // forgotten
  EXPECT_EQ(difference(told, without), before);
  told.reweigh(25, next_to_nothing.data());
  EXPECT_LT(difference(told, without), 1e-9);
  // A late measurement of another node leaves the weights.
  ASSERT_TRUE(told.amend(2, samples[28].outputs.data()) && without.amend(2, samples[28].outputs.data()));
  EXPECT_LT(difference(told, without), 1e-9);
}

}  // namespace bank_history_test
}  // namespace rhec
