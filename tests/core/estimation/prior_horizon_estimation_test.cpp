#include "rhec/core/estimation/prior_horizon_estimation.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <limits>

#include "support/bank_case.hpp"
#include "support/error_of.hpp"
#include "support/late_driver.hpp"

namespace rhec {
namespace prior_horizon_estimation_test {

using namespace testing;

constexpr double infinity = std::numeric_limits<double>::infinity();

struct Options {
  double lower = -infinity, upper = infinity;  ///< of every parameter
  std::vector<RobustLoss> robust = {};
  double memory = 3.0;
  std::string solver = "{mode: rti}";
};

PriorHorizonEstimation::Setup setup_for(const Model& model, int horizon, std::vector<PriorCombination> members,
                                        const Options& options) {
  PriorHorizonEstimation::Setup setup;
  const auto nx = model.state_count(), np = model.parameter_count();
  setup.filters.bank = bank_setup(model, std::move(members));
  setup.filters.bank.robust = options.robust;
  setup.filters.bank.memory = options.memory;
  setup.filters.initial_state = initial_mean(model).head(nx);
  setup.filters.initial_covariance = initial_covariance(model).topLeftCorner(nx, nx);
  setup.filters.parameter_lower.assign(np, options.lower);
  setup.filters.parameter_upper.assign(np, options.upper);
  setup.problem = linear_setup(model, horizon, ArrivalKind::ekf, {}).problem;
  setup.problem.parameter_lower = setup.filters.parameter_lower;
  setup.problem.parameter_upper = setup.filters.parameter_upper;
  setup.problem.robust = options.robust;
  return setup;
}

PriorHorizonEstimation estimation_for(const std::shared_ptr<const Model>& model, int horizon,
                                      std::vector<PriorCombination> members, const Options& options = {}) {
  return {model, gn_rti(options.solver), setup_for(*model, horizon, std::move(members), options)};
}

/// Without missing inputs, of which a window knows nothing at all and a filter that they are not enormous.
std::vector<Sample> samples_of(const Model& model, int steps, unsigned seed) {
  auto samples = simulate(model, steps, false, seed);
  for (Sample& sample : samples)
    for (double& input : sample.inputs)
      if (std::isnan(input)) input = 0.0;
  return samples;
}

/// Largest difference of two estimates, in standard deviations.
double difference(const Estimate& a, const Eigen::VectorXd& mean, const Eigen::MatrixXd& covariance) {
  Eigen::VectorXd own(mean.size());
  own << a.state, a.parameters;
  const Eigen::VectorXd sigma = covariance.diagonal().cwiseSqrt();
  const double means = ((own - mean).array() / sigma.array()).abs().maxCoeff();
  const Eigen::MatrixXd scaled =
      ((a.covariance - covariance).array() / (sigma * sigma.transpose()).array()).abs().matrix();
  return std::max(means, scaled.maxCoeff());
}

class OneMember : public ::testing::TestWithParam<int> {};

/// Of a linear problem without bounds the window is the Kalman filter of its prior: at any horizon, growing and
/// sliding, and with parameters that jump.
TEST_P(OneMember, IsTheKalmanFilterOfItsPrior) {
  const auto model = linear_model<Hovercraft>();
  const auto samples = samples_of(*model, 60, 5);
  for (const PriorCombination& member : linear_priors()) {
    PriorHorizonEstimation window = estimation_for(model, GetParam(), {member});
    PriorBank filter(model, bank_setup(*model, {member}));
    filter.reset(initial_mean(*model).head(4), initial_covariance(*model).topLeftCorner(4, 4));
    Estimate estimate = empty_estimate(*model);
    Eigen::VectorXd mean;
    Eigen::MatrixXd covariance;
    for (int k = 0; k <= 60; ++k) {
      if (k == 0) {
        window.start(samples[k].outputs.data());
      } else {
        const MeasuredInterval interval{.duration = samples[k].duration,
                                        .inputs = samples[k].inputs.data(),
                                        .ends_with_jump = k == 20 || k == 21 || k == 50};
        filter.predict(interval);
        window.add(interval, samples[k].outputs.data());
      }
      filter.update(samples[k].outputs.data());
      window.estimate(estimate, Clock::time_point::max());
      filter.moments(mean, covariance);
      ASSERT_FALSE(estimate.fallback);
      ASSERT_LT(difference(estimate, mean, covariance), 1e-9) << "node " << k;
      // Not only the sum, in which the bank's own part cancels.
      ASSERT_EQ(window.window().intervals, std::min(k, GetParam()));
      for (int j = 0; j < 2; ++j)
        ASSERT_NEAR(window.solution().state(
                        window.window().intervals)[window.problem().model().description().parameter_states[j]],
                    mean[4 + j], 1e-9 * std::sqrt(covariance(4 + j, 4 + j)));
    }
  }
}
INSTANTIATE_TEST_SUITE_P(Horizons, OneMember, ::testing::Values(1, 2, 3, 5, 10, 15, 30));

/// Many members: the estimate of a linear problem is that of the bank, whichever law the window follows.
TEST(PriorHorizonEstimation, IsTheBankWithoutBoundsAndCurvature) {
  const auto model = linear_model<Hovercraft>();
  const auto samples = samples_of(*model, 80, 7);
  PriorHorizonEstimation window = estimation_for(model, 6, linear_priors());
  PriorBank::Setup setup = bank_setup(*model, linear_priors());
  setup.memory = 3.0;
  PriorBank bank(model, setup);
  bank.reset(initial_mean(*model).head(4), initial_covariance(*model).topLeftCorner(4, 4));
  Estimate estimate = empty_estimate(*model);
  Eigen::VectorXd mean;
  Eigen::MatrixXd covariance;
  double largest = 0.0;
  for (int k = 0; k <= 80; ++k) {
    if (k == 0) {
      window.start(samples[k].outputs.data());
    } else {
      bank.predict(samples[k].inputs.data(), samples[k].duration);
      window.add_node(samples[k].duration, samples[k].inputs.data(), samples[k].outputs.data());
    }
    bank.update(samples[k].outputs.data());
    window.estimate(estimate, Clock::time_point::max());
    bank.moments(mean, covariance);
    // Members are mixed while the window goes by one law, so that they are not quite the same.
    largest = std::max(largest, difference(estimate, mean, covariance));
    ASSERT_GT(Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(estimate.covariance).eigenvalues()[0], 0.0);
    const auto weights = bank.weights();
    EXPECT_GE(2.0 * weights[window.law()], *std::max_element(weights.begin(), weights.end()));
  }
  EXPECT_LT(largest, 0.5);
}

TEST(PriorHorizonEstimation, UsesLateMeasurementsAsIfTheyHadComeInTime) {
  const auto model = linear_model<Hovercraft>();
  const auto samples = samples_of(*model, 40, 3);
  PriorHorizonEstimation in_time = estimation_for(model, 8, linear_priors()),
                         behind = estimation_for(model, 8, linear_priors());
  LateDriver late(behind);
  const std::vector<double> nothing(3, nan);
  in_time.start(samples[0].outputs.data());
  late.start(samples[0].outputs.data());
  for (int k = 1; k <= 40; ++k) {
    in_time.add_node(samples[k].duration, samples[k].inputs.data(), samples[k].outputs.data());
    late.add_node(samples[k].duration, samples[k].inputs.data(), nothing.data());
    ASSERT_TRUE(k <= 5 || late.amend(5, samples[k - 5].outputs.data()));
  }
  for (int k = 36; k <= 40; ++k) ASSERT_TRUE(late.amend(40 - k, samples[k].outputs.data()));
  EXPECT_FALSE(late.amend(30, samples[10].outputs.data()));
  Estimate a = empty_estimate(*model), b = a;
  in_time.estimate(a, Clock::time_point::max());
  behind.estimate(b, Clock::time_point::max());
  Eigen::VectorXd mean(6);
  mean << b.state, b.parameters;
  EXPECT_LT(difference(a, mean, b.covariance), 1e-9);
}

/// A parameter at its bound: the window knows that it cannot be beyond, at every node; a filter only cuts its estimate.
/// What a window has found to be an outlier does not come back with the arrival cost when its node has left.
TEST(PriorHorizonEstimation, HandsTheWeightsOfARobustLossToTheBank) {
  const auto model = linear_model<Hovercraft>();
  const Options options{.robust = {{{0}, 2.0}}, .solver = "{mode: converge, max_iterations: 30, tolerance: 1.0e-9}"};
  constexpr int horizon = 8, outlier = 20, end = 36;
  double window_shift = 0.0, bank_shift = 0.0;
  for (unsigned seed = 11; seed < 21; ++seed) {
    const auto clean = samples_of(*model, end, seed);
    auto spoilt = clean;
    spoilt[outlier].outputs[0] = clean[outlier].outputs[0] + 2.0;
    const auto arrival_of = [&](const std::vector<Sample>& samples, int asked_from) {
      PriorHorizonEstimation window = estimation_for(model, horizon, {linear_priors()[0]}, options);
      Estimate estimate = empty_estimate(*model);
      Eigen::VectorXd mean(6), sigma(6);
      window.start(samples[0].outputs.data());
      for (int k = 1; k <= end; ++k) {
        window.add_node(samples[k].duration, samples[k].inputs.data(), samples[k].outputs.data());
        if (k >= asked_from) window.estimate(estimate, Clock::time_point::max());
        // The first window that begins after the outlier.
        if (k == outlier + 1 + horizon) window.arrival(mean.data(), sigma.data());
      }
      return mean;
    };
    window_shift += (arrival_of(spoilt, 0) - arrival_of(clean, 0)).cwiseAbs().maxCoeff();
    // Never asked while the outlier was in the window: the bank's own weight stays.
    const int late = outlier + 1 + horizon;
    bank_shift += (arrival_of(spoilt, late) - arrival_of(clean, late)).cwiseAbs().maxCoeff();
  }
  EXPECT_LT(window_shift, 0.75 * bank_shift);
}

TEST(PriorHorizonEstimation, KeepsTheBounds) {
  const auto model = linear_model<Hovercraft>();
  Options options;
  options.lower = 0.9;
  PriorHorizonEstimation window = estimation_for(model, 10, {linear_priors()[0]}, options);
  const auto samples = samples_of(*model, 40, 5);
  Estimate estimate = empty_estimate(*model);
  window.start(samples[0].outputs.data());
  bool active = false;
  for (int k = 1; k <= 40; ++k) {
    window.add_node(samples[k].duration, samples[k].inputs.data(), samples[k].outputs.data());
    window.estimate(estimate, Clock::time_point::max());
    ASSERT_FALSE(estimate.fallback) << k;
    for (int i = 0; i <= window.window().intervals; ++i)
      for (const int entry : window.problem().model().description().parameter_states) {
        ASSERT_GE(window.solution().state(i)[entry], 0.9 - 1e-8);
        active = active || window.solution().state(i)[entry] < 0.9 + 1e-8;
      }
    EXPECT_GE(estimate.parameters.minCoeff(), 0.9);
  }
  EXPECT_TRUE(active) << "else nothing was shown";
}

TEST(PriorHorizonEstimation, StartsAnewAndForgets) {
  const auto model = linear_model<Hovercraft>();
  const auto samples = samples_of(*model, 30, 9);
  PriorHorizonEstimation window = estimation_for(model, 6, linear_priors());
  const auto run = [&] {
    Estimate estimate = empty_estimate(*model);
    window.start(samples[0].outputs.data());
    for (int k = 1; k <= 30; ++k) {
      window.add_node(samples[k].duration, samples[k].inputs.data(), samples[k].outputs.data());
      window.estimate(estimate, Clock::time_point::max());
    }
    return estimate;
  };
  const Estimate first = run(), second = run();
  EXPECT_EQ(first.state, second.state);
  EXPECT_EQ(first.covariance, second.covariance);
}

/// Nodes may come faster than estimates are asked for, even more of them than the horizon holds.
TEST(PriorHorizonEstimation, DoesNotNeedToBeAskedAtEveryNode) {
  const auto model = linear_model<Hovercraft>();
  const auto samples = samples_of(*model, 60, 9);
  for (const int every : {2, 5, 20}) {
    PriorHorizonEstimation often = estimation_for(model, 6, {linear_priors()[1]}),
                           seldom = estimation_for(model, 6, {linear_priors()[1]});
    Estimate a = empty_estimate(*model), b = a;
    often.start(samples[0].outputs.data());
    seldom.start(samples[0].outputs.data());
    for (int k = 1; k <= 60; ++k) {
      for (PriorHorizonEstimation* each : {&often, &seldom})
        each->add_node(samples[k].duration, samples[k].inputs.data(), samples[k].outputs.data());
      often.estimate(a, Clock::time_point::max());
      if (k % every == 0) seldom.estimate(b, Clock::time_point::max());
    }
    Eigen::VectorXd mean(6);
    mean << b.state, b.parameters;
    EXPECT_LT(difference(a, mean, b.covariance), 1e-9) << every;
  }
}

/// A rehearsal changes no bit of what follows, whatever comes next: a node, more of the newest one, or one taken back.
TEST(PriorHorizonEstimation, RehearsesWithoutEffect) {
  const auto model = linear_model<Hovercraft>();
  const auto samples = samples_of(*model, 40, 9);
  PriorHorizonEstimation with = estimation_for(model, 6, linear_priors()),
                         without = estimation_for(model, 6, linear_priors());
  Estimate a = empty_estimate(*model), b = a;
  with.rehearse();
  for (PriorHorizonEstimation* each : {&with, &without}) each->start(samples[0].outputs.data());
  with.rehearse();
  for (int k = 1; k <= 40; ++k) {
    for (PriorHorizonEstimation* each : {&with, &without}) {
      each->add_node(samples[k].duration, samples[k].inputs.data(), samples[k].outputs.data());
      each->estimate(each == &with ? a : b, Clock::time_point::max());
      if (each == &with) each->rehearse();
      if (k % 5 == 0) each->add_node(0.0, samples[k].inputs.data(), samples[k - 1].outputs.data());
      if (k % 7 == 0) each->rewind(1);
      if (k % 5 == 0 || k % 7 == 0) each->estimate(each == &with ? a : b, Clock::time_point::max());
      if (each == &with && k % 3 == 0) each->rehearse();
    }
    ASSERT_EQ(a.state, b.state) << k;
    ASSERT_EQ(a.parameters, b.parameters) << k;
    ASSERT_EQ(a.covariance, b.covariance) << k;
  }
}

TEST(PriorHorizonEstimation, SurvivesMeasurementsThatAreNoNumbers) {
  const auto model = linear_model<Hovercraft>();
  const auto samples = samples_of(*model, 20, 9);
  PriorHorizonEstimation window = estimation_for(model, 5, linear_priors());
  Estimate estimate = empty_estimate(*model);
  const double nothing[] = {nan, nan, nan}, no_input[] = {nan, nan};
  window.start(nothing);
  window.estimate(estimate, Clock::time_point::max());
  for (int k = 1; k <= 20; ++k) {
    window.add_node(samples[k].duration, k % 3 ? samples[k].inputs.data() : no_input,
                    k % 4 ? samples[k].outputs.data() : nothing);
    window.estimate(estimate, Clock::time_point::max());
    ASSERT_TRUE(estimate.state.allFinite() && estimate.parameters.allFinite() && estimate.covariance.allFinite());
    ASSERT_FALSE(estimate.fallback);
  }
  window.add_node(1e300, samples[1].inputs.data(), samples[1].outputs.data());
  window.estimate(estimate, Clock::time_point::max());
  EXPECT_TRUE(estimate.state.allFinite() && estimate.covariance.allFinite());
}

}  // namespace prior_horizon_estimation_test
}  // namespace rhec
