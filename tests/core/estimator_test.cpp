// The timeline: which nodes and intervals are made of stamped rows, and what becomes of what is late, missing or
// absurd.
#include "rhec/core/estimator.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "linear_case.hpp"
#include "rhec/core/error.hpp"
#include "rhec/core/filter_estimation.hpp"

namespace rhec {
namespace {

using namespace rhec::testing;
using ::testing::DoubleEq;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr double infinity = std::numeric_limits<double>::infinity();

/// Keeps what an Estimator tells a method, and answers with the number of nodes.
class Recorder final : public EstimationMethod {
 public:
  struct Node {
    double duration;
    std::vector<double> inputs, outputs;
  };
  const Model& model() const noexcept override { return *model_; }
  int substeps() const noexcept override { return 1; }
  void start(const double* outputs) noexcept override { nodes = {{0.0, {}, {outputs, outputs + 2}}}; }
  void add_node(double duration, const double* inputs, const double* outputs) noexcept override {
    nodes.push_back({duration, {inputs, inputs + 1}, {outputs, outputs + 2}});
  }
  bool amend(int back, const double* outputs) noexcept override {
    if (back >= window || back >= static_cast<int>(nodes.size())) return false;
    for (int j = 0; j < 2; ++j)
      if (!std::isnan(outputs[j])) nodes[nodes.size() - 1 - back].outputs[j] = outputs[j];
    return true;
  }
  void estimate(Estimate& result, Clock::time_point) noexcept override {
    ++estimates;
    result.state = Eigen::Vector2d(static_cast<double>(nodes.size()), 0.0);
    result.report.status = Status::solved;
  }
  void reset() noexcept override { nodes.clear(); }

  std::vector<Node> nodes;
  int window = 5, estimates = 0;

 private:
  std::shared_ptr<const Model> model_ = linear_model<Trolley>();
};

struct Timeline : ::testing::Test {
  Recorder* recorder = nullptr;
  Estimator estimator = make({.longest_interval = 0.2});

