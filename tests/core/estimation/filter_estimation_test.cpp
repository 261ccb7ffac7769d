#include "rhec/core/estimation/filter_estimation.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "rhec/core/base/angle.hpp"
#include "rhec/core/base/error.hpp"
#include "rhec/core/estimation/estimator.hpp"
#include "rhec/core/estimation/prior_bank.hpp"
#include "rhec/core/model/formula_model.hpp"
#include "rhec/core/model/sensor_model.hpp"
#include "rhec/core/model/state_noise_model.hpp"
#include "support/late_driver.hpp"
#include "support/linear_case.hpp"

namespace rhec {
namespace filter_estimation_test {

using namespace testing;

FilterEstimation::Setup bicycle_setup(double heading, double sigma, int starts) {
  FilterEstimation::Setup setup;
  setup.noise = {{0.0025, 0.0025, 1e-4}, {4e-4, 1e-4}, {0.0, 0.0}, {1.0, 1.0}};
  setup.walk = {0.01, 0.01};
  setup.initial_mean = Eigen::VectorXd::Zero(6);
  setup.initial_mean << 0.0, 0.0, heading, 0.0, 0.8, 0.8;
  setup.initial_covariance = Eigen::MatrixXd::Identity(6, 6) * 0.01;
  setup.initial_covariance(2, 2) = sigma * sigma;
  setup.heading_starts = starts;
  return setup;
}

/// Drives straight in a direction; returns the error of the estimated heading after a number of samples.
double heading_error(FilterEstimation& filter, double direction, int steps) {
  const std::vector<double> inputs = {2.0, 0.0};
  const auto outputs = [&](int k) {
    return std::vector<double>{0.32 * k * std::cos(direction) + 0.01 * std::sin(7.0 * k),
                               0.32 * k * std::sin(direction) + 0.01 * std::cos(5.0 * k), 0.0};
  };
  filter.start(outputs(0).data());
  for (int k = 1; k <= steps; ++k) filter.add_node(0.2, inputs.data(), outputs(k).data());
  Estimate estimate = empty_estimate(filter.model());
  filter.estimate(estimate, Clock::time_point::max());
  EXPECT_FALSE(estimate.fallback);
  EXPECT_EQ(estimate.report.status, Status::solved);
  EXPECT_TRUE(estimate.covariance.allFinite());
  return std::abs(angle_difference(estimate.state[2], direction));
}

TEST(FilterEstimation, FindsAHeadingByABankOfStarts) {
  const std::shared_ptr<const Model> model = host().make_model("bicycle_slip");
  for (const double direction : {0.1, 1.5, 3.0, -2.0}) {
    FilterEstimation bank(model, bicycle_setup(0.0, 2.0, 12));
    EXPECT_LT(heading_error(bank, direction, 40), 0.05) << direction;
    EXPECT_LT(heading_error(bank, direction + 2.0, 40), 0.05) << "it starts anew";
  }
}

TEST(FilterEstimation, TrustsTheInitialHeadingWithOneStart) {
  const std::shared_ptr<const Model> model = host().make_model("bicycle_slip");
  FilterEstimation one(model, bicycle_setup(1.5, 0.2, 1));
  EXPECT_LT(heading_error(one, 1.6, 40), 0.05);
}

/// What was known of the parameters ends where they jump; what is known of the vehicle does not.
TEST(FilterEstimation, KnowsNothingOfParametersThatHaveJumped) {
  const std::shared_ptr<const Model> model = host().make_model("bicycle_slip");
  const FilterEstimation::Setup setup = bicycle_setup(0.0, 0.05, 1);
  FilterEstimation filter(model, setup);
  filter.reset();
  const double inputs[] = {2.0, 0.0}, nothing[] = {nan, nan, nan};
  Estimate before = empty_estimate(*model), after = before;
  filter.start(std::vector{0.0, 0.0, 0.0}.data());
  for (int k = 1; k <= 20; ++k) filter.add_node(0.2, inputs, std::vector{0.32 * k, 0.0, 0.0}.data());
  filter.add({.duration = 0.2, .inputs = inputs}, nothing);
  filter.estimate(before, Clock::time_point::max());
  filter.rewind(1);
  filter.add({.duration = 0.2, .inputs = inputs, .ends_with_jump = true}, nothing);
  filter.estimate(after, Clock::time_point::max());
  ASSERT_LT(before.covariance(4, 4), 0.5 * setup.initial_covariance(4, 4));
  for (int j = 4; j < 6; ++j) {
    EXPECT_EQ(after.covariance(j, j), setup.initial_covariance(j, j));
    EXPECT_EQ(after.covariance.col(j).head(4).norm(), 0.0);
  }
  EXPECT_EQ(after.parameters, before.parameters);
  EXPECT_EQ(after.state, before.state);
  EXPECT_EQ(after.covariance.topLeftCorner(4, 4), before.covariance.topLeftCorner(4, 4));
}

TEST(FilterEstimation, TakesLateOutputsAtTheNodesThatItRemembers) {
  const auto model = linear_model<Trolley>();
  const auto samples = simulate(*model, 5, true, 4);
  FilterEstimation::Setup setup;
  const testing::Noise noise = noise_of(*model);
  for (const double sigma : noise.outputs) setup.noise.output_variances.push_back(sigma * sigma);
  for (const double sigma : noise.inputs) setup.noise.input_variances.push_back(sigma * sigma);
  setup.initial_mean = initial_mean(*model);
  setup.initial_covariance = initial_covariance(*model);
  setup.remembered_nodes = 2;
  FilterEstimation at_once(model, setup), in_parts(model, setup);
  LateDriver late(in_parts);
  Estimate expected = empty_estimate(*model), found = expected;
  const double both[] = {0.4, 0.3}, first[] = {0.4, nan}, second[] = {nan, 0.3}, nothing[] = {nan, nan};
  at_once.start(nothing);
  at_once.add_node(0.2, samples[1].inputs.data(), both);
  at_once.estimate(expected, Clock::time_point::max());
  late.start(nothing);
  late.add_node(0.2, samples[1].inputs.data(), first);
  EXPECT_TRUE(late.amend(0, second));
  in_parts.estimate(found, Clock::time_point::max());
  EXPECT_EQ(found.state, expected.state);
  EXPECT_EQ(found.covariance, expected.covariance);
  for (int k = 2; k <= 4; ++k) {
    at_once.add_node(0.2, samples[k].inputs.data(), both);
    late.add_node(0.2, samples[k].inputs.data(), k == 3 ? first : both);
  }
  EXPECT_TRUE(late.amend(1, second));
  EXPECT_FALSE(late.amend(2, second)) << "the node before it is forgotten";
  at_once.estimate(expected, Clock::time_point::max());
  in_parts.estimate(found, Clock::time_point::max());
  EXPECT_EQ(found.state, expected.state);
  EXPECT_EQ(found.covariance, expected.covariance);
}

TEST(FilterEstimation, RefusesASetUpThatDoesNotFit) {
  const std::shared_ptr<const Model> model = host().make_model("bicycle_slip");
  FilterEstimation::Setup setup = bicycle_setup(0.0, 0.1, 1);
  setup.walk = {0.01};
  EXPECT_THROW(FilterEstimation(model, setup), Error);
  setup = bicycle_setup(0.0, 0.1, 1);
  setup.initial_mean = Eigen::VectorXd::Zero(4);
  EXPECT_THROW(FilterEstimation(model, setup), Error);
  setup = bicycle_setup(0.0, 0.1, 1);
  setup.initial_covariance = Eigen::MatrixXd::Identity(6, 4);
  EXPECT_THROW(FilterEstimation(model, setup), Error);
}

/// A trolley whose position and acceleration are measured.
template <class Scalar>
struct SensingTrolley {
  static constexpr int state_count = 2, input_count = 1, parameter_count = 0, output_count = 2;
  void dynamics(const Scalar* x, const Scalar* u, const Scalar*, Scalar* dxdt) const {
    dxdt[0] = x[1];
    dxdt[1] = u[0] - 0.4 * x[0] - 0.2 * x[1];
  }
  void outputs(const Scalar* x, const Scalar* u, const Scalar*, Scalar* y) const {
    y[0] = x[0];
    y[1] = u[0] - 0.4 * x[0] - 0.2 * x[1];
  }
};

/// The filter on [x; bias; input before the node], written by hand: the accelerometer sees input and state together.
struct BiasFilter {
  Eigen::Vector4d mean{0.0, 0.0, 0.0, 0.0};
  Eigen::Matrix4d covariance = Eigen::Vector4d(1.0, 1.0, 0.25, 0.0).asDiagonal();
  void predict(const Model& trolley, double duration, double input, double input_sigma, double drift) {
    const double zero[] = {0.0, 0.0};
    double J[6];
    trolley.integrate(
        {.count = 1, .states = zero, .inputs = zero, .parameters = zero, .durations = &duration, .jacobians = J});
    Eigen::Matrix4d A = Eigen::Matrix4d::Zero();
    A.topLeftCorner<2, 2>() = Eigen::Map<const Eigen::Matrix2d>(J);
    A(2, 2) = 1.0;
    const Eigen::Vector4d B(J[4], J[5], 0.0, 1.0);
    mean = (A * mean + B * input).eval();
    covariance = (A * covariance * A.transpose() + input_sigma * input_sigma * B * B.transpose()).eval();
    covariance(2, 2) += drift * drift * duration;
  }
  void update(const Eigen::RowVector4d& H, double measured, double sigma) {
    const double variance = H * covariance * H.transpose() + sigma * sigma;
    const Eigen::Vector4d gain = covariance * H.transpose() / variance;
    mean += gain * (measured - H * mean);
    covariance = (covariance - gain * H * covariance).eval();
  }
};

/// The same filter without the input as a state: what disturbs the motion, B n, and what disturbs the accelerometer, n
/// + v, are correlated (Bar-Shalom, Li & Kirubarajan 2001, section 8.3).
struct CorrelatedFilter {
  Eigen::Vector3d mean{0.0, 0.0, 0.0};
  Eigen::Matrix3d covariance = Eigen::Vector3d(1.0, 1.0, 0.25).asDiagonal();
  /// To the next node, and its outputs, NaN where one is missing.
  void advance(const Model& trolley, double duration, double input, const double* outputs, double input_sigma,
               double drift, const Eigen::Vector2d& sigmas) {
    const double zero[] = {0.0, 0.0};
    double J[6];
    trolley.integrate(
        {.count = 1, .states = zero, .inputs = zero, .parameters = zero, .durations = &duration, .jacobians = J});
    Eigen::Matrix3d A = Eigen::Matrix3d::Identity();
    A.topLeftCorner<2, 2>() = Eigen::Map<const Eigen::Matrix2d>(J);
    const Eigen::Vector3d B(J[4], J[5], 0.0);
    const double Q = input_sigma * input_sigma;
    mean = (A * mean + B * input).eval();
    covariance = (A * covariance * A.transpose() + Q * B * B.transpose()).eval();
    covariance(2, 2) += drift * drift * duration;
    const int count = std::isnan(outputs[1]) ? 1 : 2;
    Eigen::Matrix<double, 2, 3> H;
    H << 1.0, 0.0, 0.0, -0.4, -0.2, 1.0;
    const Eigen::Vector2d D(0.0, 1.0);
    const Eigen::MatrixXd h = H.topRows(count), d = D.head(count),
                          shared = covariance * h.transpose() + Q * B * d.transpose();
    Eigen::MatrixXd S = h * shared + Q * d * (B.transpose() * h.transpose()) + Q * d * d.transpose();
    S.diagonal() += sigmas.head(count).cwiseAbs2();
    const Eigen::MatrixXd gain = shared * S.inverse();
    mean += gain * (Eigen::Map<const Eigen::VectorXd>(outputs, count) - h * mean - d * input);
    covariance = (covariance - gain * S * gain.transpose()).eval();
  }
};

TEST(FilterEstimation, FindsABiasThatDriftsAsTheFilterByHandDoes) {
  ModelDescription about;
  about.states.resize(2);
  about.inputs.resize(1);
  about.outputs.resize(2);
  about.states[0].name = "x";
  about.states[1].name = "v";
  about.inputs[0].name = "u";
  about.outputs[0].name = "position";
  about.outputs[1].name = "acceleration";
  const auto trolley = std::make_shared<FormulaModel<SensingTrolley>>(SensingTrolley<double>{}, about);
  EXPECT_THROW(KalmanFilter(trolley, {{1.0, 1.0}, {1.0}, {}, {}}, 1), Error) << "an output depends on the input";
  const auto sensors = std::make_shared<SensorModel>(trolley, SensorModel::Errors{.biased = {1}, .scaled = {}});
  const auto model = std::make_shared<StateNoiseModel>(sensors, std::vector{2});
  constexpr double drift = 0.05, of_input = 0.3, of_position = 0.05, of_acceleration = 0.1;
  const Eigen::VectorXd mean = Eigen::VectorXd::Zero(4);
  const Eigen::MatrixXd covariance = Eigen::Vector4d(1.0, 1.0, 0.25, 9.0).asDiagonal();

  FilterEstimation::Setup of_filter;
  of_filter.noise = {{of_position * of_position, of_acceleration * of_acceleration},
                     {of_input * of_input, drift * drift},
                     {},
                     {},
                     {1}};
  of_filter.initial_mean = mean;
  of_filter.initial_covariance = covariance;
  FilterEstimation filter(model, of_filter);
  RecedingHorizonEstimation::Setup of_window;
  of_window.problem.max_intervals = 6;
  of_window.problem.output_weights = {1.0 / (of_position * of_position), 1.0 / (of_acceleration * of_acceleration)};
  of_window.problem.input_weights = {1.0 / (of_input * of_input), 1.0 / (drift * drift)};
  of_window.initial_mean = mean;
  of_window.initial_covariance = covariance;
  RecedingHorizonEstimation window(model, gn_rti(), of_window);

  PriorBank::Setup of_bank;
  of_bank.members = {PriorCombination{}};
  of_bank.output_variances = of_filter.noise.output_variances;
  of_bank.input_variances = of_filter.noise.input_variances;
  of_bank.motion_outputs = {1};
  of_bank.adapts_noise = false;
  PriorBank bank(model, of_bank);
  bank.reset(mean, covariance);
  Eigen::VectorXd bank_mean;
  Eigen::MatrixXd bank_covariance;

  BiasFilter by_hand;
  CorrelatedFilter correlated;
  Estimate of_both[] = {empty_estimate(*model), empty_estimate(*model)};
  const double first[] = {0.1, nan};
  filter.start(first);
  window.start(first);
  bank.update(first);
  by_hand.update({1.0, 0.0, 0.0, 0.0}, 0.1, of_position);
  correlated.mean = by_hand.mean.head(3);
  correlated.covariance = by_hand.covariance.topLeftCorner(3, 3);
  for (int k = 1; k <= 40; ++k) {
    const double duration = 0.1 + 0.02 * (k % 5), inputs[] = {std::sin(0.4 * k), 0.0},
                 outputs[] = {0.3 * std::sin(0.2 * k), k % 7 == 3 ? nan : 0.4 + 0.2 * std::cos(0.3 * k)};
    filter.add_node(duration, inputs, outputs);
    window.add_node(duration, inputs, outputs);
    by_hand.predict(*trolley, duration, inputs[0], of_input, drift);
    by_hand.update({1.0, 0.0, 0.0, 0.0}, outputs[0], of_position);
    if (!std::isnan(outputs[1])) by_hand.update({-0.4, -0.2, 1.0, 1.0}, outputs[1], of_acceleration);
    bank.predict({.duration = duration, .inputs = inputs}, outputs);
    bank.update(outputs);
    bank.moments(bank_mean, bank_covariance);
    correlated.advance(*trolley, duration, inputs[0], outputs, of_input, drift, {of_position, of_acceleration});
    EXPECT_LT((correlated.mean - by_hand.mean.head(3)).cwiseAbs().maxCoeff(), 1e-9) << k;
    EXPECT_LT((correlated.covariance - by_hand.covariance.topLeftCorner(3, 3)).cwiseAbs().maxCoeff(), 1e-9) << k;
    EXPECT_LT((bank_mean.head(3) - correlated.mean).cwiseAbs().maxCoeff(), 1e-9) << k;
    EXPECT_LT((bank_covariance.topLeftCorner(3, 3) - correlated.covariance).cwiseAbs().maxCoeff(), 1e-9) << k;
    filter.estimate(of_both[0], Clock::time_point::max());
    window.estimate(of_both[1], Clock::time_point::max());
    for (const Estimate& estimate : of_both) {
      EXPECT_LT((estimate.state.head(3) - by_hand.mean.head(3)).cwiseAbs().maxCoeff(), 1e-9) << k;
      EXPECT_LT(
          (estimate.covariance.topLeftCorner(3, 3) - by_hand.covariance.topLeftCorner(3, 3)).cwiseAbs().maxCoeff(),
          1e-9)
          << k;
    }
  }
}

}  // namespace filter_estimation_test
}  // namespace rhec
