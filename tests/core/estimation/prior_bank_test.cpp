#include "rhec/core/estimation/prior_bank.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <vector>

#include "rhec/core/base/error.hpp"
#include "rhec/core/estimation/kalman_filter.hpp"
#include "rhec/core/model/formula_model.hpp"
#include "rhec/core/prior/standard_bank.hpp"
#include "support/bank_case.hpp"
#include "support/error_of.hpp"
#include "support/turntable.hpp"

namespace rhec {
namespace prior_bank_test {

using namespace testing;

double largest(const Eigen::MatrixXd& matrix) { return matrix.cwiseAbs().maxCoeff(); }

/// The textbook's Kalman filter on [x; z; u] of a linear model and one prior a parameter, with the inputs u that are
/// missing and walk. Its matrices are differences of the model's own results.
class DenseFilter {
 public:
  DenseFilter(const Model& model, PriorCombination priors)
      : model_(model), priors_(std::move(priors)), nx_(model.state_count()), np_(model.parameter_count()) {
    n_ = nx_;
    for (const auto& each : priors_) {
      first_.push_back(n_);
      n_ += each->state_count();
    }
    mean = Eigen::VectorXd::Zero(n_);
    covariance = Eigen::MatrixXd::Zero(n_, n_);
    inputs_ = Eigen::VectorXd::Zero(model.input_count());
    of_inputs_ = Eigen::MatrixXd::Zero(model.input_count(), model.input_count());
    with_inputs_ = Eigen::MatrixXd::Zero(n_, model.input_count());
    for (int j = 0; j < model.input_count(); ++j) {
      of_inputs_(j, j) = most_variance(j);
      walks_.emplace_back(model.description().inputs[j]);
    }
    for (int j = 0; j < np_; ++j) {
      const int count = priors_[j]->state_count();
      Eigen::MatrixXd P(count, count);
      priors_[j]->start(mean.data() + first_[j], P.data());
      covariance.block(first_[j], first_[j], count, count) = P;
    }
  }

  void predict(const Sample& sample, const std::vector<double>& input_variances, bool ends_with_jump = false) {
    const int nu = model_.input_count();
    for (int j = 0; j < nu; ++j) {
      walks_[j].see(sample.inputs[j], sample.duration);
      const double walk = walks_[j].growth(sample.duration);
      if (std::isnan(sample.inputs[j])) {
        of_inputs_(j, j) = std::max(of_inputs_(j, j), std::min(of_inputs_(j, j) + walk, most_variance(j)));
        continue;
      }
      of_inputs_.row(j).setZero();
      of_inputs_.col(j).setZero();
      with_inputs_.col(j).setZero();
      inputs_[j] = sample.inputs[j];
      of_inputs_(j, j) = input_variances[j];
    }
    const std::vector<double> input(inputs_.begin(), inputs_.end());
    Eigen::MatrixXd F = Eigen::MatrixXd::Zero(n_, n_), Q = F;
    for (int j = 0; j < np_; ++j) {
      const int count = priors_[j]->state_count();
      Eigen::MatrixXd block(count, count), noise(count, count);
      priors_[j]->advance(sample.duration, block.data(), noise.data());
      if (ends_with_jump) {
        Eigen::VectorXd start(count);
        Eigen::MatrixXd P(count, count);
        priors_[j]->start(start.data(), P.data());
        noise(0, 0) += P(0, 0);
      }
      F.block(first_[j], first_[j], count, count) = block;
      Q.block(first_[j], first_[j], count, count) = noise;
    }
    // [x; z] -> next, as a function of the noise w of z, and of the inputs.
    const auto next = [&](const Eigen::VectorXd& from, const Eigen::VectorXd& w, const std::vector<double>& u) {
      Eigen::VectorXd to = F * from + w, x(nx_), p(np_), end(np_);
      for (int j = 0; j < np_; ++j) {
        p[j] = from[first_[j]];
        end[j] = priors_[j]->course() == Course::ramp && !ends_with_jump ? to[first_[j]] : p[j];
      }
      const Eigen::VectorXd start = from.head(nx_);
      model_.integrate({.count = 1,
                        .states = start.data(),
                        .inputs = u.data(),
                        .parameters = p.data(),
                        .parameters_end = end.data(),
                        .durations = &sample.duration,
                        .next_states = x.data()});
      to.head(nx_) = x;
      return to;
    };
    const Eigen::VectorXd none = Eigen::VectorXd::Zero(n_), at = next(none, none, std::vector<double>(nu, 0.0));
    Eigen::MatrixXd A(n_, n_), G = Eigen::MatrixXd::Zero(n_, n_), B(n_, nu);
    const std::vector<double> rest(nu, 0.0);
    for (int k = 0; k < n_; ++k) {
      A.col(k) = next(Eigen::VectorXd::Unit(n_, k), none, rest) - at;
      if (k >= nx_) G.col(k) = next(none, Eigen::VectorXd::Unit(n_, k), rest) - at;
    }
    for (int j = 0; j < nu; ++j) {
      std::vector<double> one(nu, 0.0);
      one[j] = 1.0;
      B.col(j) = next(none, none, one) - at;
    }
    mean = next(mean, none, input);
    const Eigen::MatrixXd crossed = A * with_inputs_ * B.transpose();
    covariance = A * covariance * A.transpose() + crossed + crossed.transpose() + B * of_inputs_ * B.transpose() +
                 G * Q * G.transpose();
    with_inputs_ = A * with_inputs_ + B * of_inputs_;
    for (int j = 0; j < nu; ++j) {
      if (std::isnan(sample.inputs[j])) continue;
      with_inputs_.col(j).setZero();
      of_inputs_(j, j) = 0.0;
    }
  }

