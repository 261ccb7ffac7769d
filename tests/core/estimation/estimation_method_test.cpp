// Estimation methods: their results for the same data in another order, and after failures.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "rhec/core/estimation/estimator.hpp"
#include "rhec/core/estimation/filter_estimation.hpp"
#include "rhec/core/ocp/solver_decorator.hpp"
#include "support/linear_case.hpp"

namespace rhec {
namespace estimation_method_test {

using namespace rhec::testing;

constexpr double infinity = std::numeric_limits<double>::infinity();

std::unique_ptr<EstimationMethod> make_method(bool filter, const std::shared_ptr<const Model>& model,
                                              std::shared_ptr<Solver> solver = gn_rti()) {
  RecedingHorizonEstimation::Setup setup = linear_setup(
      *model, 6, ArrivalKind::ekf,
      std::vector<std::shared_ptr<const Blocking>>(
          model->parameter_count(), blocking("structured", "{size: 3, overlap: 2, neighbour_sigma: 0.2}")));
  if (!filter) return std::make_unique<RecedingHorizonEstimation>(model, std::move(solver), setup);
  FilterEstimation::Setup own;
  for (const double weight : setup.problem.output_weights) own.noise.output_variances.push_back(1.0 / weight);
  for (const double weight : setup.problem.input_weights) own.noise.input_variances.push_back(1.0 / weight);
  own.noise.parameter_lower = setup.problem.parameter_lower;
  own.noise.parameter_upper = setup.problem.parameter_upper;
  own.walk.assign(model->parameter_count(), 0.2);
  own.initial_mean = setup.initial_mean;
  own.initial_covariance = setup.initial_covariance;
  return std::make_unique<FilterEstimation>(model, own);
}

bool same_bits(const Estimate& a, const Estimate& b) {
  return a.time == b.time && a.state == b.state && a.parameters == b.parameters && a.covariance == b.covariance &&
         a.report.objective == b.report.objective && a.report.iterations == b.report.iterations;
}

/// Drives an estimator through a run; calls `check` with every estimate.
template <class Check>
void drive(Estimator& estimator, const std::vector<Sample>& samples, bool prepares, const Check& check) {
  double time = 0.0;
  for (std::size_t k = 0; k < samples.size(); ++k) {
    if (k > 0) estimator.push_input(time, samples[k].inputs.data());
    time += samples[k].duration;
    estimator.push_measurement(time, samples[k].outputs.data());
    check(k, estimator.estimate(time));
    if (prepares) estimator.prepare();
  }
}

TEST(EstimationMethods, AskedTwiceGivesTheSame) {
  const auto model = linear_model<Hovercraft>();
  const std::vector<Sample> samples = simulate(*model, 20, true, 5);
  for (const bool filter : {false, true}) {
    Estimator estimator(make_method(filter, model));
    drive(estimator, samples, !filter, [&](std::size_t, const Estimate& estimate) {
      const Estimate first = estimate;
      estimator.prepare();
      EXPECT_TRUE(same_bits(estimator.estimate(first.time), first));
      estimator.estimate(first.time + 0.05);
      EXPECT_TRUE(same_bits(estimator.estimate(first.time), first));
    });
  }
}

TEST(EstimationMethods, AfterResetGivesTheBitsOfANewOne) {
  const auto model = linear_model<Hovercraft>();
  const std::vector<Sample> samples = simulate(*model, 20, true, 5), other = simulate(*model, 33, false, 6);
  for (const bool filter : {false, true}) {
    for (const bool prepares : {false, true}) {
      Estimator fresh(make_method(filter, model)), used(make_method(filter, model));
      drive(used, other, prepares, [](std::size_t, const Estimate&) {});
      used.reset();
      EXPECT_FALSE(used.has_started());
      EXPECT_TRUE(same_bits(used.estimate(0.0), fresh.estimate(0.0)));
      EXPECT_EQ(used.counts().nodes, 0);
      std::vector<Estimate> expected;
      drive(fresh, samples, prepares, [&](std::size_t, const Estimate& estimate) { expected.push_back(estimate); });
      drive(used, samples, prepares,
            [&](std::size_t k, const Estimate& estimate) { EXPECT_TRUE(same_bits(estimate, expected[k])) << k; });
    }
  }
}

/// What is given to a method that has run for a while takes the place of all that it has known.
TEST(EstimationMethods, GoOnFromWhatTheyAreGiven) {
  const auto model = linear_model<Hovercraft>();
  const std::vector<Sample> before = simulate(*model, 20, true, 5), after = simulate(*model, 30, true, 6);
  Eigen::VectorXd mean = initial_mean(*model);
  mean.array() += 3.0;
  const Eigen::MatrixXd covariance = 2.0 * initial_covariance(*model);
  for (const bool filter : {false, true}) {
    const auto make = [&](bool fresh) -> std::unique_ptr<EstimationMethod> {
      RecedingHorizonEstimation::Setup setup = linear_setup(
          *model, 6, ArrivalKind::ekf,
          std::vector<std::shared_ptr<const Blocking>>(model->parameter_count(), blocking("full_horizon")));
      if (fresh) {
        setup.initial_mean = mean;
        setup.initial_covariance = covariance;
      }
      if (!filter) return std::make_unique<RecedingHorizonEstimation>(model, gn_rti(), setup);
      FilterEstimation::Setup own;
      const Noise noise = noise_of(*model);
      for (const double sigma : noise.outputs) own.noise.output_variances.push_back(sigma * sigma);
      for (const double sigma : noise.inputs) own.noise.input_variances.push_back(sigma * sigma);
      own.noise.parameter_lower = setup.problem.parameter_lower;
      own.noise.parameter_upper = setup.problem.parameter_upper;
      own.walk.assign(model->parameter_count(), 0.2);
      own.initial_mean = setup.initial_mean;
      own.initial_covariance = setup.initial_covariance;
      return std::make_unique<FilterEstimation>(model, own);
    };
    const std::vector<double> nothing(model->output_count(), nan);
    auto used = make(false), fresh = make(true);
    used->start(before[0].outputs.data());
    for (std::size_t k = 1; k < before.size(); ++k)
      used->add_node(before[k].duration, before[k].inputs.data(), before[k].outputs.data());
    ASSERT_TRUE(used->rebase(mean, covariance));
    EXPECT_EQ(used->reach(), 0);
    fresh->start(nothing.data());
    Estimate one = empty_estimate(*model), other = one;
    for (std::size_t k = 1; k < after.size(); ++k) {
      for (EstimationMethod* method : {used.get(), fresh.get()})
        method->add_node(after[k].duration, after[k].inputs.data(), after[k].outputs.data());
      used->estimate(one, Clock::time_point::max());
      fresh->estimate(other, Clock::time_point::max());
      EXPECT_LT((one.state - other.state).norm(), 1e-8 * (1.0 + other.state.norm())) << k;
      EXPECT_LT((one.parameters - other.parameters).norm(), 1e-8) << k;
      EXPECT_LT((one.covariance - other.covariance).norm(), 1e-8 * other.covariance.norm()) << k;
    }
  }
}

TEST(EstimationMethods, ADeadlineInThePastStillGivesAnEstimate) {
  const auto model = linear_model<Hovercraft>();
  const std::vector<Sample> samples = simulate(*model, 20, true, 5);
  for (const char* options : {"{mode: rti, iterations: 5}", "{mode: converge}"}) {
    Estimator estimator(make_method(false, model, gn_rti(options)));
    double time = 0.0;
    for (std::size_t k = 0; k < samples.size(); ++k) {
      if (k > 0) estimator.push_input(time, samples[k].inputs.data());
      time += samples[k].duration;
      estimator.push_measurement(time, samples[k].outputs.data());
      const Estimate& estimate = estimator.estimate(time, Clock::now() - std::chrono::seconds(1));
      EXPECT_TRUE(estimate.state.allFinite() && estimate.parameters.allFinite() && estimate.covariance.allFinite());
      EXPECT_FALSE(estimate.fallback);
    }
  }
}

TEST(EstimationMethods, AMeasurementThatComesAfterPreparationCountsAsIfItHadBeenThere) {
  // With one measurement merged into the newest node after `prepare`, and one that is two nodes late; both compared
  // with the filter.
  const auto model = linear_model<Boat>();
  std::vector<Sample> samples = simulate(*model, 40, true, 9);
  for (Sample& sample : samples)
    for (double& output : sample.outputs)
      if (std::isnan(output)) output = 0.1;
  RecedingHorizonEstimation::Setup setup = linear_setup(
      *model, 6, ArrivalKind::ekf, {blocking("structured", "{size: 3, overlap: 1, neighbour_sigma: 0.2}")});
  Estimator estimator(std::make_unique<RecedingHorizonEstimation>(model, gn_rti(), setup));
  ReferenceFilter reference(*model, noise_of(*model), {{3, 0.04}});
  double time = 0.0, worst = 0.0;
  for (int k = 0; k <= 40; ++k) {
    const Sample& sample = samples[k];
    if (k > 0) {
      estimator.push_input(time, sample.inputs.data());
      reference.predict(k - 1, sample);
    }
    reference.update(sample);
    time += sample.duration;
    const double first[] = {sample.outputs[0], nan}, second[] = {nan, sample.outputs[1]};
    estimator.push_measurement(time, first);
    estimator.estimate(time);
    estimator.prepare();
    estimator.push_measurement(time, second);
    if (k % 4 == 3) estimator.prepare();
    worst = std::max(worst, deviation(estimator.estimate(time), reference));
    if (k % 2) estimator.prepare();
  }
  EXPECT_LE(worst, 1e-9);
  EXPECT_EQ(estimator.counts().late, 41);
}

TEST(EstimationMethods, UnmeasuredInputsAreUnknown) {
  // The filter gives an unmeasured input a large standard deviation, the window an infinite one.
  const auto model = linear_model<Hovercraft>();
  const std::vector<Sample> complete = simulate(*model, 40, true, 12);
  Estimator estimator(make_method(false, model)), baseline(make_method(true, model));
  std::vector<Sample> samples = complete;
  for (std::size_t k = 1; k < samples.size(); ++k)
    for (std::size_t j = 0; j < 2; ++j)
      if ((k + j) % 5 == 0 || k % 13 == 0) samples[k].inputs[j] = nan;
  std::vector<Estimate> expected;
  drive(baseline, samples, false, [&](std::size_t, const Estimate& estimate) { expected.push_back(estimate); });
  drive(estimator, samples, true, [&](std::size_t k, const Estimate& estimate) {
    EXPECT_FALSE(estimate.fallback);
    EXPECT_TRUE(estimate.state.allFinite() && estimate.covariance.allFinite());
    for (int j = 0; j < 4; ++j) {
      const double sigma = std::sqrt(expected[k].covariance(j, j));
      EXPECT_NEAR(estimate.state[j], expected[k].state[j], 0.5 * sigma) << "step " << k << ", state " << j;
    }
  });
}

/// Puts NaNs into the guess in one of its solves, as a faulty solver could.
class Poisoner final : public SolverDecorator {
 public:
  Poisoner(std::shared_ptr<Solver> inner, int at) : SolverDecorator(std::move(inner)), at_(at) {}
  using Solver::solve;
  void setup(const Ocp& ocp) override {
    ocp_ = &ocp;
    SolverDecorator::setup(ocp);
  }
  Report solve(Iterate& iterate, Clock::time_point deadline) noexcept override {
    if (count_++ == at_)
      for (int i = 0; i <= ocp_->intervals(); ++i) iterate.state(i)[i % 4] = nan;
    return inner().solve(iterate, deadline);
  }

