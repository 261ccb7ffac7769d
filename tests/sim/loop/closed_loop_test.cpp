// What a closed loop tells of its parts: each sample's in their order, and nothing of the run changes.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <string>
#include <vector>

#include "rhec/plugins/yaml/yaml.hpp"
#include "rhec/sim/loop/closed_loop.hpp"
#include "rhec/sim/loop/run_files.hpp"
#include "support/temporary_folder.hpp"

namespace rhec::sim {
namespace closed_loop_test {

Scenario scenario_with(const std::vector<std::string>& assignments) {
  Settings settings = load_yaml(SCENARIOS "/figure8.yaml");
  for (const std::string& assignment : assignments) apply_assignment(settings, assignment);
  return {Host(), settings};
}

class LoopParts : public testing::TestWithParam<const char*> {};

TEST_P(LoopParts, BeginInTheirOrderSampleBySample) {
  const Scenario scenario = scenario_with({"path.laps=1", "speed=10", GetParam()});
  std::vector<LoopPart> told;
  LoopHooks hooks;
  hooks.begins = [&told](LoopPart part) { told.push_back(part); };
  const RunLog log = run_closed_loop(scenario, hooks);
  ASSERT_TRUE(log.completed) << log.ended;

  using enum LoopPart;
  std::vector<LoopPart> expected;
  for (std::size_t k = 0; k < log.samples.size(); ++k) {
    expected.insert(expected.end(), {simulate, estimate, control, log_sample});
    if (k + 1 == log.samples.size()) break;
    expected.insert(expected.end(), {simulate, prepare_control, prepare_estimate});
  }
  expected.push_back(end);
  EXPECT_EQ(told, expected);
  EXPECT_EQ(steps_csv(log, scenario), steps_csv(run_closed_loop(scenario), scenario));
}
INSTANTIATE_TEST_SUITE_P(Estimators, LoopParts, testing::Values("estimator.name=rhe", "estimator.name=truth"));

TEST(LoopTimes, FeedbackIsPartOfTheEstimatorsTime) {
  const Scenario scenario = scenario_with({"path.laps=1", "speed=10"});
  for (const Sample& sample : run_closed_loop(scenario).samples) {
    EXPECT_GT(sample.estimator_feedback_us, 0.0);
    EXPECT_GE(sample.estimator_us, sample.estimator_feedback_us);
  }
}

TEST(SmallRobots, FinishAllLapsOfCirclesThatAreShorterThanTheWindowOfTheirFollower) {
  for (const double speed : {0.1, 0.3}) {
    Settings settings = load_yaml(SCENARIOS "/unicycle_traction.yaml");
    apply_assignment(settings, "path={name: figure8, radius: 0.3, laps: 3, spacing: 0.02}");
    apply_assignment(settings, "speed=" + std::to_string(speed));
    const Scenario scenario(Host(), settings);
    const RunLog log = run_closed_loop(scenario);
    ASSERT_TRUE(log.completed) << log.ended;
    const auto samples = static_cast<double>(log.samples.size());
    EXPECT_NEAR(samples * scenario.robot().step(), scenario.path().duration(), 0.1 * scenario.path().duration());
    for (const Sample& sample : log.samples) ASSERT_LT(std::abs(sample.tracking), 0.15) << "at " << sample.time << " s";
  }
}

// An obstacle right before the vehicle that costs too little to stop for is driven through, and that is told.
TEST(Limits, ThatWereNotKeptAreTold) {
  const std::string path = "path={name: zigzag, legs: 1, leg_length: 30}";
  const PathPoint start = scenario_with({path}).path().point_at(0.0);
  const Scenario scenario = scenario_with(
      {path, "speed=3", "estimator.name=truth",
       "controller.terms=[{name: corridor, left: 9, right: 9}, {name: obstacles, soft: {linear: 1}, obstacles: [{x: " +
           std::to_string(start.x + 2.0 * std::cos(start.heading)) +
           ", y: " + std::to_string(start.y + 2.0 * std::sin(start.heading)) + ", radius: 1.5}]}]"});
  const RunSummary summary = summarise(run_closed_loop(scenario), scenario);
  ASSERT_EQ(summary.limits.size(), 2U);
  EXPECT_EQ(summary.limits.at("corridor: lateral").violated, 0);
  const LimitRecord& record = summary.limits.at("obstacles: obstacle 1");
  EXPECT_GT(record.violated, 0);
  EXPECT_LT(record.violated, summary.steps / 2);
  EXPECT_GT(record.most, 0.5) << "m";
  EXPECT_THAT(summary_json(summary), testing::HasSubstr("\"obstacles: obstacle 1\": {"));
  EXPECT_TRUE(summarise(run_closed_loop(scenario_with({path})), scenario_with({path})).limits.empty());
}

TEST(Ends, ARobotThatOnlyTakesItselfToBeAtTheEndIsNotThere) {
  // Dead reckoning, on wheels that slip more than it believes.
  Settings settings = parse_yaml(R"(
speed: 4
model: {name: bicycle_slip, outputs: [delta]}
noise: {outputs: {delta: 0.001}, inputs: {u1: 0.001, u2: 0.001}}
estimator: {name: ekf, health: {watch: false}, initial: {parameters: {kappa: 0.9, mu: 1}, sigma: {kappa: 0.001, mu: 0.001}}}
path: {name: zigzag}
terrain: {name: constant, values: {kappa: 0.87, mu: 1}}
)",
                                 "blind.yaml");
  const RunLog log = run_closed_loop({Host(), settings});
  EXPECT_FALSE(log.completed);
  EXPECT_THAT(log.ended, testing::HasSubstr("takes itself to be at the end of the path, and is "));
  // Nor if the path ends in a stop.
  const TemporaryFolder folder;
  const std::string file = folder.put("ends_in_a_stop.csv", "x,y,speed\n0,0,4\n150,0,4\n300,0,0\n").string();
  apply_assignment(settings, "path={name: file, file: " + file + "}");
  const RunLog stopped = run_closed_loop({Host(), settings});
  EXPECT_FALSE(stopped.completed);
  EXPECT_THAT(stopped.ended, testing::HasSubstr("takes itself to be at the end of the path, and is "));
}

TEST(Ends, AVehicleThatPassesTheEndFarBesideItIsNotThere) {
  // Far too fast for a path whose reference does not wait.
  Settings settings = load_yaml(SCENARIOS "/figure8.yaml");
  for (const char* assignment : {"speed=40", "controller.reference_speed=literal", "estimator.name=truth"})
    apply_assignment(settings, assignment);
  const RunLog log = run_closed_loop({Host(), settings});
  EXPECT_FALSE(log.completed);
  EXPECT_THAT(log.ended, testing::HasSubstr("has passed the end of the path "));
  EXPECT_GT(std::abs(log.samples.back().tracking), 10.0);
}

TEST(Ends, AVehicleThatSomethingIsInTheWayOfStands) {
  Settings settings = parse_yaml(R"(
speed: 2
model: {name: bicycle_slip}
estimator: {name: truth}
path: {name: zigzag, legs: 1, leg_length: 30}
terrain: {name: constant, values: {kappa: 0.9, mu: 0.9}}
controller:
  terms:
    - {name: corridor, left: 1, right: 1, hard: true}
    - {name: obstacles, hard: true, obstacles: [{x: 20, y: -20, radius: 2}]}
)",
                                 "blocked.yaml");
  const RunLog log = run_closed_loop({Host(), settings});
  EXPECT_FALSE(log.completed);
  EXPECT_THAT(log.ended, testing::HasSubstr("the vehicle stands where its path goes on"));
  EXPECT_LT(log.samples.back().true_state[0], 20.0);
}