  /// Returns -2 log likelihood, without constants.
  double update(const Sample& sample, const std::vector<double>& variances) {
    const int ny = model_.output_count();
    double sum = 0.0;
    for (int j = 0; j < ny; ++j) {
      if (std::isnan(sample.outputs[j])) continue;
      Eigen::VectorXd y(ny);
      const auto output = [&](const Eigen::VectorXd& state) {
        const Eigen::VectorXd x = state.head(nx_);
        model_.observe({.count = 1, .states = x.data(), .outputs = y.data()});
        return y[j];
      };
      const double at = output(Eigen::VectorXd::Zero(n_));
      Eigen::VectorXd h = Eigen::VectorXd::Zero(n_);
      for (int k = 0; k < nx_; ++k) h[k] = output(Eigen::VectorXd::Unit(n_, k)) - at;
      const double innovation = sample.outputs[j] - output(mean), S = h.dot(covariance * h) + variances[j];
      const Eigen::VectorXd gain = covariance * h / S;
      mean += gain * innovation;
      covariance -= gain * S * gain.transpose();
      const Eigen::VectorXd of_inputs = with_inputs_.transpose() * h;
      inputs_ += of_inputs * innovation / S;
      of_inputs_ -= of_inputs * of_inputs.transpose() / S;
      with_inputs_ -= gain * of_inputs.transpose();
      sum += innovation * innovation / S + std::log(S);
    }
    return sum;
  }

  /// Moments of [x; p].
  Eigen::VectorXd chosen_mean() const { return chosen() * mean; }
  Eigen::MatrixXd chosen_covariance() const { return chosen() * covariance * chosen().transpose(); }

  Eigen::VectorXd mean;
  Eigen::MatrixXd covariance;

 private:
  double most_variance(int input) const { return std::pow(3.0 * model_.description().inputs[input].scale, 2); }
  Eigen::MatrixXd chosen() const {
    Eigen::MatrixXd pick = Eigen::MatrixXd::Zero(nx_ + np_, n_);
    pick.leftCols(nx_).topRows(nx_).setIdentity();
    for (int j = 0; j < np_; ++j) pick(nx_ + j, first_[j]) = 1.0;
    return pick;
  }

