#include "rhec/core/estimation/banked_covariance.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>

#include "rhec/core/estimation/receding_horizon_estimation.hpp"
#include "support/bank_case.hpp"
#include "support/late_driver.hpp"

namespace rhec {
namespace banked_covariance_test {

using namespace testing;

BankEstimation::Setup bank_of(const Model& model) {
  const int nx = model.state_count(), np = model.parameter_count();
  BankEstimation::Setup setup;
  setup.bank = bank_setup(model, {{prior("walk", "{sigma: 0.1, along: time, mean: 1, mean_sigma: 1}")}});
  setup.initial_state = initial_mean(model).head(nx);
  setup.initial_covariance = initial_covariance(model).topLeftCorner(nx, nx);
  setup.parameter_lower.assign(np, -HUGE_VAL);
  setup.parameter_upper.assign(np, HUGE_VAL);
  return setup;
}

std::unique_ptr<RecedingHorizonEstimation> one_block(const std::shared_ptr<const Model>& model, int horizon) {
  return std::make_unique<RecedingHorizonEstimation>(
      model, gn_rti(), linear_setup(*model, horizon, ArrivalKind::ekf, {blocking("full_horizon")}));
}

/// A parameter that walks, and a window that takes it for a constant: with the bank beside it the covariance is that of
/// the bank and the difference of the two, the estimate stays what it was, and the errors are as large as they are said
/// to be. The block model believes itself far better.
TEST(BankedCovariance, HoldsWhereABlockDoesNot) {
  const auto model = linear_model<Boat>();
  double own_nees = 0.0;
  int count = 0;
  for (unsigned seed = 1; seed <= 40; ++seed) {
    const auto samples = simulate(*model, 80, true, seed);
    BankedCovariance banked(one_block(model, 12), bank_of(*model));
    auto blocks = one_block(model, 12);
    BankEstimation bank(model, bank_of(*model));
    Estimate estimate = empty_estimate(*model), alone = estimate, of_bank = estimate;
    for (EstimationMethod* method :
         {static_cast<EstimationMethod*>(&banked), static_cast<EstimationMethod*>(blocks.get()),
          static_cast<EstimationMethod*>(&bank)})
      method->start(samples[0].outputs.data());
    for (int k = 1; k <= 80; ++k) {
      const Sample& sample = samples[k];
      banked.add_node(sample.duration, sample.inputs.data(), sample.outputs.data());
      blocks->add_node(sample.duration, sample.inputs.data(), sample.outputs.data());
      bank.add_node(sample.duration, sample.inputs.data(), sample.outputs.data());
      banked.estimate(estimate, Clock::time_point::max());
      blocks->estimate(alone, Clock::time_point::max());
      bank.estimate(of_bank, Clock::time_point::max());
      ASSERT_EQ(estimate.state, alone.state);
      ASSERT_EQ(estimate.parameters, alone.parameters);
      ASSERT_EQ(*banked.own_covariance(), alone.covariance);
      Eigen::VectorXd d(4);
      d << estimate.state - of_bank.state, estimate.parameters - of_bank.parameters;
      ASSERT_LT((estimate.covariance - of_bank.covariance - d * d.transpose()).cwiseAbs().maxCoeff(), 1e-12);
      // The error's second moment is that of the filter with the true law, and d d'.
      own_nees += d.dot(alone.covariance.ldlt().solve(d)) + (alone.covariance.ldlt().solve(of_bank.covariance)).trace();
      ++count;
    }
  }
  EXPECT_GT(own_nees / count, 8.0) << "4 would be expected";
}

TEST(BankedCovariance, TakesLateMeasurementsAndStartsAnew) {
  const auto model = linear_model<Boat>();
  const auto samples = simulate(*model, 30, true, 3);
  BankedCovariance banked(one_block(model, 8), bank_of(*model));
  const auto run = [&] {
    Estimate estimate = empty_estimate(*model);
    LateDriver late(banked);
    late.start(samples[0].outputs.data());
    const double nothing[] = {nan, nan};
    for (int k = 1; k <= 30; ++k) {
      late.add_node(samples[k].duration, samples[k].inputs.data(), nothing);
      EXPECT_TRUE(k <= 3 || late.amend(3, samples[k - 3].outputs.data()));
      banked.estimate(estimate, Clock::time_point::max());
    }
    EXPECT_FALSE(late.amend(20, samples[10].outputs.data()));
    return estimate;
  };
  const Estimate first = run(), second = run();
  EXPECT_EQ(first.covariance, second.covariance);
  EXPECT_TRUE(banked.has_window());
  EXPECT_EQ(banked.window().intervals, 8);
}

}  // namespace banked_covariance_test
}  // namespace rhec
