// What a bank learns of the noise of its sensors.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <random>
#include <vector>

#include "rhec/core/model/formula_model.hpp"
#include "rhec/core/model/sensor_model.hpp"
#include "support/bank_case.hpp"

namespace rhec {
namespace prior_bank_noise_test {

using namespace testing;

/// Stated three times too large and too small, the noise of a sensor is found within 200 samples; the others keep
/// theirs.
TEST(PriorBank, LearnsTheNoiseOfASensor) {
  const auto model = linear_model<Hovercraft>();
  const auto walk = prior("walk", "{sigma: 0.224, along: time, course: held, mean: 0, mean_sigma: 0.5}");  // 0.1 a step
  const std::vector<PriorCombination> member = {{walk, walk}};
  for (const double wrong : {3.0, 1.0, 1.0 / 3.0}) {
    int close = 0, steady = 0;
    std::vector<double> medians;
    constexpr int seeds = 40;
    for (unsigned seed = 1; seed <= seeds; ++seed) {
      PriorBank::Setup setup = bank_setup(*model, member);
      const std::vector<double> truth = setup.output_variances;
      setup.output_variances[2] *= wrong * wrong;
      setup.adapts_noise = true;
      PriorBank bank(model, setup);
      bank.reset(initial_mean(*model).head(4), initial_covariance(*model).topLeftCorner(4, 4));
      const auto samples = simulate(*model, 200, false, seed);
      bank.update(samples[0].outputs.data());
      for (int k = 1; k <= 200; ++k) {
        bank.predict(samples[k].inputs.data(), samples[k].duration);
        bank.update(samples[k].outputs.data());
      }
      medians.push_back(std::sqrt(bank.noise(2).variance / truth[2]));
      close += std::abs(std::sqrt(bank.noise(2).variance / truth[2]) - 1.0) < 0.2;
      steady += std::abs(std::sqrt(bank.noise(1).variance / truth[1]) - 1.0) < 0.3;
    }
    std::sort(medians.begin(), medians.end());
    EXPECT_GE(close, 0.85 * seeds) << wrong << ", median ratio " << medians[seeds / 2];
    EXPECT_GE(steady, 0.85 * seeds) << wrong;
  }
}

TEST(PriorBank, HoldsTheNoiseOfASensorThatSaysNothingAboutIt) {
  const auto model = linear_model<Hovercraft>();
  PriorBank::Setup setup = bank_setup(*model, {linear_priors()[0]});
  setup.adapts_noise = true;
  // So accurate beside what is predicted that its residual is next to nothing.
  setup.output_variances[2] = 1e-8;
  PriorBank bank(model, setup);
  bank.reset(initial_mean(*model).head(4), initial_covariance(*model).topLeftCorner(4, 4));
  const auto samples = simulate(*model, 300, false, 3);
  for (int k = 1; k <= 300; ++k) {
    bank.predict(samples[k].inputs.data(), samples[k].duration);
    bank.update(samples[k].outputs.data());
  }
  EXPECT_FALSE(bank.noise(2).is_identified);
  EXPECT_NEAR(bank.noise(2).variance, 1e-8, 0.2e-8);
  EXPECT_TRUE(bank.noise(1).is_identified);
  setup.adapts_noise = false;
  EXPECT_EQ(PriorBank(model, setup).noise(0).variance, setup.output_variances[0]);
}

/// One fix in twenty is wrong by thirty standard deviations: with a robust loss it does not pass for noise.
TEST(PriorBank, LearnsTheNoiseBesideOutliers) {
  const auto model = linear_model<Hovercraft>();
  const auto walk = prior("walk", "{sigma: 0.224, along: time, course: held, mean: 0, mean_sigma: 0.5}");
  const auto share_of_close = [&](double delta, bool has_outliers, std::vector<RobustLoss> robust) {
    if (!robust.empty()) robust[0].delta = delta;
    int close = 0;
    constexpr int seeds = 40;
    for (unsigned seed = 1; seed <= seeds; ++seed) {
      PriorBank::Setup setup = bank_setup(*model, {{walk, walk}});
      const double truth = setup.output_variances[2];
      setup.output_variances[2] *= 4.0;
      setup.adapts_noise = true;
      setup.robust = robust;
      PriorBank bank(model, setup);
      bank.reset(initial_mean(*model).head(4), initial_covariance(*model).topLeftCorner(4, 4));
      auto samples = simulate(*model, 300, false, seed);
      bank.update(samples[0].outputs.data());
      for (int k = 1; k <= 300; ++k) {
        if (has_outliers && k % 20 == 0) samples[k].outputs[2] += (k % 40 == 0 ? 30.0 : -30.0) * std::sqrt(truth);
        bank.predict(samples[k].inputs.data(), samples[k].duration);
        bank.update(samples[k].outputs.data());
      }
      close += std::abs(std::sqrt(bank.noise(2).variance / truth) - 1.0) < 0.25;
    }
    return static_cast<double>(close) / seeds;
  };
  const std::vector<RobustLoss> robust = {{{2}, 3.0}};
  EXPECT_GE(share_of_close(3.0, true, robust), 0.85);
  EXPECT_LE(share_of_close(0.0, true, {}), 0.15);
  // Without outliers the loss does not shrink it, however tight it is.
  for (const double delta : {1.0, 2.0, 4.0}) EXPECT_GE(share_of_close(delta, false, robust), 0.85) << delta;
}

/// A cart that a measured speed moves, seen by an exact sensor of its place and by another one with a bias.
template <class Scalar>
struct Cart {
  static constexpr int state_count = 1, input_count = 1, parameter_count = 0, output_count = 2;
  void dynamics(const Scalar*, const Scalar* u, const Scalar*, Scalar* dxdt) const { dxdt[0] = u[0]; }
  void outputs(const Scalar* x, Scalar* y) const { y[0] = y[1] = x[0]; }
};

/// What a constant is known to adds up for ever: a reading that counted for too much, while its noise was learnt from a
/// few of them, would make a bias certain too soon.
TEST(PriorBank, IsHonestOfAConstantWhileNoiseIsLearnt) {
  ModelDescription about;
  about.states.resize(1);
  about.inputs.resize(1);
  about.outputs.resize(2);
  about.states[0].name = "place";
  about.inputs[0].name = "speed";
  about.outputs[0].name = "exact";
  about.outputs[1].name = "biased";
  about.outputs[0].unit = "m";
  const auto model = std::make_shared<SensorModel>(std::make_shared<FormulaModel<Cart>>(Cart<double>{}, about),
                                                   SensorModel::Errors{.biased = {1}, .scaled = {}});
  constexpr double exact = 0.01, noise = 0.1, of_speed = 0.1, of_bias = 1.0;
  constexpr int drives = 1000, samples = 20;
  const Eigen::MatrixXd start = Eigen::Vector2d(exact * exact, of_bias * of_bias).asDiagonal();
  for (const bool adapts : {false, true}) {
    double squares = 0.0;
    for (unsigned seed = 1; seed <= drives; ++seed) {
      std::mt19937_64 random(seed);
      std::normal_distribution<double> normal;
      PriorBank::Setup setup;
      setup.members = {PriorCombination{}};
      setup.output_variances = {exact * exact, noise * noise};
      setup.input_variances = {of_speed * of_speed};
      setup.adapts_noise = adapts;
      PriorBank bank(model, setup);
      bank.reset(Eigen::VectorXd::Zero(2), start);
      double place = exact * normal(random);
      const double bias = of_bias * normal(random), at_rest = 0.0;
      for (int k = 0; k < samples; ++k) {
        const double outputs[] = {place + exact * normal(random), place + bias + noise * normal(random)};
        bank.update(outputs);
        place += of_speed * normal(random);
        bank.predict(&at_rest, 1.0);
      }
      Eigen::VectorXd mean;
      Eigen::MatrixXd covariance;
      bank.moments(mean, covariance);
      squares += (mean[1] - bias) * (mean[1] - bias) / covariance(1, 1) / drives;
    }
    // The mean of 1000 chi-square variables is 1, with the standard deviation 0.045. Where what was learnt counts as if
    // it were known it is 1.8.
    if (adapts)
      EXPECT_LT(squares, 1.4);
    else
      EXPECT_NEAR(squares, 1.0, 3.0 * std::sqrt(2.0 / drives));
  }
}

/// Before anything is learnt a measurement counts by what is stated, then by more than what was learnt, and at last by
/// that.
TEST(PriorBank, CountsMeasurementsByWhatIsNotKnownOfTheirNoise) {
  const auto model = linear_model<Hovercraft>();
  PriorBank::Setup setup = bank_setup(*model, {linear_priors()[0]});
  setup.adapts_noise = true;
  PriorBank bank(model, setup);
  bank.reset(initial_mean(*model).head(4), initial_covariance(*model).topLeftCorner(4, 4));
  EXPECT_EQ(bank.noise(1).counted, setup.output_variances[1]);
  const auto samples = simulate(*model, 300, false, 3);
  double early = 0.0;
  for (int k = 1; k <= 300; ++k) {
    bank.predict(samples[k].inputs.data(), samples[k].duration);
    bank.update(samples[k].outputs.data());
    if (k == 8) early = bank.noise(1).counted / bank.noise(1).variance;
  }
  const double late = bank.noise(1).counted / bank.noise(1).variance;
  EXPECT_GT(early, 1.1);
  EXPECT_LT(late, early);
  EXPECT_LT(late, 1.1);
  std::vector<double> kept(bank.state_size());
  bank.save(kept.data());
  const double counted = bank.noise(1).counted;
  bank.reset(initial_mean(*model).head(4), initial_covariance(*model).topLeftCorner(4, 4));
  bank.restore(kept.data());
  EXPECT_EQ(bank.noise(1).counted, counted);
}

}  // namespace prior_bank_noise_test
}  // namespace rhec
