// The timeline: which nodes and intervals result from time-stamped rows, including late, missing and absurd ones.
#include "rhec/core/estimation/estimator.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "rhec/core/base/error.hpp"
#include "support/error_of.hpp"
#include "support/linear_case.hpp"

namespace rhec {
namespace estimator_test {

using namespace rhec::testing;
using ::testing::DoubleEq;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr double infinity = std::numeric_limits<double>::infinity();

/// Records what an Estimator passes to its method, and returns the number of nodes.
class Recorder final : public EstimationMethod {
 public:
  struct Node {
    double duration;
    std::vector<double> inputs, outputs;
    std::vector<double> times = {}, between = {}, weights = {};
  };
  explicit Recorder(int room, int window) : room_(room), window_(window) {}
  const Model& model() const noexcept override { return *model_; }
  int substeps() const noexcept override { return 1; }
  void start(Measured outputs) noexcept override {
    nodes = {{0.0, {}, {outputs.values, outputs.values + 2}, {}, {}, weights_of(outputs)}};
  }
  void add(const MeasuredInterval& interval, Measured outputs) noexcept override {
    nodes.push_back({interval.duration,
                     {interval.inputs, interval.inputs + 1},
                     {outputs.values, outputs.values + 2},
                     {interval.times, interval.times + interval.between},
                     {interval.outputs, interval.outputs + 2 * interval.between},
                     weights_of(outputs)});
  }
  int most_between() const noexcept override { return room_; }
  int reach() const noexcept override { return std::min(static_cast<int>(nodes.size()), most_reach()); }
  int most_reach() const noexcept override { return window_; }
  void rewind(int count) noexcept override { nodes.resize(nodes.size() - static_cast<std::size_t>(count)); }
  void estimate(Estimate& result, Clock::time_point) noexcept override {
    ++estimates;
    result.state = Eigen::Vector2d(static_cast<double>(nodes.size()), 0.0);
    result.report.status = Status::solved;
  }
  void reset() noexcept override { nodes.clear(); }

  std::vector<Node> nodes;
  int estimates = 0;

 private:
  static std::vector<double> weights_of(Measured outputs) {
    return outputs.weights ? std::vector<double>(outputs.weights, outputs.weights + 2) : std::vector<double>();
  }

  std::shared_ptr<const Model> model_ = linear_model<Trolley>();
  int room_, window_;
};

struct Timeline : ::testing::Test {
  Recorder* recorder = nullptr;
  Estimator estimator = make({.longest_interval = 0.2});

