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
#include "support/largest.hpp"
#include "support/turntable.hpp"

namespace rhec {
namespace prior_bank_test {

using namespace testing;

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

TEST(PriorBank, RefusesWhatDoesNotFit) {
  const auto model = linear_model<Hovercraft>();
  EXPECT_THAT(error_of([&] { PriorBank(model, bank_setup(*model, {})); }), ::testing::HasSubstr("at least 1 member"));
  EXPECT_THAT(error_of([&] { PriorBank(model, bank_setup(*model, {{prior("walk", "{}")}})); }),
              ::testing::HasSubstr("expected 2"));
}

}  // namespace prior_bank_test
}  // namespace rhec