TEST(Headlands, AreDrivenInReverse) {
  for (const int seed : {71, 72}) {
    Settings settings = load_yaml(SCENARIOS "/headland.yaml");
    apply_assignment(settings, "seed=" + std::to_string(seed));
    const Scenario scenario(Host(), settings);
    ASSERT_EQ(scenario.path().section_count(), 7) << "three fishtails";
    const RunLog log = run_closed_loop(scenario);
    ASSERT_TRUE(log.completed) << log.ended;
    const RunSummary summary = summarise(log, scenario);
    EXPECT_LT(summary.mae.tracking, 0.15);
    EXPECT_LT(summary.nees, 1.5 * summary.nees_expected) << "at stops, too, the covariance is honest";
    EXPECT_EQ(summary.fallbacks, 0);
    double in_reverse = 0.0;
    for (const Sample& sample : log.samples) {
      if (sample.inputs[0] < -0.05) in_reverse += scenario.robot().step();
      ASSERT_TRUE(sample.sigma.allFinite());
      EXPECT_LT(std::abs(sample.heading_error), 0.5) << sample.time;
    }
    EXPECT_GT(in_reverse, 10.0) << "seconds, of three times 7 m";
  }
}

TEST(Headlands, StartsAreOnTheLapAndTheBranchThatTheArcLengthSays) {
  // On the second lap, and where both circles touch, on the way into the second one.
  for (const char* start : {"path.start=200", "path.start=62.84"}) {
    const Scenario scenario =
        scenario_with({"path.laps=2", "path.radius=10", "path.acceleration=10", "speed=4", start});
    const RunLog log = run_closed_loop(scenario);
    ASSERT_TRUE(log.completed) << log.ended;
    const double rest = scenario.path().length() - scenario.start();
    EXPECT_NEAR(static_cast<double>(log.samples.size()) * scenario.robot().step(), rest / 4.0, 5.0) << start;
    for (const Sample& sample : log.samples) ASSERT_LT(std::abs(sample.tracking), 2.0) << start << ", " << sample.time;
  }
}

