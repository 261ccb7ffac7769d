// Smoothing with priors: on a linear model it is the Rauch-Tung-Striebel smoother on [x; z].
#include "rhec/core/estimation/prior_smoothing.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <utility>
#include <vector>

#include "support/bank_case.hpp"
#include "support/error_of.hpp"

namespace rhec {
namespace prior_smoothing_test {

using namespace testing;
using ::testing::HasSubstr;
using ::testing::SizeIs;
using Real = long double;
using Matrix = Eigen::Matrix<Real, Eigen::Dynamic, Eigen::Dynamic>;
using Vector = Eigen::Matrix<Real, Eigen::Dynamic, 1>;

constexpr double infinity = std::numeric_limits<double>::infinity();
/// A model without a position covers so much ground a second, as far as a bank knows [m/s].
constexpr double ground_speed = 1.5;

struct Moments {
  Vector mean;
  Matrix covariance;
};

/// The textbook's smoother (Rauch, Tung and Striebel 1965) on [x; z; v] of a linear model, in long double, where v are
/// the inputs on the interval before, which walk where they are missing.
class Textbook {
 public:
  Textbook(const Model& model, PriorCombination law, const std::vector<Sample>& samples)
      : model_(model), law_(std::move(law)), nx_(model.state_count()), np_(model.parameter_count()) {
    n_ = nx_;
    for (const auto& prior : law_) {
      first_.push_back(n_);
      n_ += prior->state_count();
    }
    inputs_ = n_;
    n_ += model.input_count();
    Moments now{Vector::Zero(n_), Matrix::Zero(n_, n_)};
    now.mean.head(nx_) = initial_mean(model).head(nx_).cast<Real>();
    now.covariance.topLeftCorner(nx_, nx_) = initial_covariance(model).topLeftCorner(nx_, nx_).cast<Real>();
    for (int j = 0; j < np_; ++j) {
      const int count = law_[j]->state_count();
      Eigen::VectorXd mean(count);
      Eigen::MatrixXd P(count, count);
      law_[j]->start(mean.data(), P.data());
      now.mean.segment(first_[j], count) = mean.cast<Real>();
      now.covariance.block(first_[j], first_[j], count, count) = P.cast<Real>();
    }
    for (int j = 0; j < model.input_count(); ++j) {
      walks_.emplace_back(model.description().inputs[j]);
      now.covariance(inputs_ + j, inputs_ + j) = std::pow(Real(3) * Real(model.description().inputs[j].scale), 2);
    }
    std::vector<Moments> filtered, predicted;
    std::vector<Matrix> transitions;
    for (std::size_t k = 0; k < samples.size(); ++k) {
      if (k > 0) {
        transitions.push_back(predict(samples[k], now));
        predicted.push_back(now);
      }
      update(samples[k], now);
      filtered.push_back(now);
    }
    smoothed = filtered;
    for (std::size_t k = samples.size() - 1; k-- > 0;) {
      const Matrix gain =
          filtered[k].covariance * transitions[k].transpose() * predicted[k].covariance.fullPivLu().inverse();
      smoothed[k].mean += gain * (smoothed[k + 1].mean - predicted[k].mean);
      smoothed[k].covariance += gain * (smoothed[k + 1].covariance - predicted[k].covariance) * gain.transpose();
    }
  }

  /// Of [x; p] at a node; a parameter that is held is there that of the interval before, or that behind.
  Moments at(int node) const {
    Matrix pick = Matrix::Zero(nx_ + np_, n_);
    pick.topLeftCorner(nx_, nx_).setIdentity();
    for (int j = 0; j < np_; ++j) pick(nx_ + j, first_[j]) = 1;
    Moments result{pick * smoothed[node].mean, pick * smoothed[node].covariance * pick.transpose()};
    if (node == 0) return result;
    const Moments before{pick * smoothed[node - 1].mean, pick * smoothed[node - 1].covariance * pick.transpose()};
    const Matrix own = result.covariance;
    const auto is_held = [&](int k) { return k >= nx_ && law_[k - nx_]->course() == Course::held; };
    for (int c = 0; c < nx_ + np_; ++c)
      for (int r = 0; r < nx_ + np_; ++r)
        if (is_held(r) || is_held(c))
          result.covariance(r, c) = (own(r, c) + (is_held(r) && is_held(c) ? before.covariance(r, c) : Real(0))) / 2;
    for (int k = nx_; k < nx_ + np_; ++k) {
      if (!is_held(k)) continue;
      const Real half = (result.mean[k] - before.mean[k]) / 2;
      result.mean[k] -= half;
      result.covariance(k, k) += half * half;
    }
    return result;
  }
  Real input(int interval, int input) const { return smoothed[interval + 1].mean[inputs_ + input]; }
  Real value(int node, int parameter) const { return smoothed[node].mean[first_[parameter]]; }