  const Model& model_;
  PriorCombination priors_;
  int nx_, np_, n_ = 0;
  std::vector<int> first_;
  Eigen::VectorXd inputs_;
  std::vector<InputWalk> walks_;
  Eigen::MatrixXd of_inputs_, with_inputs_;
};

TEST(PriorBank, IsTheKalmanFilterOfItsPriorOnALinearModel) {
  const auto model = linear_model<Hovercraft>();
  for (const PriorCombination& member : linear_priors()) {
    const PriorBank::Setup setup = bank_setup(*model, {member});
    PriorBank bank(model, setup);
    DenseFilter reference(*model, member);
    const Eigen::VectorXd start = initial_mean(*model).head(4);
    const Eigen::MatrixXd spread = initial_covariance(*model).topLeftCorner(4, 4);
    bank.reset(start, spread);
    reference.mean.head(4) = start;
    reference.covariance.topLeftCorner(4, 4) = spread;
    auto samples = simulate(*model, 60, false, 5);
    for (int k = 22; k <= 60; ++k) {
      if (k < 40) samples[k].inputs[0] = nan;
      if (k > 32) samples[k].inputs[1] = nan;
    }
    Eigen::VectorXd mean;
    Eigen::MatrixXd covariance;
    for (int k = 0; k <= 60; ++k) {
      const bool jumps = k == 20 || k == 21 || k == 50;
      if (k > 0) {
        reference.predict(samples[k], setup.input_variances, jumps);
        bank.predict({.duration = samples[k].duration, .inputs = samples[k].inputs.data(), .ends_with_jump = jumps});
      }
      reference.update(samples[k], setup.output_variances);
      bank.update(samples[k].outputs.data());
      bank.moments(mean, covariance);
      ASSERT_LT(largest(mean - reference.chosen_mean()), 1e-9) << k;
      ASSERT_LT(largest(covariance - reference.chosen_covariance()), 1e-9 * (1.0 + largest(covariance))) << k;
    }
  }
}

/// With members that never change places, the weights are the posterior probabilities of independent filters, and the
/// moments are those of their mixture.
TEST(PriorBank, WeighsItsMembersByTheirLikelihood) {
  const auto model = linear_model<Hovercraft>();
  const std::vector<PriorCombination> members = linear_priors();
  PriorBank::Setup setup = bank_setup(*model, members);
  setup.memory = std::numeric_limits<double>::infinity();
  setup.gate = std::numeric_limits<double>::infinity();
  PriorBank bank(model, setup);
  std::vector<DenseFilter> filters;
  std::vector<double> costs(members.size(), 0.0);
  const Eigen::VectorXd start = initial_mean(*model).head(4);
  const Eigen::MatrixXd spread = initial_covariance(*model).topLeftCorner(4, 4);
  bank.reset(start, spread);
  for (const PriorCombination& member : members) {
    filters.emplace_back(*model, member);
    filters.back().mean.head(4) = start;
    filters.back().covariance.topLeftCorner(4, 4) = spread;
  }
  const auto samples = simulate(*model, 12, false, 8);
  for (int k = 0; k <= 12; ++k) {
    if (k > 0) bank.predict(samples[k].inputs.data(), samples[k].duration);
    bank.update(samples[k].outputs.data());
    double best = HUGE_VAL, total = 0.0;
    for (std::size_t m = 0; m < filters.size(); ++m) {
      if (k > 0) filters[m].predict(samples[k], setup.input_variances);
      costs[m] += filters[m].update(samples[k], setup.output_variances);
      best = std::min(best, costs[m]);
    }
    std::vector<double> weights;
    for (const double cost : costs) total += weights.emplace_back(std::exp(0.5 * (best - cost)));
    Eigen::VectorXd expected = Eigen::VectorXd::Zero(6), mean;
    Eigen::MatrixXd second = Eigen::MatrixXd::Zero(6, 6), covariance;
    for (std::size_t m = 0; m < filters.size(); ++m) {
      weights[m] /= total;
      ASSERT_NEAR(bank.weights()[m], weights[m], 1e-8) << k;
      const Eigen::VectorXd own = filters[m].chosen_mean();
      expected += weights[m] * own;
      second += weights[m] * (filters[m].chosen_covariance() + own * own.transpose());
    }
    bank.moments(mean, covariance);
    ASSERT_LT(largest(mean - expected), 1e-8) << k;
    ASSERT_LT(largest(covariance - (second - expected * expected.transpose())), 1e-7) << k;
  }
}

/// What is mixed has the same meaning, in members with and without states beside the parameter.
TEST(PriorBank, MixesStatesOfOneMeaning) {
  const auto model = linear_model<Boat>();
  // Very smooth, with three states besides the parameter, and a walk without any.
  const std::vector<PriorCombination> members = {
      {prior("matern", "{length: 50, smoothness: 5/2, along: time, mean: 0.9, mean_sigma: 0.01}")},
      {prior("matern", "{length: 50, along: time, mean: 0.9, mean_sigma: 0.01}")},
      {prior("walk", "{sigma: 0.001, along: time, mean: 0.9, mean_sigma: 0.01}")}};
  PriorBank::Setup setup = bank_setup(*model, members);
  setup.memory = 0.5;
  PriorBank bank(model, setup);
  bank.reset(initial_mean(*model).head(3), initial_covariance(*model).topLeftCorner(3, 3));
  const double nothing[] = {nan, nan}, u[] = {0.0};
  Eigen::VectorXd mean;
  Eigen::MatrixXd covariance;
  // Nothing is measured, so no member learns anything, and all keep the mean that they have in common: a mean that was
  // taken for a curvature would drive it away.
  for (int k = 0; k < 200; ++k) {
    bank.predict(u, 0.2);
    bank.update(nothing);
    for (int m = 0; m < 3; ++m) {
      bank.moments_of(m, mean, covariance);
      ASSERT_NEAR(mean[3], 0.9, 1e-9) << k << " " << m;
      ASSERT_LT(covariance(3, 3), 2.0 * 0.45 * 0.45) << "0.15 of the width of the bounds, 3" << k << " " << m;
    }
  }
}

/// Mixing moves moments between members and leaves those of the whole as they are.
TEST(PriorBank, KeepsTheMomentsOfTheMixtureWhenItMixes) {
  const auto model = linear_model<Hovercraft>();
  PriorBank::Setup setup = bank_setup(*model, linear_priors());
  setup.memory = 1.0;  // a fourth changes within an interval
  PriorBank bank(model, setup);
  bank.reset(initial_mean(*model).head(4), initial_covariance(*model).topLeftCorner(4, 4));
  const auto samples = simulate(*model, 50, false, 8);
  Eigen::VectorXd mean;
  Eigen::MatrixXd covariance;
  for (int k = 1; k <= 50; ++k) {
    bank.predict(samples[k].inputs.data(), samples[k].duration);
    bank.update(samples[k].outputs.data());
    double total = 0.0;
    for (const double weight : bank.weights()) {
      EXPECT_GT(weight, 0.0);
      total += weight;
    }
    EXPECT_NEAR(total, 1.0, 1e-8);
    bank.moments(mean, covariance);
    EXPECT_TRUE(mean.allFinite());
    EXPECT_GT(Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(covariance).eigenvalues()[0], 0.0) << k;
  }
}

TEST(PriorBank, PassesOverWhatIsNoNumber) {
  const auto model = linear_model<Hovercraft>();
  PriorBank bank(model, bank_setup(*model, linear_priors()));
  bank.reset(initial_mean(*model).head(4), initial_covariance(*model).topLeftCorner(4, 4));
  Eigen::VectorXd before, after;
  Eigen::MatrixXd covariance;
  bank.moments(before, covariance);
  const double nothing[] = {nan, nan, nan}, infinite[] = {HUGE_VAL, nan, nan}, missing[] = {nan, nan};
  bank.update(nothing);
  bank.moments(after, covariance);
  EXPECT_EQ(before, after);
  bank.update(infinite);
  bank.predict(missing, 1e300);
  bank.moments(after, covariance);
  EXPECT_TRUE(after.allFinite() && covariance.allFinite());
}

/// A vehicle that drives on ground with patches: the ground covered is what the vehicle did cover, and members whose
/// law is wrong lose their weight.
TEST(PriorBank, MeasuresTheGroundAndFindsTheLaw) {
  const std::shared_ptr<const Model> model = host().make_model("bicycle_slip");
  ModelDescription about = model->description();
  for (Variable& parameter : about.parameters) parameter.lower = 0.0, parameter.upper = 1.0;
  PriorBank::Setup setup;
  setup.members = standard_bank(about);
  setup.output_variances = {1e-4, 1e-4, 1e-4};
  setup.input_variances = {1e-4, 1e-4};
  PriorBank bank(model, setup);
  bank.reset(Eigen::Vector4d::Zero(), 1e-3 * Eigen::Matrix4d::Identity());
  const double u[] = {2.0, 0.0};
  Eigen::Vector4d x = Eigen::Vector4d::Zero(), next;
  const double p[] = {0.7, 0.9}, duration = 0.2;  // the same everywhere
  double y[3];
  for (int k = 0; k < 400; ++k) {
    model->integrate({.count = 1,
                      .states = x.data(),
                      .inputs = u,
                      .parameters = p,
                      .durations = &duration,
                      .next_states = next.data()});
    bank.predict(u, duration);
    EXPECT_NEAR(bank.distance(), (next - x).head(2).norm(), k < 20 ? 0.2 : 0.01);
    x = next;
    model->observe({.count = 1, .states = x.data(), .outputs = y});
    y[0] += 0.01 * std::sin(7.0 * k);
    y[1] += 0.01 * std::cos(5.0 * k);
    bank.update(y);
  }
  // Over 112 m of one value, the laws that vary least are left.
  double slow = 0.0, fast = 0.0;
  for (int m = 0; m < bank.member_count(); ++m) {
    double F[16], Q[16];
    const Prior& law = *setup.members[m][model->description().roles.speed_factor];
    law.advance(1.0, F, Q);
    (Q[0] < 1e-4 ? slow : fast) += bank.weights()[m];
  }
  EXPECT_GT(slow, 5.0 * fast);
}

/// Wheels that spin on the spot cover no ground, and slip varies along it. All the same it may change at once: when
/// they grip again, the bank is soon there.
TEST(PriorBank, ExpectsWheelsThatSpinOnTheSpotToGrip) {
  const std::shared_ptr<const Model> model = host().make_model("bicycle_slip");
  const ModelDescription& about = model->description();
  const int speed_factor = about.roles.speed_factor;
  PriorBank::Setup setup;
  setup.members = standard_bank(about);
  setup.output_variances = {1e-3, 1e-3, 3e-4};
  setup.input_variances = {1e-2, 1e-4};
  PriorBank bank(model, setup);
  bank.reset(Eigen::Vector4d::Zero(), 1e-3 * Eigen::Matrix4d::Identity());
  Eigen::Vector4d x = Eigen::Vector4d::Zero(), next;
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  Eigen::VectorXd mean;
  Eigen::MatrixXd covariance;
  double p[] = {0.9, 0.9};
  int until_known = -1;
  for (int k = 0; k < 120; ++k) {
    const double duration = 0.2, u[] = {2.0 + 0.1 * normal(random), 0.0}, driven[] = {2.0, 0.0};
    const bool spins = k >= 60 && k < 90;
    p[speed_factor] = spins ? 0.0 : 0.9;
    model->integrate({.count = 1,
                      .states = x.data(),
                      .inputs = driven,
                      .parameters = p,
                      .durations = &duration,
                      .next_states = next.data()});
    x = next;
    double y[3];
    model->observe({.count = 1, .states = x.data(), .outputs = y});
    for (int j = 0; j < 3; ++j) y[j] += std::sqrt(setup.output_variances[j]) * normal(random);
    bank.predict(u, duration);
    if (spins) {
      EXPECT_GT(bank.distance(), 0.4 * 2.0 * duration) << k;
    }
    bank.update(y);
    bank.moments(mean, covariance);
    const double error = std::abs(mean[model->state_count() + speed_factor] - 0.9);
    if (k >= 90 && until_known < 0 && error < 0.1) until_known = k - 90;
  }
  EXPECT_GE(until_known, 0);
  EXPECT_LE(until_known, 5);
}

/// Two hundred sensors of a micrometre: the product of their variances is no double any more.
template <class Scalar>
struct ManySensors {
  static constexpr int state_count = 1, input_count = 1, parameter_count = 1, output_count = 200;
  void dynamics(const Scalar*, const Scalar* u, const Scalar* p, Scalar* dxdt) const { dxdt[0] = p[0] * u[0]; }
  void outputs(const Scalar* x, Scalar* y) const {
    for (int j = 0; j < output_count; ++j) y[j] = 1.0 * x[0];
  }
};

TEST(PriorBank, WeighsItsMembersByAnyNumberOfOutputs) {
  ModelDescription about;
  about.name = "many_sensors";
  about.states.resize(1);
  about.inputs.resize(1);
  about.parameters.resize(1);
  about.outputs.resize(ManySensors<double>::output_count);
  const auto model = std::make_shared<FormulaModel<ManySensors>>(ManySensors<double>{}, about);
  PriorBank::Setup setup;
  setup.members = {{prior("constant", "{mean: 0.8, mean_sigma: 0.001}")},
                   {prior("constant", "{mean: 0.5, mean_sigma: 0.001}")}};
  setup.output_variances.assign(ManySensors<double>::output_count, 1e-12);
  setup.input_variances = {1e-8};
  PriorBank bank(model, setup);
  bank.reset(Eigen::VectorXd::Zero(1), Eigen::MatrixXd::Identity(1, 1) * 1e-12);
  const double u[] = {1.0};
  for (int k = 1; k <= 5; ++k) {
    const std::vector<double> y(ManySensors<double>::output_count, 0.8 * 0.2 * k);
    bank.predict(u, 0.2);
    bank.update(y.data());
  }
  EXPECT_GT(bank.weights()[0], 0.9);
}

/// With outputs of motion, at nodes and between them, few or many, a member is linearised where the Kalman filter is,
/// and has its second-order terms; with a scale error beside them too, and if some readings are less accurate than
/// others.
TEST(PriorBank, IsTheKalmanFilterWithOutputsOfMotion) {
  constexpr double sigma = 0.05, nan = std::numeric_limits<double>::quiet_NaN();
  constexpr int most = 12;
  const TurntableNoise noise{.gyro = 0.01};
  for (const auto& [has_scale_error, has_loss] : {std::pair{false, false}, {true, false}, {true, true}}) {
    const auto model = turntable(has_scale_error);
    const int nx = model->state_count();
    PriorBank::Setup setup;
    setup.members = {{prior("walk", "{sigma: 0.05, along: time, course: ramp}")}};
    setup.output_variances = {noise.angle * noise.angle, noise.gyro * noise.gyro};
    setup.input_variances = {noise.omega * noise.omega};
    setup.most_between = most;
    setup.motion_outputs = {1};
    // A loss that nothing is large enough for keeps no other output from being summarised.
    if (has_loss) setup.robust = {{.outputs = {0}, .delta = 1e8}};
    PriorBank bank(model, setup);
    const double infinity = std::numeric_limits<double>::infinity();
    KalmanFilter filter(model, {setup.output_variances, setup.input_variances, {-infinity}, {infinity}, {1}}, 1, most);
    Eigen::VectorXd start = Eigen::VectorXd::Zero(nx);
    start[0] = 0.1;
    Eigen::MatrixXd spread = Eigen::MatrixXd::Identity(nx, nx) * 0.01;
    spread(nx - 1, nx - 1) = 1.0;
    bank.reset(start, spread);
    Eigen::VectorXd mean;
    Eigen::MatrixXd covariance;
    bank.moments(mean, covariance);
    filter.mean = mean;
    filter.covariance = covariance;
    EXPECT_TRUE(bank.looks_ahead());
    for (int k = 1; k <= 60; ++k) {
      const double duration = 0.2, omega = 0.3 * std::sin(0.1 * k) + 0.05 * std::cos(5.0 * k), zero = 0.0,
                   ramp = sigma * sigma * duration;
      const double outputs[] = {0.3 * k * duration,
                                k % 5 == 0 ? nan : 0.2 * std::sin(0.1 * k) + 0.01 * std::sin(9.0 * k)};
      const int readings = k % 3 == 0 ? 2 : k % 3 == 1 ? most : 0;
      double times[most], between[2 * most], weights[2 * most];
      for (int i = 0; i < readings; ++i) {
        times[i] = duration * (i + 0.3) / readings;
        between[2 * i] = i == 1 ? 0.3 * k * duration : nan;
        between[2 * i + 1] =
            readings == 2 && i == 1 ? nan : 0.2 * std::sin(0.1 * k - 0.05) + 0.01 * std::sin(7.0 * i + k);
        weights[2 * i] = 1.0 + 0.5 * std::sin(i);
        weights[2 * i + 1] = std::exp(std::sin(3.0 * i));
      }
      const double weights_of_end[] = {0.4, 2.5};
      const Measured end{outputs, k % 2 == 0 ? weights_of_end : nullptr};
      const MeasuredInterval interval{.duration = duration,
                                      .inputs = &omega,
                                      .between = readings,
                                      .times = times,
                                      .outputs = between,
                                      .weights = k % 4 > 1 ? weights : nullptr};
      bank.predict(interval, end);
      filter.predict(interval, &zero, &ramp, nullptr, end);
      if (k % 7 == 0) {  // what was expected of an end goes with it
        const double nothing[] = {nan, nan};
        bank.predict(interval, nothing);
        filter.predict(interval, &zero, &ramp, nullptr, nothing);
      }
      bank.update(end);
      filter.update(end);
      bank.moments(mean, covariance);
      ASSERT_LT(largest(mean - filter.mean), 1e-9) << k;
      ASSERT_LT(largest(covariance - filter.covariance), 1e-9 * (1.0 + largest(covariance))) << k;
    }
  }
}

/// Two laws of a turntable's traction, and a gyro beside an angle that is hardly measured.
PriorBank::Setup of_two_laws(const TurntableNoise& noise, const char* calm, const char* quick) {
  PriorBank::Setup setup;
  setup.members = {{prior("walk", calm)}, {prior("walk", quick)}};
  setup.output_variances = {noise.angle * noise.angle, noise.gyro * noise.gyro};
  setup.input_variances = {noise.omega * noise.omega};
  setup.most_between = 20;
  setup.motion_outputs = {1};
  return setup;
}

/// While nothing turns, a gyro tells nothing of traction, at whatever rate: neither does the mean move, nor is it known
/// better.
TEST(PriorBank, DoesNotLearnTractionFromATurntableThatRests) {
  const TurntableNoise noise{.angle = 0.1, .gyro = 0.005, .omega = 0.02};
  for (const int readings : {0, 19}) {
    const auto model = turntable();
    PriorBank bank(model, of_two_laws(noise, "{sigma: 0.001, along: time, course: ramp, mean: 0.75, mean_sigma: 0.3}",
                                      "{sigma: 0.002, along: time, course: ramp, mean: 0.75, mean_sigma: 0.3}"));
    std::mt19937 random(11);
    std::normal_distribution<double> normal;
    int inside = 0, count = 0;
    double shift = 0.0, least = 1.0;
    for (int run = 0; run < 20; ++run) {
      bank.reset(Eigen::VectorXd::Zero(model->state_count()),
                 Eigen::MatrixXd::Identity(model->state_count(), model->state_count()) * 1e-4);
      Eigen::VectorXd mean;
      Eigen::MatrixXd covariance;
      for (int k = 0; k < 200; ++k) {
        const double omega = noise.omega * normal(random), nan = std::numeric_limits<double>::quiet_NaN();
        std::vector<double> times, between;
        for (int i = 1; i <= readings; ++i) {
          times.push_back(0.2 * i / (readings + 1));
          between.insert(between.end(), {nan, noise.gyro * normal(random)});
        }
        const double outputs[] = {noise.angle * normal(random), noise.gyro * normal(random)};
        bank.predict({0.2, &omega, readings, times.data(), between.data()}, outputs);
        bank.update(outputs);
      }
      bank.moments(mean, covariance);
      // Of what it was drawn from, the truth is anywhere: 0.75 is the mean of that.
      const double error = mean[mean.size() - 1] - 0.75, sigma = std::sqrt(covariance.bottomRightCorner<1, 1>()(0));
      inside += std::abs(error) < 0.5 * sigma;
      shift += error / 20.0;
      least = std::min(least, sigma);
      ++count;
    }
    EXPECT_GE(inside, 18) << "of " << count << " with " << readings << " readings between the nodes";
    EXPECT_LT(std::abs(shift), 0.06) << readings;
    EXPECT_GT(least, 0.2) << readings << " readings: a standard deviation of 0.3 stays as large as it was, nearly";
  }
}

/// What no vehicle can do, measured again and again, leads no member to where nothing is finite.
TEST(PriorBank, StaysNearTheBoundsOfItsParameters) {
  const TurntableNoise noise{.angle = 0.01, .gyro = 0.01};
  Variable traction;
  traction.lower = 0.0;
  traction.upper = 1.0;
  const auto model = turntable(false, traction);
  PriorBank bank(model, of_two_laws(noise, "{sigma: 0.01, along: time, course: ramp, mean: 0.8, mean_sigma: 0.3}",
                                    "{sigma: 0.5, along: time, course: ramp, mean: 0.8, mean_sigma: 0.3}"));
  const Eigen::Index nx = model->state_count();
  bank.reset(Eigen::VectorXd::Zero(nx), Eigen::MatrixXd::Identity(nx, nx) * 1e-4);
  Eigen::VectorXd mean;
  Eigen::MatrixXd covariance;
  for (int k = 0; k < 30; ++k) {
    const double omega = 0.5, outputs[] = {k % 2 ? 1e5 : -1e5, k % 3 ? 400.0 : -300.0};
    bank.predict({0.2, &omega}, outputs);
    bank.update(outputs);
    bank.moments(mean, covariance);
    ASSERT_TRUE(mean.allFinite() && covariance.allFinite()) << k;
    ASSERT_GE(mean[nx], -0.5 - 1e-9) << k;
    ASSERT_LE(mean[nx], 1.5 + 1e-9) << k;
  }
}

/// Readings within one interval say the same of a law: with twenty, a law is no more probable than with one.
TEST(PriorBank, WeighsLawsByOneReadingOfAnInterval) {
  const TurntableNoise noise{.angle = 1.0, .gyro = 0.01, .omega = 1e-4};
  const auto model = turntable();
  double weight[2] = {};
  for (const bool often : {false, true}) {
    PriorBank bank(model, of_two_laws(noise, "{sigma: 0.01, along: time, course: ramp, mean: 0.8, mean_sigma: 0.01}",
                                      "{sigma: 0.5, along: time, course: ramp, mean: 0.8, mean_sigma: 0.01}"));
    bank.reset(Eigen::VectorXd::Zero(model->state_count()),
               Eigen::MatrixXd::Identity(model->state_count(), model->state_count()) * 1e-4);
    const double omega = 0.5, outputs[] = {0.08, 0.4};
    std::vector<double> times, between;
    for (int i = 1; i < 20; ++i) {
      times.push_back(0.01 * i);
      between.insert(between.end(), {std::numeric_limits<double>::quiet_NaN(), 0.4});
    }
    const std::vector<double> before(bank.weights().begin(), bank.weights().end());
    bank.predict({0.2, &omega, often ? 19 : 0, times.data(), between.data()}, outputs);
    bank.update(outputs);
    weight[often] = bank.weights()[0];
    EXPECT_GT(weight[often], 0.5) << "the calm law is right";
  }
  EXPECT_LT(weight[1], weight[0]);
}

/// An edge of the ground within an interval is an innovation of tens of standard deviations: laws that know nothing of
/// edges lay it on traction and drive, and no more of it than three standard deviations.
TEST(PriorBank, TakesNoMoreOfAnEdgeThanThreeStandardDeviations) {
  const TurntableNoise noise{.angle = 1.0, .gyro = 0.002, .omega = 0.02};
  const auto model = turntable();
  PriorBank bank(model, of_two_laws(noise, "{sigma: 0.01, along: time, course: ramp, mean: 0.9, mean_sigma: 0.01}",
                                    "{sigma: 0.02, along: time, course: ramp, mean: 0.9, mean_sigma: 0.01}"));
  bank.reset(Eigen::VectorXd::Zero(model->state_count()),
             Eigen::MatrixXd::Identity(model->state_count(), model->state_count()) * 1e-6);
  Eigen::VectorXd before, mean;
  Eigen::MatrixXd spread, covariance;
  const double omega = 0.5, nan = std::numeric_limits<double>::quiet_NaN();
  for (int k = 0; k < 20; ++k) {
    const double outputs[] = {nan, (k < 19 ? 0.9 : 0.3) * omega};
    if (k == 19) bank.moments(before, spread);
    bank.predict({.duration = 0.2, .inputs = &omega}, outputs);
    bank.update(outputs);
  }
  bank.moments(mean, covariance);
  const Eigen::Index kappa = mean.size() - 1;
  EXPECT_LT(mean[kappa], before[kappa]);
  EXPECT_GT(mean[kappa], before[kappa] - 3.5 * std::sqrt(spread(kappa, kappa) + 4e-4 * 0.2));
}

TEST(PriorBank, RefusesWhatDoesNotFit) {
  const auto model = linear_model<Hovercraft>();
  EXPECT_THAT(error_of([&] { PriorBank(model, bank_setup(*model, {})); }), ::testing::HasSubstr("at least 1 member"));
  EXPECT_THAT(error_of([&] { PriorBank(model, bank_setup(*model, {{prior("walk", "{}")}})); }),
              ::testing::HasSubstr("expected 2"));
}

}  // namespace prior_bank_test
}  // namespace rhec