 private:
  const Ocp* ocp_ = nullptr;
  int at_, count_ = 0;
};

TEST(EstimationMethods, APoisonedGuessIsReportedAndGoneAtTheNextSample) {
  const auto model = linear_model<Hovercraft>();
  const std::vector<Sample> samples = simulate(*model, 30, true, 5);
  for (const bool prepares : {false, true}) {
    for (const int at : {0, 1, 4, 20}) {
      Estimator clean(make_method(false, model));
      Estimator poisoned(make_method(false, model, std::make_shared<Poisoner>(gn_rti(), at)));
      std::vector<Estimate> expected;
      drive(clean, samples, prepares, [&](std::size_t, const Estimate& estimate) { expected.push_back(estimate); });
      drive(poisoned, samples, prepares, [&](std::size_t k, const Estimate& estimate) {
        EXPECT_TRUE(estimate.state.allFinite() && estimate.parameters.allFinite() && estimate.covariance.allFinite());
        if (static_cast<int>(k) == at) {
          EXPECT_EQ(estimate.report.status, Status::bad_input);
          EXPECT_TRUE(estimate.fallback);
        } else {
          EXPECT_FALSE(estimate.fallback);
          EXPECT_LE((estimate.state - expected[k].state).cwiseAbs().maxCoeff(), 1e-9) << k;
          EXPECT_LE((estimate.parameters - expected[k].parameters).cwiseAbs().maxCoeff(), 1e-9) << k;
        }
      });
      EXPECT_EQ(poisoned.counts().fallbacks, 1);
    }
  }
}

/// Does not converge in some of its solves, and leaves the iterate far off.
class Strayer final : public SolverDecorator {
 public:
  Strayer(std::shared_ptr<Solver> inner, int first, int count, double distance)
      : SolverDecorator(std::move(inner)), first_(first), count_(count), distance_(distance) {}
  using Solver::solve;
  void setup(const Ocp& ocp) override {
    ocp_ = &ocp;
    SolverDecorator::setup(ocp);
  }
  Report solve(Iterate& iterate, Clock::time_point deadline) noexcept override {
    Report report = inner().solve(iterate, deadline);
    const int number = solves++;
    if (number < first_ || number >= first_ + count_) return report;
    report.status = Status::iteration_limit;
    for (int i = 0; i <= ocp_->intervals(); ++i) iterate.state(i)[0] += distance_;
    return report;
  }