  std::vector<Moments> smoothed;

 private:
  Matrix predict(const Sample& sample, Moments& now) {
    const int nu = model_.input_count();
    // Linear: its Jacobians are constant, and its value at zero is the drift.
    const std::vector<double> zero(nx_ + nu + np_, 0.0);
    Eigen::VectorXd drift(nx_);
    Eigen::MatrixXd J(nx_, nx_ + nu + 2 * np_);
    model_.integrate({.count = 1,
                      .states = zero.data(),
                      .inputs = zero.data(),
                      .parameters = zero.data(),
                      .parameters_end = zero.data(),
                      .durations = &sample.duration,
                      .next_states = drift.data(),
                      .jacobians = J.data()});
    const Noise noise = noise_of(model_);
    Matrix F = Matrix::Zero(n_, n_), Q = Matrix::Zero(n_, n_), by_noise = Matrix::Identity(n_, n_);
    F.topLeftCorner(nx_, nx_) = J.leftCols(nx_).cast<Real>();
    Vector offset = Vector::Zero(n_);
    offset.head(nx_) = drift.cast<Real>();
    Matrix of_inputs = Matrix::Zero(n_, n_);
    for (int j = 0; j < nu; ++j) {
      Vector by = Vector::Zero(n_);
      by.head(nx_) = J.col(nx_ + j).cast<Real>();
      by[inputs_ + j] = 1;
      const bool is_missing = std::isnan(sample.inputs[j]);
      const Real sigma = noise.inputs[j];
      walks_[j].see(sample.inputs[j], sample.duration);
      if (is_missing)
        F.col(inputs_ + j) = by;
      else
        offset += by * Real(sample.inputs[j]);
      of_inputs += by * by.transpose() * (is_missing ? Real(walks_[j].growth(sample.duration)) : sigma * sigma);
    }
    for (int j = 0; j < np_; ++j) {
      const int count = law_[j]->state_count(), at = first_[j];
      const double advance = law_[j]->along() == Along::time ? sample.duration : ground_speed * sample.duration;
      Eigen::MatrixXd own(count, count), spread(count, count);
      law_[j]->advance(advance, own.data(), spread.data());
      F.block(at, at, count, count) = own.cast<Real>();
      Q.block(at, at, count, count) = spread.cast<Real>();
      const Vector by_start = J.col(nx_ + nu + j).cast<Real>(), by_end = J.col(nx_ + nu + np_ + j).cast<Real>();
      F.col(at).head(nx_) += by_start;
      if (law_[j]->course() == Course::ramp) {
        F.block(0, at, nx_, count) += by_end * own.row(0).cast<Real>();
        by_noise.col(at).head(nx_) = by_end;
      } else {
        F.col(at).head(nx_) += by_end;
      }
    }
    now.mean = (F * now.mean + offset).eval();
    now.covariance = (F * now.covariance * F.transpose() + of_inputs + by_noise * Q * by_noise.transpose()).eval();
    return F;
  }

  void update(const Sample& sample, Moments& now) const {
    const int ny = model_.output_count();
    const std::vector<double> zero(nx_, 0.0);
    Eigen::VectorXd at_zero(ny);
    Eigen::MatrixXd H(ny, nx_);
    model_.observe({.count = 1, .states = zero.data(), .outputs = at_zero.data(), .jacobians = H.data()});
    const Noise noise = noise_of(model_);
    for (int j = 0; j < ny; ++j) {
      if (std::isnan(sample.outputs[j])) continue;
      Vector h = Vector::Zero(n_);
      h.head(nx_) = H.row(j).transpose().cast<Real>();
      const Real S = h.dot(now.covariance * h) + Real(noise.outputs[j]) * Real(noise.outputs[j]);
      const Vector gain = now.covariance * h / S;
      now.mean += gain * (Real(sample.outputs[j]) - Real(at_zero[j]) - h.dot(now.mean));
      now.covariance -= (gain * gain.transpose() * S).eval();
    }
  }

