// A PriorBank of whose inputs not all are measured.
#include <gtest/gtest.h>

#include <limits>
#include <vector>

#include "rhec/core/estimation/kalman_filter.hpp"
#include "rhec/core/estimation/prior_bank.hpp"
#include "support/bank_case.hpp"
#include "support/largest.hpp"
#include "support/linear_case.hpp"

namespace rhec {
namespace prior_bank_inputs_test {

using namespace testing;

TEST(PriorBank, GuessesInputsAsAKalmanFilterDoes) {
  const auto model = linear_model<Hovercraft>();
  constexpr double sigma = 0.1;
  const auto walk = prior("walk", "{sigma: 0.1, along: time, course: ramp}");
  PriorBank::Setup setup = bank_setup(*model, {{walk, walk}});
  setup.most_between = 2;
  PriorBank bank(model, setup);
  const double infinity = std::numeric_limits<double>::infinity();
  KalmanFilter filter(
      model, {setup.output_variances, setup.input_variances, {-infinity, -infinity}, {infinity, infinity}}, 1, 2);
  bank.reset(initial_mean(*model).head(4), initial_covariance(*model).topLeftCorner(4, 4));
  Eigen::VectorXd mean;
  Eigen::MatrixXd covariance;
  bank.moments(mean, covariance);
  filter.mean = mean;
  filter.covariance = covariance;
  const auto samples = simulate(*model, 60, false, 5);
  for (int k = 1; k <= 60; ++k) {
    std::vector<double> inputs = samples[k].inputs;
    if (k > 10) inputs[0] = nan;
    if (k > 30) inputs[1] = nan;
    const double duration = samples[k].duration, ramp = sigma * sigma * duration, ramps[] = {ramp, ramp},
                 times[] = {0.3 * duration, 0.6 * duration};
    const double* const y = samples[k].outputs.data();
    const double between[] = {y[0], nan, nan, nan, y[1], nan};
    const MeasuredInterval interval{
        .duration = duration, .inputs = inputs.data(), .between = k % 3, .times = times, .outputs = between};
    bank.predict(interval);
    filter.predict(interval, nullptr, ramps);
    bank.update(y);
    filter.update(y);
    bank.moments(mean, covariance);
    ASSERT_LT(largest(mean - filter.mean), 1e-9) << k;
    ASSERT_LT(largest(covariance - filter.covariance), 1e-9 * (1.0 + largest(covariance))) << k;
  }
}

/// A bank that goes back to where it had not been updated yet learns of inputs from the update as it did before.
TEST(PriorBank, LearnsOfInputsAgainWhereItGoesBack) {
  const auto model = linear_model<Hovercraft>();
  PriorBank bank(model, bank_setup(*model, linear_priors()));
  bank.reset(initial_mean(*model).head(4), initial_covariance(*model).topLeftCorner(4, 4));
  const auto samples = simulate(*model, 20, false, 5);
  std::vector<double> saved(bank.state_size());
  Eigen::VectorXd mean[2];
  Eigen::MatrixXd covariance[2];
  const double missing[] = {nan, nan}, late[] = {nan, 0.3, nan};
  for (int k = 1; k <= 20; ++k) {
    bank.predict(missing, samples[k].duration);
    bank.save(saved.data());
    for (int pass = 0; pass < 2; ++pass) {
      if (pass == 1) bank.restore(saved.data());
      bank.update(samples[k].outputs.data());
      bank.update(late);
      std::vector<double> here(bank.state_size());
      bank.save(here.data());
      bank.predict(missing, 0.4);
      bank.moments(mean[pass], covariance[pass]);
      bank.restore(here.data());
    }
    ASSERT_LT(largest(mean[1] - mean[0]), 1e-12) << k;
    ASSERT_LT(largest(covariance[1] - covariance[0]), 1e-12) << k;
  }
}

}  // namespace prior_bank_inputs_test
}  // namespace rhec