  int solves = 0;

 private:
  const Ocp* ocp_ = nullptr;
  int first_, count_;
  double distance_;
};

TEST(EstimationMethods, ASolveThatHasGoneAstrayStartsAgainFromThePrior) {
  const auto model = linear_model<Hovercraft>();
  const std::vector<Sample> samples = simulate(*model, 30, true, 5);
  constexpr int at = 20;
  const auto drive_with = [&](bool prepares, int count, double distance, const auto& look) {
    const auto strayer = std::make_shared<Strayer>(gn_rti(), at, count, distance);
    Estimator estimator(make_method(false, model, strayer)), clean(make_method(false, model));
    std::vector<Estimate> expected;
    drive(clean, samples, prepares, [&](std::size_t, const Estimate& estimate) { expected.push_back(estimate); });
    drive(estimator, samples, prepares, [&](std::size_t k, const Estimate& estimate) {
      EXPECT_FALSE(estimate.fallback);
      look(static_cast<int>(k), estimate, (estimate.state - expected[k].state).cwiseAbs().maxCoeff());
    });
    EXPECT_EQ(estimator.counts().fallbacks, 0);
    return strayer->solves;
  };
  const int usual = static_cast<int>(samples.size());
  for (const bool prepares : {false, true}) {
    // Started from the prior, the second solve finds the solution that the first missed.
    EXPECT_EQ(drive_with(prepares, 1, 1000.0,
                         [&](int k, const Estimate& estimate, double error) {
                           EXPECT_LE(error, 1e-9) << k;
                           EXPECT_NE(estimate.report.status, Status::iteration_limit);
                           if (k == at) {
                             EXPECT_GE(estimate.report.iterations, 2);
                           }
                         }),
              usual + 1);
    // If that fails too, the prior itself is better, and the report shows it.
    EXPECT_EQ(drive_with(prepares, 2, 1000.0,
                         [&](int k, const Estimate& estimate, double error) {
                           EXPECT_LE(error, k == at ? 1.0 : 1e-6) << k;
                           EXPECT_EQ(estimate.report.status == Status::iteration_limit, k == at);
                           if (k == at) {
                             EXPECT_LT(estimate.report.objective, 1e4);
                             EXPECT_LT(estimate.report.kkt.defect, 1e-9);
                             EXPECT_GT(estimate.report.kkt.largest(), 1e-6);
                           }
                         }),
              usual + 1);
    // A point better than the prior is kept, whether or not its solve converged.
    EXPECT_EQ(drive_with(prepares, 1, 0.0,
                         [&](int k, const Estimate& estimate, double error) {
                           EXPECT_LE(error, 1e-9) << k;
                           EXPECT_EQ(estimate.report.status == Status::iteration_limit, k == at);
                         }),
              usual);
  }
}

/// Counts the calls of `prepare`.
class PreparationCounter final : public SolverDecorator {
 public:
  using SolverDecorator::SolverDecorator;
  void prepare(const Iterate& guess) noexcept override {
    ++count;
    inner().prepare(guess);
  }