  Estimator make(const Estimator::Timeline& timeline) {
    auto method = std::make_unique<Recorder>();
    recorder = method.get();
    return Estimator(std::move(method), timeline);
  }
  void measure(double time, double first, double second = nan) {
    const double outputs[] = {first, second};
    estimator.push_measurement(time, outputs);
  }
  void input(double time, double value) { estimator.push_input(time, &value); }
  std::vector<double> durations() const {
    std::vector<double> result;
    for (const auto& node : recorder->nodes) result.push_back(node.duration);
    return result;
  }
};

TEST_F(Timeline, NodesLieWhereMeasurementsDo) {
  measure(10.0, 1.0);
  measure(10.125, 2.0);
  measure(10.1875, 3.0);
  EXPECT_FALSE(estimator.has_started());
  const Estimate& estimate = estimator.estimate(10.1875);
  EXPECT_TRUE(estimator.has_started());
  EXPECT_EQ(estimate.time, 10.1875);
  EXPECT_FALSE(estimate.predicted);
  EXPECT_THAT(durations(), ElementsAre(0.0, 0.125, 0.0625));
  EXPECT_EQ(recorder->nodes[1].outputs[0], 2.0);
  EXPECT_TRUE(std::isnan(recorder->nodes[1].outputs[1]));
  EXPECT_EQ(estimator.counts().nodes, 3);
  EXPECT_EQ(estimator.counts().estimates, 1);
}

TEST_F(Timeline, OnlyWhatIsStampedUpToTheTimeIsUsed) {
  measure(0.0, 1.0);
  measure(0.1, 2.0);
  measure(0.2, 3.0);
  estimator.estimate(0.1);
  EXPECT_EQ(recorder->nodes.size(), 2u);
  estimator.estimate(0.25);
  EXPECT_EQ(recorder->nodes.size(), 3u);
}

TEST_F(Timeline, GapsAreFilledWithNodesAtMostTheLongestIntervalApart) {
  input(0.0, 1.0);
  measure(0.0, 1.0);
  measure(0.2, 2.0);  // just fits
  measure(0.7, 3.0);  // three parts
  input(0.5, 4.0);
  estimator.estimate(0.7);
  ASSERT_EQ(recorder->nodes.size(), 5u);
  for (std::size_t i = 1; i < 5; ++i) EXPECT_LE(recorder->nodes[i].duration, 0.2 + 1e-9);
  EXPECT_NEAR(recorder->nodes[1].duration, 0.2, 1e-15);
  for (std::size_t i = 2; i < 5; ++i) EXPECT_NEAR(recorder->nodes[i].duration, 0.5 / 3.0, 1e-12);
  for (std::size_t i = 2; i < 4; ++i)
    for (const double output : recorder->nodes[i].outputs) EXPECT_TRUE(std::isnan(output));
  EXPECT_EQ(recorder->nodes[4].outputs[0], 3.0);
  // From 0.2 on: [0.2, 0.3667] 1; [0.3667, 0.5333] 1 and, from 0.5, 4; [0.5333, 0.7] 4.
  EXPECT_NEAR(recorder->nodes[2].inputs[0], 1.0, 1e-12);
  const double part = 0.5 / 3.0, late = 0.2 + 2.0 * part - 0.5;
  EXPECT_NEAR(recorder->nodes[3].inputs[0], (1.0 * (part - late) + 4.0 * late) / part, 1e-12);
  EXPECT_NEAR(recorder->nodes[4].inputs[0], 4.0, 1e-12);
}

TEST_F(Timeline, AnAbsurdGapIsDividedIntoAThousandParts) {
  measure(0.0, 1.0);
  measure(1e9, 2.0);
  estimator.estimate(2e9);
  EXPECT_EQ(recorder->nodes.size(), 1001u);
}

TEST_F(Timeline, InputsAreAveragedOverAnInterval) {
  measure(1.0, 0.0);
  measure(1.2, 0.0);
  measure(1.4, 0.0);
  measure(1.6, 0.0);
  // Rows at irregular times, not in order, each holding until the next.
  input(1.15, 6.0);
  input(0.7, 2.0);
  input(1.05, 4.0);
  input(1.3, nan);  // unknown for 0.05 s, and left out of the mean
  input(1.35, 10.0);
  estimator.estimate(1.6);
  ASSERT_EQ(recorder->nodes.size(), 4u);
  EXPECT_NEAR(recorder->nodes[1].inputs[0], (0.05 * 2.0 + 0.1 * 4.0 + 0.05 * 6.0) / 0.2, 1e-12);
  EXPECT_NEAR(recorder->nodes[2].inputs[0], (0.1 * 6.0 + 0.05 * 10.0) / 0.15, 1e-12);
  EXPECT_NEAR(recorder->nodes[3].inputs[0], 10.0, 1e-12);
}

TEST_F(Timeline, WhatIsKnownOfAnInputCountsAndNothingIsNothing) {
  measure(0.0, 0.0);
  measure(0.1, 0.0);
  input(0.15, 3.0);
  measure(0.2, 0.0);
  estimator.estimate(0.2);
  EXPECT_TRUE(std::isnan(recorder->nodes[1].inputs[0]));
  EXPECT_NEAR(recorder->nodes[2].inputs[0], 3.0, 1e-12);
}

TEST_F(Timeline, OfInputsWithOneStampTheLastCounts) {
  measure(0.0, 0.0);
  input(0.0, 1.0);
  input(0.0, 2.0);
  measure(0.1, 0.0);
  estimator.estimate(0.1);
  EXPECT_NEAR(recorder->nodes[1].inputs[0], 2.0, 1e-12);
}

TEST_F(Timeline, MeasurementsWithOneStampAreOneNode) {
  measure(0.0, 1.0);
  measure(0.1, 2.0);
  measure(0.1 + 5e-7, nan, 3.0);
  measure(0.1, nan, nan);
  estimator.estimate(0.2);
  ASSERT_EQ(recorder->nodes.size(), 2u);
  EXPECT_THAT(recorder->nodes[1].outputs, ElementsAre(2.0, 3.0));
}

TEST_F(Timeline, WhatComesOutOfOrderButInTimeIsSorted) {
  measure(0.2, 3.0);
  measure(0.0, 1.0);
  measure(0.1, 2.0);
  estimator.estimate(0.2);
  ASSERT_EQ(recorder->nodes.size(), 3u);
  for (int i = 0; i < 3; ++i) EXPECT_EQ(recorder->nodes[i].outputs[0], 1.0 + i);
  EXPECT_EQ(estimator.counts().late, 0);
}

TEST_F(Timeline, LateMeasurementsAreMergedOrDropped) {
  for (int i = 0; i <= 10; ++i) measure(0.1 * i, i);
  estimator.estimate(1.0);
  EXPECT_EQ(recorder->estimates, 1);
  measure(0.8, nan, 7.0);  // two nodes back
  EXPECT_EQ(recorder->nodes[8].outputs[1], 7.0);
  EXPECT_EQ(recorder->nodes[8].outputs[0], 8.0);
  measure(1.0, nan, 9.0);  // the newest
  EXPECT_EQ(recorder->nodes[10].outputs[1], 9.0);
  EXPECT_EQ(estimator.counts().late, 2);
  EXPECT_EQ(estimator.counts().dropped, 0);
  estimator.estimate(1.0);
  EXPECT_EQ(recorder->estimates, 2);
  measure(0.2, nan, 7.0);   // out of reach
  measure(0.85, nan, 7.0);  // no node there
  measure(-3.0, nan, 7.0);  // before the run
  EXPECT_EQ(estimator.counts().late, 2);
  EXPECT_EQ(estimator.counts().dropped, 3);
  estimator.estimate(1.0);
  EXPECT_EQ(recorder->estimates, 2);
}

TEST_F(Timeline, WhatIsNoNumberIsMaskedAndCounted) {
  measure(0.0, nan, 1.0);
  measure(0.1, infinity, -infinity);
  measure(0.2, 1e300, 2.0);
  input(0.0, infinity);
  input(0.1, 5.0);
  estimator.estimate(0.2);
  ASSERT_EQ(recorder->nodes.size(), 3u);
  for (const double output : recorder->nodes[1].outputs) EXPECT_TRUE(std::isnan(output));
  EXPECT_TRUE(std::isnan(recorder->nodes[2].outputs[0]));
  EXPECT_EQ(estimator.counts().missing, 4);
  EXPECT_TRUE(std::isnan(recorder->nodes[1].inputs[0]));
  EXPECT_NEAR(recorder->nodes[2].inputs[0], 5.0, 1e-12);
}

TEST_F(Timeline, StampsThatAreNoTimesAreDropped) {
  for (const double stamp : {nan, infinity, -infinity}) {
    measure(stamp, 1.0);
    input(stamp, 1.0);
  }
  EXPECT_EQ(estimator.counts().dropped, 3);
  measure(0.0, 1.0);
  measure(0.1, 1.0);
  for (const double time : {nan, -infinity}) EXPECT_EQ(estimator.estimate(time).time, 0.0);
  EXPECT_FALSE(estimator.has_started());
  const Estimate& estimate = estimator.estimate(infinity);  // all there is
  EXPECT_EQ(estimate.time, 0.1);
  EXPECT_TRUE(estimate.state.allFinite());
  EXPECT_TRUE(std::isnan(recorder->nodes[1].inputs[0]));
}

TEST_F(Timeline, BeyondTheNewestNodeItIsIntegrated) {
  input(0.0, 0.0);
  measure(0.0, 1.0);
  input(0.1, 2.0);
  const double from[] = {1.0, 0.0};
  double expected[2];
  const double mean = (0.1 * 0.0 + 0.2 * 2.0) / 0.3, duration = 0.3;
  Model::Intervals request;
  request.count = 1;
  request.states = from;
  request.inputs = &mean;
  request.durations = &duration;
  request.substeps = 2;
  request.next_states = expected;
  recorder->model().integrate(request);
  const Estimate& ahead = estimator.estimate(0.3);
  EXPECT_TRUE(ahead.predicted);
  EXPECT_EQ(ahead.time, 0.3);
  EXPECT_THAT(ahead.state[0], DoubleEq(expected[0]));
  EXPECT_THAT(ahead.state[1], DoubleEq(expected[1]));
  EXPECT_EQ(ahead.report.status, Status::solved);
  EXPECT_FALSE(estimator.estimate(0.0).predicted);
  EXPECT_EQ(recorder->nodes.size(), 1u);
  EXPECT_TRUE(estimator.estimate(1e300).state.allFinite());
}

TEST_F(Timeline, BuffersThatAreFullLoseTheirOldest) {
  estimator = make({.longest_interval = 1.0, .capacity = 4});
  for (int i = 0; i < 11; ++i) {
    measure(i, i);
    input(i, i);
  }
  EXPECT_EQ(estimator.counts().dropped, 7);
  estimator.estimate(20.0);
  ASSERT_EQ(recorder->nodes.size(), 4u);
  for (int i = 0; i < 4; ++i) EXPECT_EQ(recorder->nodes[i].outputs[0], 7.0 + i);
  EXPECT_EQ(recorder->nodes[1].inputs[0], 7.0);
  // Full and emptied again and again, so that the rows go round their memory.
  for (int i = 11; i < 100; ++i) {
    measure(i, i);
    input(i, i);
    if (i % 3 == 0) estimator.estimate(i);
  }
  estimator.estimate(99.0);
  EXPECT_EQ(recorder->nodes.size(), 4u + 89u);
  for (std::size_t i = 1; i < recorder->nodes.size(); ++i) EXPECT_EQ(recorder->nodes[i].inputs[0], 6.0 + i);
}

TEST_F(Timeline, RefusesNumbersThatMakeNoSense) {
  const auto message = [&](const Estimator::Timeline& timeline) -> std::string {
    try {
      make(timeline);
    } catch (const Error& error) {
      return error.what();
    }
    return "no error";
  };
  EXPECT_THAT(message({.longest_interval = 0.0}), HasSubstr("longest interval"));
  EXPECT_THAT(message({.longest_interval = nan}), HasSubstr("longest interval"));
  EXPECT_THAT(message({.tolerance = -1.0}), HasSubstr("tolerance"));
  EXPECT_THAT(message({.tolerance = 0.5}), HasSubstr("tolerance"));
  EXPECT_THAT(message({.capacity = 0}), HasSubstr("capacity"));
}

// With the methods themselves.

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

TEST(Estimator, AskedTwiceGivesTheSame) {
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

TEST(Estimator, AfterResetGivesTheBitsOfANewOne) {
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

TEST(Estimator, ADeadlineInThePastStillGivesAnEstimate) {
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

TEST(Estimator, AMeasurementThatComesAfterPreparationCountsAsIfItHadBeenThere) {
  // With one that is merged into the newest node after `prepare` and one that is two nodes late; both against the
  // filter.
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

TEST(Estimator, UnmeasuredInputsAreUnknown) {
  // The filter takes an unmeasured input for one of a wide standard deviation, the window for one of an infinite one.
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

/// Puts NaNs into the guess at one of its solves, as a solver that breaks its promise would.
class Poisoner final : public Solver {
 public:
  Poisoner(std::shared_ptr<Solver> inner, int at) : inner_(std::move(inner)), at_(at) {}
  std::string why_not(const Ocp& ocp) const override { return inner_->why_not(ocp); }
  void setup(const Ocp& ocp) override { inner_->setup(ocp); }
  void prepare(const Ocp& ocp, const Iterate& guess) noexcept override { inner_->prepare(ocp, guess); }
  Report solve(const Ocp& ocp, Iterate& point, Clock::time_point deadline) noexcept override {
    if (count_++ == at_)
      for (int i = 0; i <= ocp.intervals(); ++i) point.state(i)[i % 4] = nan;
    return inner_->solve(ocp, point, deadline);
  }
  void reset() noexcept override { inner_->reset(); }

 private:
  std::shared_ptr<Solver> inner_;
  int at_, count_ = 0;
};

TEST(Estimator, APoisonedGuessIsReportedAndGoneAtTheNextSample) {
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

/// Comes to no end in some of its solves, and leaves the point where it has strayed to.
class Strayer final : public Solver {
 public:
  Strayer(std::shared_ptr<Solver> inner, int first, int count, double distance)
      : inner_(std::move(inner)), first_(first), count_(count), distance_(distance) {}
  std::string why_not(const Ocp& ocp) const override { return inner_->why_not(ocp); }
  void setup(const Ocp& ocp) override { inner_->setup(ocp); }
  void prepare(const Ocp& ocp, const Iterate& guess) noexcept override { inner_->prepare(ocp, guess); }
  Report solve(const Ocp& ocp, Iterate& point, Clock::time_point deadline) noexcept override {
    Report report = inner_->solve(ocp, point, deadline);
    const int number = solves++;
    if (number < first_ || number >= first_ + count_) return report;
    report.status = Status::iteration_limit;
    for (int i = 0; i <= ocp.intervals(); ++i) point.state(i)[0] += distance_;
    return report;
  }
  void reset() noexcept override { inner_->reset(); }

  int solves = 0;

 private:
  std::shared_ptr<Solver> inner_;
  int first_, count_;
  double distance_;
};

TEST(Estimator, ASolveThatHasGoneAstrayStartsAgainFromThePrior) {
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
    // From the prior, the second solve finds what the first should have found.
    EXPECT_EQ(drive_with(prepares, 1, 1000.0,
                         [&](int k, const Estimate& estimate, double error) {
                           EXPECT_LE(error, 1e-9) << k;
                           EXPECT_NE(estimate.report.status, Status::iteration_limit);
                           if (k == at) {
                             EXPECT_GE(estimate.report.iterations, 2);
                           }
                         }),
              usual + 1);
    // Where that goes astray too, the prior itself is better, and says so.
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
    // What is better than the prior is kept, whether its solve has come to an end or not.
    EXPECT_EQ(drive_with(prepares, 1, 0.0,
                         [&](int k, const Estimate& estimate, double error) {
                           EXPECT_LE(error, 1e-9) << k;
                           EXPECT_EQ(estimate.report.status == Status::iteration_limit, k == at);
                         }),
              usual);
  }
}

/// Counts what it is asked to prepare.
class PreparationCounter final : public Solver {
 public:
  explicit PreparationCounter(std::shared_ptr<Solver> inner) : inner_(std::move(inner)) {}
  std::string why_not(const Ocp& ocp) const override { return inner_->why_not(ocp); }
  void setup(const Ocp& ocp) override { inner_->setup(ocp); }
  void prepare(const Ocp& ocp, const Iterate& guess) noexcept override {
    ++count;
    inner_->prepare(ocp, guess);
  }
  Report solve(const Ocp& ocp, Iterate& point, Clock::time_point deadline) noexcept override {
    return inner_->solve(ocp, point, deadline);
  }
  void reset() noexcept override { inner_->reset(); }

  int count = 0;

 private:
  std::shared_ptr<Solver> inner_;
};

TEST(Estimator, StampsOfOneStepNeedNoSecondPreparation) {
  const auto model = linear_model<Hovercraft>();
  const std::vector<double> outputs(model->output_count(), 0.1), inputs(model->input_count(), 0.1);
  const auto counter = std::make_shared<PreparationCounter>(gn_rti());
  Estimator estimator(make_method(false, model, counter));
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

TEST(Estimator, WhatIsInfiniteOrAbsurdCountsAsMissing) {
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
      // Given to the method itself, without the estimator before it.
      const auto direct = make_method(filter, model);
      Estimate estimate = empty_estimate(*model);
      for (std::size_t k = 0; k < poisoned.size(); ++k) {
        if (k == 0) direct->start(poisoned[0].outputs.data());
        if (k > 0) direct->add_node(poisoned[k].duration, poisoned[k].inputs.data(), poisoned[k].outputs.data());
        if (k == 7) direct->add_node(nan, poisoned[k].inputs.data(), std::vector<double>(3, nan).data());
        direct->estimate(estimate, Clock::time_point::max());
        if (prepares) direct->prepare();
        EXPECT_LE((estimate.state - expected[k].state).cwiseAbs().maxCoeff(), 1e-9) << k;
      }
    }
  }
}

}  // namespace
}  // namespace rhec