TEST(Headlands, StartsMayBeAnywhereOnThePath) {
  const Scenario scenario = scenario_with({"path.laps=1", "speed=4", "path.start=60"});
  const RunLog log = run_closed_loop(scenario);
  ASSERT_TRUE(log.completed) << log.ended;
  const double rest = scenario.path().length() - 60.0;
  EXPECT_NEAR(static_cast<double>(log.samples.size()) * scenario.robot().step(), rest / 4.0, 5.0);
  for (const Sample& sample : log.samples) EXPECT_LT(std::abs(sample.tracking), 2.0) << sample.time;
}

/// Of a sensor's bias over a drive: the share of samples that are within two standard deviations, and the last sigma.
struct Recovery {
  double inside, sigma;
};
Recovery recovery_of(const char* file, std::vector<std::string> assignments) {
  Settings settings = load_yaml(std::string(SCENARIOS) + "/" + file);
  for (const std::string& assignment : assignments) apply_assignment(settings, assignment);
  const Scenario scenario(Host(), settings);
  const RunLog log = run_closed_loop(scenario);
  EXPECT_TRUE(log.completed) << log.ended;
  const auto bias = std::ssize(scenario.robot().model()->description().states);
  EXPECT_EQ(scenario.robot().estimated_description().states.back().name, "yaw_rate_bias");
  EXPECT_EQ(log.samples.back().state.size(), bias + 1);
  return {summarise(log, scenario).within_two_sigma.at("yaw_rate_bias"), log.samples.back().sigma[bias]};
}

TEST(Gyros, HaveTheirDriftingBiasRecovered) {
  for (const char* estimator : {"rhe", "bank", "ekf"}) {
    double inside = 0.0;
    for (const int seed : {1, 2, 3}) {
      const Recovery found = recovery_of(
          "gyro.yaml", {"path.laps=1", "seed=" + std::to_string(seed), std::string("estimator.name=") + estimator});
      inside += found.inside / 3.0;
      EXPECT_LT(found.sigma, 0.005) << "a tenth of what it was";
    }
    EXPECT_GT(inside, 0.88) << estimator;
  }
  const Recovery found =
      recovery_of("skid_steer.yaml", {"model.outputs=[x_gps, y_gps, heading, yaw_rate]", "noise.outputs.yaw_rate=0.01",
                                      "noise.biases={yaw_rate: {sigma: 0.05, drift: 0.002}}"});
  EXPECT_LT(found.sigma, 0.005);
  EXPECT_GT(found.inside, 0.88);
}

}  // namespace closed_loop_test
}  // namespace rhec::sim