  Estimator make(const Estimator::Timeline& timeline, int room = 8, int window = 5) {
    auto method = std::make_unique<Recorder>(room, window);
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

TEST_F(Timeline, TheNewestMeasurementIsANodeAndGivesWay) {
  measure(10.0, 1.0);
  measure(10.125, 2.0);
  EXPECT_FALSE(estimator.has_started());
  estimator.estimate(10.125);
  EXPECT_THAT(durations(), ElementsAre(0.0, 0.125));
  EXPECT_EQ(recorder->nodes[1].outputs[0], 2.0);
  EXPECT_TRUE(recorder->nodes[1].times.empty());
  measure(10.1875, 3.0);
  const Estimate& estimate = estimator.estimate(10.1875);
  EXPECT_TRUE(estimator.has_started());
  EXPECT_EQ(estimate.time, 10.1875);
  EXPECT_FALSE(estimate.predicted);
  EXPECT_THAT(durations(), ElementsAre(0.0, 0.1875));
  EXPECT_EQ(recorder->nodes[1].outputs[0], 3.0);
  EXPECT_TRUE(std::isnan(recorder->nodes[1].outputs[1]));
  EXPECT_THAT(recorder->nodes[1].times, ElementsAre(0.125));
  EXPECT_EQ(recorder->nodes[1].between[0], 2.0);
  EXPECT_EQ(estimator.counts().nodes, 2);
  EXPECT_EQ(estimator.counts().estimates, 2);
  EXPECT_EQ(estimator.counts().late, 0);
}

/// However often there are measurements, intervals are as long as a step.
TEST_F(Timeline, RatesOfSensorsDoNotSetTheNumberOfNodes) {
  estimator = make({.longest_interval = 0.2}, 32);
  for (int i = 0; i <= 100; ++i) {
    measure(0.01 * i, i);
    if (i % 20 == 0) measure(0.01 * i, nan, 2.0);
    estimator.estimate(0.01 * i);
  }
  ASSERT_EQ(recorder->nodes.size(), 6u);
  for (std::size_t i = 1; i < 6; ++i) {
    EXPECT_NEAR(recorder->nodes[i].duration, 0.2, 1e-12);
    EXPECT_EQ(recorder->nodes[i].outputs[0], 20.0 * i);
    EXPECT_EQ(recorder->nodes[i].outputs[1], 2.0);
    ASSERT_EQ(recorder->nodes[i].times.size(), 19u);
    for (int k = 0; k < 19; ++k) {
      EXPECT_NEAR(recorder->nodes[i].times[k], 0.01 * (k + 1), 1e-12);
      EXPECT_EQ(recorder->nodes[i].between[2 * k], 20.0 * (i - 1) + k + 1);
    }
  }
}

/// Jitter of a sensor at the step itself makes no measurement lie between nodes.
TEST_F(Timeline, NodesLieAtMeasurementsThatAreNearToTheGrid) {
  const std::vector<double> stamps{0.0, 0.195, 0.402, 0.593, 0.8, 1.008};
  for (const double stamp : stamps) {
    measure(stamp, 1.0);
    estimator.estimate(stamp);
  }
  ASSERT_EQ(recorder->nodes.size(), stamps.size());
  for (std::size_t i = 1; i < stamps.size(); ++i) {
    EXPECT_NEAR(recorder->nodes[i].duration, stamps[i] - stamps[i - 1], 1e-12);
    EXPECT_TRUE(recorder->nodes[i].times.empty());
  }
}

TEST_F(Timeline, AnIntervalWithoutRoomEndsEarly) {
  estimator = make({.longest_interval = 1.0}, 2);
  for (int i = 0; i <= 10; ++i) measure(0.1 * i, i);
  estimator.estimate(1.0);
  // 0.1 and 0.2 between, 0.3 a node, and so on.
  ASSERT_EQ(recorder->nodes.size(), 5u);
  std::vector<double> seen;
  for (std::size_t i = 1; i < 5; ++i) {
    for (std::size_t k = 0; k < recorder->nodes[i].times.size(); ++k) seen.push_back(recorder->nodes[i].between[2 * k]);
    seen.push_back(recorder->nodes[i].outputs[0]);
  }
  EXPECT_THAT(seen, ElementsAre(1, 2, 3, 4, 5, 6, 7, 8, 9, 10));
}

TEST_F(Timeline, OnlyWhatIsStampedUpToTheTimeIsUsed) {
  measure(0.0, 1.0);
  measure(0.2, 2.0);
  measure(0.4, 3.0);
  estimator.estimate(0.2);
  EXPECT_EQ(recorder->nodes.size(), 2u);
  estimator.estimate(0.45);
  EXPECT_EQ(recorder->nodes.size(), 3u);
  estimator.estimate(0.1);  // nothing is lost
  EXPECT_EQ(recorder->nodes.size(), 3u);
}

TEST_F(Timeline, GapsAreFilledWithNodesAtMostAStepApart) {
  input(0.0, 1.0);
  measure(0.0, 1.0);
  measure(0.2, 2.0);  // just fits
  measure(0.7, 3.0);  // three parts
  input(0.5, 4.0);
  estimator.estimate(0.7);
  ASSERT_EQ(recorder->nodes.size(), 5u);
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

/// A gap is divided anew by what comes late: as if it had been there.
TEST_F(Timeline, LateMeasurementsDivideAGapAnew) {
  estimator = make({.longest_interval = 0.2}, 8, 10);
  for (const double stamp : {0.0, 0.2, 1.2, 1.4}) measure(stamp, stamp);
  estimator.estimate(1.4);
  ASSERT_EQ(recorder->nodes.size(), 8u);
  measure(0.75, 0.75);
  estimator.estimate(1.4);
  // Three parts to there, and three from there on.
  ASSERT_EQ(recorder->nodes.size(), 9u);
  for (std::size_t i = 2; i < 5; ++i) EXPECT_NEAR(recorder->nodes[i].duration, 0.55 / 3.0, 1e-12);
  EXPECT_EQ(recorder->nodes[4].outputs[0], 0.75);
  for (std::size_t i = 5; i < 8; ++i) EXPECT_NEAR(recorder->nodes[i].duration, 0.15, 1e-12);
  EXPECT_EQ(estimator.counts().late, 1);
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
  // Rows at irregular times, out of order, each valid until the next.
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
  measure(0.2, 0.0);
  input(0.3, 3.0);
  measure(0.4, 0.0);
  estimator.estimate(0.4);
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
  measure(0.4, 3.0);
  measure(0.0, 1.0);
  measure(0.2, 2.0);
  estimator.estimate(0.4);
  ASSERT_EQ(recorder->nodes.size(), 3u);
  for (int i = 0; i < 3; ++i) EXPECT_EQ(recorder->nodes[i].outputs[0], 1.0 + i);
  EXPECT_EQ(estimator.counts().late, 0);
}

TEST_F(Timeline, LateMeasurementsGoToTheirPlaceOrAreDropped) {
  for (int i = 0; i <= 10; ++i) measure(0.2 * i, i);
  estimator.estimate(2.0);
  EXPECT_EQ(recorder->estimates, 1);
  measure(1.6, nan, 7.0);  // two nodes back
  measure(1.7, nan, 8.0);  // between nodes
  measure(2.0, nan, 9.0);  // the newest
  EXPECT_EQ(estimator.counts().late, 3);
  EXPECT_EQ(estimator.counts().dropped, 0);
  estimator.estimate(2.0);
  EXPECT_EQ(recorder->estimates, 2);
  ASSERT_EQ(recorder->nodes.size(), 11u);
  EXPECT_EQ(recorder->nodes[8].outputs[1], 7.0);
  EXPECT_EQ(recorder->nodes[8].outputs[0], 8.0);
  ASSERT_EQ(recorder->nodes[9].times.size(), 1u);
  EXPECT_NEAR(recorder->nodes[9].times[0], 0.1, 1e-12);
  EXPECT_EQ(recorder->nodes[9].between[1], 8.0);
  EXPECT_EQ(recorder->nodes[10].outputs[1], 9.0);
  measure(0.4, nan, 7.0);   // out of reach
  measure(-3.0, nan, 7.0);  // before the run
  EXPECT_EQ(estimator.counts().late, 3);
  EXPECT_EQ(estimator.counts().dropped, 2);
  estimator.estimate(2.0);
  EXPECT_EQ(recorder->estimates, 2);
  EXPECT_EQ(estimator.counts().nodes, 11);
}

/// As long as the start of the run can be taken back, it may move.
TEST_F(Timeline, WhatComesBeforeTheStartIsTheStart) {
  measure(1.0, 1.0);
  measure(1.2, 2.0);
  estimator.estimate(1.2);
  measure(0.9, 0.0);
  estimator.estimate(1.2);
  ASSERT_EQ(recorder->nodes.size(), 3u);
  EXPECT_EQ(recorder->nodes[0].outputs[0], 0.0);
  EXPECT_NEAR(recorder->nodes[1].duration, 0.2, 1e-12);  // a node of the grid
  EXPECT_EQ(recorder->nodes[1].between[0], 1.0);
  EXPECT_NEAR(recorder->nodes[2].duration, 0.1, 1e-12);
  EXPECT_EQ(estimator.counts().dropped, 0);
}

TEST_F(Timeline, LateInputsCountFromTheirStampOn) {
  input(0.0, 1.0);
  for (int i = 0; i <= 10; ++i) measure(0.2 * i, i);
  estimator.estimate(2.0);
  input(1.7, 3.0);
  estimator.estimate(2.0);
  EXPECT_NEAR(recorder->nodes[8].inputs[0], 1.0, 1e-12);
  EXPECT_NEAR(recorder->nodes[9].inputs[0], 2.0, 1e-12);
  EXPECT_NEAR(recorder->nodes[10].inputs[0], 3.0, 1e-12);
  input(0.1, 5.0);  // of which only the last intervals can be told
  estimator.estimate(2.0);
  EXPECT_NEAR(recorder->nodes[5].inputs[0], 1.0, 1e-12);
  EXPECT_NEAR(recorder->nodes[6].inputs[0], 5.0, 1e-12);
  EXPECT_NEAR(recorder->nodes[10].inputs[0], 3.0, 1e-12);
}

TEST_F(Timeline, WhatIsNoNumberIsMaskedAndCounted) {
  measure(0.0, nan, 1.0);
  measure(0.2, infinity, -infinity);
  measure(0.4, 1e300, 2.0);
  input(0.0, infinity);
  input(0.2, 5.0);
  estimator.estimate(0.4);
  ASSERT_EQ(recorder->nodes.size(), 3u);
  for (const double output : recorder->nodes[1].outputs) EXPECT_TRUE(std::isnan(output));
  EXPECT_TRUE(std::isnan(recorder->nodes[2].outputs[0]));
  EXPECT_EQ(estimator.counts().missing, 4);
  EXPECT_TRUE(std::isnan(recorder->nodes[1].inputs[0]));
  EXPECT_NEAR(recorder->nodes[2].inputs[0], 5.0, 1e-12);
}

TEST_F(Timeline, StatedDeviationsAreWeights) {
  const double y[] = {1.0, 2.0}, sigmas[] = {0.2, nan}, none[] = {0.0, -1.0}, tiny[] = {1e-9, 4.0},
               unknown[] = {infinity, 1.0};
  Estimator weighing(std::make_unique<Recorder>(4, 8), {.longest_interval = 0.2, .output_sigmas = {0.1, 2.0}});
  const std::vector<Recorder::Node>& nodes = dynamic_cast<const Recorder&>(weighing.method()).nodes;
  int k = 0;
  for (const double* each : {sigmas, none, tiny, unknown}) {
    weighing.push_measurement(0.2 * k, y, each);
    weighing.estimate(0.2 * k++);
  }
  ASSERT_EQ(nodes.size(), 4u);
  EXPECT_THAT(nodes[0].weights, ElementsAre(DoubleEq(0.25), 1.0));
  EXPECT_THAT(nodes[1].weights, IsEmpty()) << "what is not above 0 is no deviation";
  EXPECT_THAT(nodes[2].weights, ElementsAre(DoubleEq(1e4), DoubleEq(0.25)));
  EXPECT_TRUE(std::isnan(nodes[3].outputs[0])) << "nothing is known";
  EXPECT_EQ(nodes[3].outputs[1], 2.0);
  EXPECT_EQ(weighing.counts().missing, 1);
  EXPECT_THROW(Estimator(std::make_unique<Recorder>(4, 8), {.output_sigmas = {0.1}}), Error);
  EXPECT_THROW(Estimator(std::make_unique<Recorder>(4, 8), {.output_sigmas = {0.1, 0.0}}), Error);
}

TEST_F(Timeline, StampsThatAreNoTimesAreDropped) {
  for (const double stamp : {nan, infinity, -infinity}) {
    measure(stamp, 1.0);
    input(stamp, 1.0);
  }
  EXPECT_EQ(estimator.counts().dropped, 3);
  measure(0.0, 1.0);
  measure(0.2, 1.0);
  for (const double time : {nan, -infinity}) EXPECT_EQ(estimator.estimate(time).time, 0.0);
  EXPECT_FALSE(estimator.has_started());
  const Estimate& estimate = estimator.estimate(infinity);  // all there is
  EXPECT_EQ(estimate.time, 0.2);
  EXPECT_TRUE(estimate.state.allFinite());
  EXPECT_TRUE(std::isnan(recorder->nodes[1].inputs[0]));
}

TEST_F(Timeline, BeyondTheNewestNodeItIsIntegrated) {
  input(0.0, 0.0);
  measure(0.0, 1.0);
  input(0.1, 2.0);
  const double from[] = {1.0, 0.0};
  double middle[2], expected[2];
  const double first_mean = (0.1 * 0.0 + 0.05 * 2.0) / 0.15, second_mean = 2.0, duration = 0.15;
  Model::Intervals request;
  request.count = 1;
  request.states = from;
  request.inputs = &first_mean;
  request.durations = &duration;
  request.next_states = middle;
  recorder->model().integrate(request);
  request.states = middle;
  request.inputs = &second_mean;
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

/// A prediction knows what was measured of the inputs at each of its parts.
TEST_F(Timeline, AcrossASilenceInputsKeepTheirTimes) {
  input(0.0, 0.0);
  measure(0.0, 0.0);
  input(0.2, 1.0);
  input(0.4, 0.0);
  // An impulse moves the trolley the farther the earlier it comes.
  const double early = estimator.estimate(2.0).state[0];
  estimator = make({.longest_interval = 0.2});
  input(0.0, 0.0);
  measure(0.0, 0.0);
  input(1.6, 1.0);
  input(1.8, 0.0);
  EXPECT_GT(early - estimator.estimate(2.0).state[0], 1e-3);
}

/// An estimator that is always late keeps up, and says that it is late, however long past its deadlines are.
TEST_F(Timeline, WhatADeadlineLeavesNoTimeForWaits) {
  constexpr int rows = 60;
  const auto push_all = [&] {
    for (int k = 0; k < rows; ++k) measure(0.2 * k, k);
  };
  push_all();
  estimator.estimate(0.2 * rows);
  const std::vector<double> expected = durations();
  for (const Clock::time_point past : {Clock::now() - std::chrono::seconds(1), Clock::time_point::min()}) {
    estimator = make({.longest_interval = 0.2, .grace = 0.0});
    push_all();
    std::size_t calls = 0, nodes = 0;
    for (; estimator.estimate(0.2 * rows, past).report.status == Status::deadline && calls < rows; ++calls) {
      EXPECT_GT(recorder->nodes.size(), nodes);
      EXPECT_LE(recorder->nodes.size(), nodes + 2);
      nodes = recorder->nodes.size();
    }
    EXPECT_GT(calls, 10u);
    EXPECT_EQ(durations(), expected);
  }
}

/// However late it is, a call goes on for a while with what waits.
TEST_F(Timeline, ACallThatIsLateHasAGrace) {
  constexpr int rows = 60;
  estimator = make({.longest_interval = 0.2, .grace = 1.0});
  for (int k = 0; k < rows; ++k) measure(0.2 * k, k);
  const Estimate& estimate = estimator.estimate(0.2 * rows, Clock::now() - std::chrono::seconds(1));
  EXPECT_NE(estimate.report.status, Status::deadline);
  EXPECT_GE(recorder->nodes.size(), std::size_t{rows});
}

/// A gap whose nodes are not all made yet is not begun anew; a measurement within the rest of it divides it anew.
TEST_F(Timeline, AGapIsGoneThroughInPieces) {
  constexpr double end = 40.0;
  estimator = make({.longest_interval = 0.2, .grace = 0.0});
  const Clock::time_point past = Clock::now() - std::chrono::seconds(1);
  measure(0.0, 1.0);
  estimator.estimate(0.0);
  measure(end, 2.0);
  int calls = 0;
  while (estimator.estimate(end, past).report.status == Status::deadline && calls < 300) ++calls;
  EXPECT_LT(calls, 200);
  EXPECT_EQ(recorder->nodes.size(), 201u);
  for (std::size_t i = 1; i < recorder->nodes.size(); ++i) EXPECT_NEAR(recorder->nodes[i].duration, 0.2, 1e-9);
  measure(2.0 * end, 3.0);
  estimator.estimate(2.0 * end, past);
  measure(end + 20.1, 2.5);
  while (estimator.estimate(2.0 * end, past).report.status == Status::deadline && calls < 600) ++calls;
  EXPECT_LT(calls, 400);
  double time = 0.0;
  bool is_used = false;
  for (const auto& node : recorder->nodes) {
    time += node.duration;
    is_used = is_used || (std::abs(time - end - 20.1) < 1e-9 && node.outputs[0] == 2.5);
    for (std::size_t k = 0; k < node.times.size(); ++k) is_used = is_used || node.between[2 * k] == 2.5;
  }
  EXPECT_NEAR(time, 2.0 * end, 1e-9);
  EXPECT_TRUE(is_used);
}

/// A late measurement that comes at each call does not keep a late estimator where it is.
TEST_F(Timeline, LateMeasurementsAndDeadlinesTogetherDoNotStopIt) {
  const Clock::time_point past = Clock::now() - std::chrono::seconds(1);
  for (int k = 0; k < 100; ++k) {
    measure(0.2 * k, k);
    if (k > 4) measure(0.2 * (k - 4), nan, k - 4);
    estimator.estimate(0.2 * k, past);
  }
  EXPECT_GE(recorder->nodes.size(), 95u);
  EXPECT_EQ(estimator.counts().dropped, 0);
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
  // Filled and emptied repeatedly, so that the rows wrap around in their buffer.
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
  const auto message = [&](const Estimator::Timeline& timeline) { return error_of([&] { make(timeline); }); };
  EXPECT_THAT(message({.longest_interval = 0.0}), HasSubstr("longest interval"));
  EXPECT_THAT(message({.longest_interval = nan}), HasSubstr("longest interval"));
  EXPECT_THAT(message({.tolerance = -1.0}), HasSubstr("tolerance"));
  EXPECT_THAT(message({.tolerance = 0.5}), HasSubstr("tolerance"));
  EXPECT_THAT(message({.capacity = 0}), HasSubstr("capacity"));
  EXPECT_THAT(message({.grace = -1e-3}), HasSubstr("grace"));
  EXPECT_THAT(message({.grace = nan}), HasSubstr("grace"));
}

TEST(Integration, IsHeldAgainstTwiceAsManySteps) {
  // A trolley that swings with 0.63 rad/s: steps of 0.2 s are exact, those of 5 s are not.
  for (const double interval : {0.2, 5.0}) {
    Estimator estimator(std::make_unique<Recorder>(0, 4), {.longest_interval = 10.0});
    const double outputs[] = {1.0, 2.0};
    for (int k = 0; k < 64; ++k) {
      estimator.push_measurement(interval * k, outputs);
      estimator.estimate(interval * k);
    }
    EXPECT_EQ(estimator.counts().integrated, 4) << interval;
    EXPECT_EQ(estimator.counts().coarse, interval > 1.0 ? 4 : 0) << interval;
    EXPECT_EQ(estimator.counts().coarse_state >= 0, interval > 1.0) << interval;
    estimator.reset();
    EXPECT_EQ(estimator.counts().integrated, 0);
    EXPECT_EQ(estimator.counts().coarse_state, -1);
  }
}

}  // namespace estimator_test
}  // namespace rhec