  const Model& model_;
  PriorCombination law_;
  int nx_, np_, n_ = 0, inputs_ = 0;
  std::vector<int> first_;
  std::vector<InputWalk> walks_;
};

PriorSmoothing::Setup setup_for(const Model& model, std::vector<PriorCombination> priors) {
  PriorSmoothing::Setup setup;
  const auto nx = model.state_count(), np = model.parameter_count();
  PriorCombination first;
  for (const PriorCombination& each : priors)
    first.push_back(each.empty() ? prior("walk", "{sigma: 1}") : each.front());
  setup.filters.bank = bank_setup(model, {first});
  setup.filters.bank.least_speed = ground_speed;
  setup.filters.initial_state = initial_mean(model).head(nx);
  setup.filters.initial_covariance = initial_covariance(model).topLeftCorner(nx, nx);
  setup.filters.parameter_lower.assign(np, -infinity);
  setup.filters.parameter_upper.assign(np, infinity);
  setup.priors = std::move(priors);
  setup.problem = linear_setup(model, 1, ArrivalKind::ekf, {}).problem;
  setup.problem.parameter_lower = setup.filters.parameter_lower;
  setup.problem.parameter_upper = setup.filters.parameter_upper;
  return setup;
}

std::shared_ptr<Solver> solver_of(const std::string& name) {
  return host().make_solver(name, parse_yaml(name == "gn_rti" ? "{mode: converge}" : "{}", "test"));
}

/// Largest deviation from the textbook's smoother, in its standard deviations.
double deviation(const SmoothedRun& run, const Model& model, const Textbook& textbook, const PriorCombination& law) {
  const int nx = model.state_count(), np = model.parameter_count(), n = nx + np;
  double worst = 0.0;
  for (int k = 0; k <= run.intervals(); ++k) {
    const Moments expected = textbook.at(k);
    const auto sigma = [&](int i) { return std::sqrt(static_cast<double>(expected.covariance(i, i))); };
    for (int r = 0; r < n; ++r) {
      const double value = r < nx ? run.states[k * nx + r] : run.node_parameters[k * np + r - nx];
      worst = std::max(worst, std::abs(value - static_cast<double>(expected.mean[r])) / sigma(r));
      for (int c = 0; c < n; ++c)
        worst = std::max(worst, std::abs(run.covariances[(static_cast<std::size_t>(k) * n + c) * n + r] -
                                         static_cast<double>(expected.covariance(r, c))) /
                                    (sigma(r) * sigma(c)));
    }
    for (int j = 0; j < np && k < run.intervals(); ++j) {
      const int end = law[j]->course() == Course::ramp ? k + 1 : k;
      worst = std::max(worst, std::abs(run.start_parameters[k * np + j] - static_cast<double>(textbook.value(k, j))) /
                                  sigma(nx + j));
      worst = std::max(
          worst, std::abs(run.parameters[k * np + j] - static_cast<double>(textbook.value(end, j))) / sigma(nx + j));
    }
  }
  return worst;
}

class OfOneLaw : public ::testing::TestWithParam<const char*> {};

/// All kinds of priors, along time and along the ground, ramped and held, at even and uneven intervals, with outputs
/// missing.
TEST_P(OfOneLaw, IsTheTextbooksSmoother) {
  std::vector<PriorCombination> laws = linear_priors();
  laws.push_back({prior("matern", "{length: 4, smoothness: 1/2}"), prior("walk", "{sigma: 0.1, course: held}")});
  laws.push_back({prior("matern", "{length: 3, smoothness: 3/2}"), prior("constant", "{}")});
  laws.push_back({prior("jumps", "{length: 3}"), prior("matern", "{length: 3, smoothness: 5/2, course: held}")});
  const auto model = linear_model<Hovercraft>();
  for (std::size_t k = 0; k < laws.size(); ++k) {
    for (const bool equal_intervals : {true, false}) {
      const auto samples = simulate(*model, 50, equal_intervals, 7 + static_cast<unsigned>(k));
      const PriorSmoothing smoother(model, solver_of(GetParam()), setup_for(*model, {{laws[k][0]}, {laws[k][1]}}));
      const SmoothedRun run = smoother.estimate(log_of(*model, samples));
      ASSERT_EQ(run.report.status, Status::solved);
      ASSERT_FALSE(run.covariances.empty());
      ASSERT_THAT(run.laws, SizeIs(1));
      EXPECT_LT(deviation(run, *model, Textbook(*model, laws[k], samples), laws[k]), 1e-9)
          << "law " << k << (equal_intervals ? ", even" : ", uneven");
    }
  }
}
/// One input ends, and comes again; the other one begins late, and ends.
TEST_P(OfOneLaw, IsTheTextbooksSmootherWhereInputsAreMissing) {
  const auto model = linear_model<Hovercraft>();
  for (const PriorCombination& law : linear_priors()) {
    auto samples = simulate(*model, 60, false, 11);
    for (int k = 1; k <= 60; ++k) {
      if (k > 20 && k <= 40) samples[k].inputs[0] = nan;
      if (k <= 10 || k > 45) samples[k].inputs[1] = nan;
    }
    PriorSmoothing::Setup setup = setup_for(*model, {{law[0]}, {law[1]}});
    setup.problem.input_lower = {-1e3, -1e3};
    setup.problem.input_upper = {1e3, 1e3};
    const SmoothedRun run = PriorSmoothing(model, solver_of(GetParam()), setup).estimate(log_of(*model, samples));
    ASSERT_EQ(run.report.status, Status::solved);
    const Textbook textbook(*model, law, samples);
    EXPECT_LT(deviation(run, *model, textbook, law), 1e-9);
    for (int i = 0; i < 60; ++i)
      for (int j = 0; j < 2; ++j)
        EXPECT_NEAR(run.inputs[2 * i + j], static_cast<double>(textbook.input(i, j)), 1e-8) << i << ' ' << j;
  }
}
INSTANTIATE_TEST_SUITE_P(Solvers, OfOneLaw, ::testing::Values("sparse_sqp", "gn_rti"));

/// Of several laws the estimate is the mixture of their smoothers by their posterior probabilities.
TEST(PriorSmoothing, MixesLawsByTheirProbabilities) {
  const auto model = linear_model<Boat>();
  const std::vector<std::shared_ptr<const Prior>> choices = {prior("walk", "{sigma: 0.2, along: time}"),
                                                             prior("walk", "{sigma: 0.3, along: time}"),
                                                             prior("walk", "{sigma: 40, along: time}")};
  const auto samples = simulate(*model, 40, false, 3);
  PriorSmoothing::Setup setup = setup_for(*model, {{choices[0], choices[1], choices[2]}});
  const SmoothedRun run = PriorSmoothing(model, solver_of("sparse_sqp"), setup).estimate(log_of(*model, samples));
  ASSERT_THAT(run.laws, SizeIs(2)) << "the third one is hardly possible";
  EXPECT_GE(run.laws[0].probability, run.laws[1].probability);
  EXPECT_NEAR(run.laws[0].probability + run.laws[1].probability, 1.0, 1e-12);
  std::vector<SmoothedRun> alone;
  for (int k = 0; k < 2; ++k) {
    const std::size_t choice = run.laws[k].texts[0] == "prior 1 of those given" ? 0 : 1;
    ASSERT_EQ(run.laws[k].texts[0], choice == 0 ? "prior 1 of those given" : "prior 2 of those given");
    alone.push_back(PriorSmoothing(model, solver_of("sparse_sqp"), setup_for(*model, {{choices[choice]}}))
                        .estimate(log_of(*model, samples)));
  }
  for (int i = 0; i <= 40; ++i) {
    const double a = alone[0].node_parameters[i], b = alone[1].node_parameters[i], w = run.laws[0].probability;
    EXPECT_NEAR(run.node_parameters[i], w * a + (1.0 - w) * b, 1e-9);
    const auto variance = [&](const SmoothedRun& of) { return of.covariances[i * 16 + 15]; };
    EXPECT_NEAR(variance(run),
                w * variance(alone[0]) + (1.0 - w) * variance(alone[1]) + w * (1.0 - w) * (a - b) * (a - b), 1e-9);
  }
  setup.most_laws = 1;
  EXPECT_THAT(PriorSmoothing(model, solver_of("sparse_sqp"), setup).estimate(log_of(*model, samples)).laws, SizeIs(1));
}

/// Of an input that is missing as well.
TEST(PriorSmoothing, KeepsTheBoundsOfInputs) {
  const auto model = linear_model<Boat>();
  auto samples = simulate(*model, 40, true, 5);
  for (int k = 15; k <= 40; ++k) samples[k].inputs[0] = nan;
  PriorSmoothing::Setup setup = setup_for(*model, {{prior("matern", "{length: 2, along: time}")}});
  const auto smooth = [&](const char* solver) {
    return PriorSmoothing(model, solver_of(solver), setup).estimate(log_of(*model, samples));
  };
  const SmoothedRun free = smooth("sparse_sqp");
  const auto [least, most] = std::minmax_element(free.inputs.begin(), free.inputs.end());
  const double upper = *least + 0.7 * (*most - *least);
  ASSERT_GT(*std::max_element(free.inputs.begin() + 20, free.inputs.end()), upper) << "the bound would not matter";
  setup.problem.input_lower = {-infinity};
  setup.problem.input_upper = {upper};
  for (const char* solver : {"sparse_sqp", "gn_rti"}) {
    const SmoothedRun run = smooth(solver);
    ASSERT_EQ(run.report.status, Status::solved);
    EXPECT_NEAR(*std::max_element(run.inputs.begin(), run.inputs.end()), upper, 1e-7) << solver;
  }
}

TEST(PriorSmoothing, KeepsTheBounds) {
  const auto model = linear_model<Boat>();
  const auto samples = simulate(*model, 40, true, 5);
  PriorSmoothing::Setup setup = setup_for(*model, {{prior("matern", "{length: 2, along: time}")}});
  const SmoothedRun free = PriorSmoothing(model, solver_of("sparse_sqp"), setup).estimate(log_of(*model, samples));
  const double lower = 0.5 * (*std::min_element(free.node_parameters.begin(), free.node_parameters.end()) +
                              *std::max_element(free.node_parameters.begin(), free.node_parameters.end()));
  setup.filters.parameter_lower = setup.problem.parameter_lower = {lower};
  for (const char* solver : {"sparse_sqp", "gn_rti"}) {
    const SmoothedRun run = PriorSmoothing(model, solver_of(solver), setup).estimate(log_of(*model, samples));
    ASSERT_EQ(run.report.status, Status::solved);
    EXPECT_NEAR(*std::min_element(run.node_parameters.begin(), run.node_parameters.end()), lower, 1e-7) << solver;
  }
}

/// A measurement that is far off moves the estimate less if its loss is robust.
TEST(PriorSmoothing, WeighsOutliersLess) {
  const auto model = linear_model<Boat>();
  const auto samples = simulate(*model, 40, true, 5);
  NodeLog good = log_of(*model, samples), bad = good;
  ASSERT_FALSE(std::isnan(good.outputs[2 * 20]));
  bad.outputs[2 * 20] += 30.0;
  PriorSmoothing::Setup setup = setup_for(*model, {{prior("walk", "{sigma: 0.3, along: time}")}});
  const auto change = [&] {
    const PriorSmoothing smoother(model, solver_of("sparse_sqp"), setup);
    return std::abs(smoother.estimate(bad).states[3 * 20] - smoother.estimate(good).states[3 * 20]);
  };
  const double quadratic = change();
  setup.problem.robust = setup.filters.bank.robust = {{{0}, 2.0}};
  EXPECT_LT(change(), 0.2 * quadratic);
}

TEST(PriorSmoothing, SurvivesALogOfNothing) {
  const auto model = linear_model<Boat>();
  NodeLog log = log_of(*model, simulate(*model, 10, true, 5));
  std::fill(log.outputs.begin(), log.outputs.end(), nan);
  std::fill(log.inputs.begin(), log.inputs.end(), infinity);
  const SmoothedRun run =
      PriorSmoothing(model, solver_of("sparse_sqp"), setup_for(*model, {{}})).estimate(std::move(log));
  for (const double value : run.states) EXPECT_TRUE(std::isfinite(value));
  for (const double value : run.node_parameters) EXPECT_TRUE(std::isfinite(value));
}

TEST(PriorSmoothing, SaysWhatIsWrong) {
  const auto model = linear_model<Boat>();
  const auto samples = simulate(*model, 5, true, 1);
  const auto with = [&](const std::function<void(PriorSmoothing::Setup&)>& change, const NodeLog& log) {
    return error_of([&] {
      auto setup = setup_for(*model, {{prior("walk", "{sigma: 0.3}")}});
      change(setup);
      PriorSmoothing(model, solver_of("sparse_sqp"), setup).estimate(log);
    });
  };
  EXPECT_EQ(with([](auto&) {}, log_of(*model, samples)), "");
  EXPECT_THAT(with([](auto&) {}, log_of(*model, {samples[0]})), HasSubstr("fewer than two nodes"));
  EXPECT_THAT(with([](auto& setup) { setup.filters.initial_state.conservativeResize(2); }, log_of(*model, samples)),
              HasSubstr("must have the size 3"));
  EXPECT_THAT(with([](auto& setup) { setup.filters.parameter_lower.clear(); }, log_of(*model, samples)),
              HasSubstr("expected 1 lower and upper bounds"));
}

}  // namespace prior_smoothing_test
}  // namespace rhec
