#include "rhec/core/estimation/smoother.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <utility>
#include <vector>

#include "support/late_driver.hpp"
#include "support/linear_case.hpp"

namespace rhec {
namespace smoother_test {

using namespace rhec::testing;

TEST(NodeRecorder, RecordsWhatPassesThrough) {
  const auto model = linear_model<Trolley>();
  const auto log = std::make_shared<NodeLog>();
  RecedingHorizonEstimation::Setup setup = linear_setup(*model, 5, ArrivalKind::ekf, {});
  NodeRecorder recorder(std::make_unique<RecedingHorizonEstimation>(model, gn_rti(), setup), log);
  Estimate estimate = empty_estimate(*model);
  const auto samples = simulate(*model, 9, false, 3);
  LateDriver driver(recorder);
  for (int round = 0; round < 2; ++round) {
    for (std::size_t k = 0; k < samples.size(); ++k) {
      if (k == 0) driver.start(samples[k].outputs.data());
      if (k > 0) driver.add_node(samples[k].duration, samples[k].inputs.data(), samples[k].outputs.data());
      recorder.estimate(estimate, Clock::time_point::max());
      EXPECT_EQ(log->states[2 * k], estimate.state[0]);
      EXPECT_EQ(log->states[2 * k + 1], estimate.state[1]);
    }
    const NodeLog expected = log_of(*model, samples);
    EXPECT_EQ(log->durations, expected.durations);
    EXPECT_EQ(log->inputs, expected.inputs);
    for (std::size_t k = 0; k < expected.outputs.size(); ++k)
      EXPECT_TRUE(log->outputs[k] == expected.outputs[k] ||
                  (std::isnan(log->outputs[k]) && std::isnan(expected.outputs[k])));
    // A late measurement changes what it has, and what it lacks stays.
    const double before = log->outputs[2 * 7 + 1];
    const double late[] = {0.25, nan};
    ASSERT_TRUE(driver.amend(2, late));
    EXPECT_EQ(log->outputs[2 * 7], 0.25);
    EXPECT_TRUE(log->outputs[2 * 7 + 1] == before || std::isnan(before));
    EXPECT_FALSE(driver.amend(100, late));
    recorder.reset();
    EXPECT_EQ(log->intervals(), 0);
    EXPECT_TRUE(log->outputs.empty());
  }
}

TEST(StateAt, IntegratesFromTheNodeBefore) {
  const auto model = linear_model<Boat>();
  SmoothedRun run;
  run.times = {0.0, 0.5, 0.9};
  run.states = {1.0, 0.5, 0.2, 9.0, 8.0, 7.0, 3.0, 2.0, 1.0};
  run.inputs = {0.3, -0.4};
  run.start_parameters = {0.1, 0.2};
  run.parameters = {0.1, 0.6};  // the second interval is a ramp
  std::vector<double> state(3), expected(3);
  for (const auto& [time, node] :
       std::vector<std::pair<double, int>>{{-1.0, 0}, {0.0, 0}, {0.5, 1}, {0.9, 2}, {7.0, 2}}) {
    state_at(run, *model, 1, time, state.data());
    for (int j = 0; j < 3; ++j) EXPECT_EQ(state[j], run.states[3 * node + j]) << time;
  }
  // Three quarters into the ramp, the parameter has gone three quarters of its way.
  const double duration = 0.3, end = 0.2 + 0.75 * 0.4;
  Model::Intervals request;
  request.count = 1;
  request.states = run.states.data() + 3;
  request.inputs = run.inputs.data() + 1;
  request.parameters = run.start_parameters.data() + 1;
  request.parameters_end = &end;
  request.durations = &duration;
  request.next_states = expected.data();
  model->integrate(request);
  state_at(run, *model, 1, 0.8, state.data());
  for (int j = 0; j < 3; ++j) EXPECT_NEAR(state[j], expected[j], 1e-12);
}

TEST(ParametersAt, AreThoseOfTheIntervalAndOfTheRampsCourse) {
  SmoothedRun run;
  run.times = {0.0, 0.5, 0.9};
  run.start_parameters = {0.1, 1.0, 0.2, 2.0};
  run.parameters = {0.1, 1.0, 0.6, 2.0};  // the first parameter ramps on the second interval
  const auto at = [&](double time) {
    std::vector<double> parameters(2);
    parameters_at(run, 2, time, parameters.data());
    return parameters;
  };
  EXPECT_EQ(at(-1.0), (std::vector<double>{0.1, 1.0}));
  EXPECT_EQ(at(0.3), (std::vector<double>{0.1, 1.0}));
  EXPECT_NEAR(at(0.8)[0], 0.2 + 0.75 * 0.4, 1e-12);
  EXPECT_EQ(at(0.8)[1], 2.0);
  EXPECT_EQ(at(7.0), (std::vector<double>{0.6, 2.0}));
}

}  // namespace smoother_test
}  // namespace rhec