  int count = 0;
};

TEST(EstimationMethods, StampsOfOneStepNeedNoSecondPreparation) {
  const auto model = linear_model<Hovercraft>();
  const std::vector<double> outputs(model->output_count(), 0.1), inputs(model->input_count(), 0.1);
  const auto counter = std::make_shared<PreparationCounter>(gn_rti());
  Estimator estimator(make_method(false, model, counter), {.longest_interval = 0.1});
  int rounded = 0;
  for (int k = 0; k < 60; ++k) {
    // Multiples of 0.1 s as they are computed: their differences are not all the same.
    const double time = 0.1 * k;
    rounded += k > 1 && time - 0.1 * (k - 1) != 0.1;
    if (k > 0) estimator.push_input(time - 0.1, inputs.data());
    estimator.push_measurement(time, outputs.data());
    const int before = counter->count;
    estimator.estimate(time);
    EXPECT_EQ(counter->count, before) << "at sample " << k;
    estimator.prepare();
    EXPECT_EQ(counter->count, before + (k > 0 ? 1 : 0));
  }
  EXPECT_GT(rounded, 20);
}

TEST(EstimationMethods, WhatIsInfiniteOrAbsurdCountsAsMissing) {
  const auto model = linear_model<Hovercraft>();
  std::vector<Sample> with_gaps = simulate(*model, 40, true, 5), poisoned = with_gaps;
  for (std::size_t k = 2; k < poisoned.size(); k += 3) {
    poisoned[k].outputs[k % 3] = k % 2 ? infinity : -1e200;
    with_gaps[k].outputs[k % 3] = nan;
    if (k % 4 == 0) {
      poisoned[k].inputs[1] = k % 8 ? -infinity : 1e300;
      with_gaps[k].inputs[1] = nan;
    }
  }
  for (const bool filter : {false, true}) {
    for (const bool prepares : {false, true}) {
      Estimator one(make_method(filter, model)), two(make_method(filter, model));
      std::vector<Estimate> expected;
      drive(one, with_gaps, prepares, [&](std::size_t, const Estimate& estimate) { expected.push_back(estimate); });
      drive(two, poisoned, prepares,
            [&](std::size_t k, const Estimate& estimate) { EXPECT_TRUE(same_bits(estimate, expected[k])) << k; });
      // The method itself receives cleaned numbers; an invalid duration makes no node.
      const auto direct = make_method(filter, model);
      Estimate estimate = empty_estimate(*model);
      for (std::size_t k = 0; k < with_gaps.size(); ++k) {
        if (k == 0) direct->start(with_gaps[0].outputs.data());
        if (k > 0) direct->add_node(with_gaps[k].duration, with_gaps[k].inputs.data(), with_gaps[k].outputs.data());
        if (k == 7) direct->add_node(nan, with_gaps[k].inputs.data(), std::vector<double>(3, nan).data());
        direct->estimate(estimate, Clock::time_point::max());
        if (prepares) direct->prepare();
        EXPECT_LE((estimate.state - expected[k].state).cwiseAbs().maxCoeff(), 1e-9) << k;
      }
    }
  }
}

}  // namespace estimation_method_test
}  // namespace rhec
