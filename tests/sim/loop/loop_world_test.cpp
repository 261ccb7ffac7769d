#include "rhec/sim/loop/loop_world.hpp"

#include <gmock/gmock.h>

#include "rhec/sim/loop/closed_loop.hpp"
#include "rhec/sim/loop/run_files.hpp"
#include "sim/support/figure8.hpp"

namespace rhec::sim {
namespace loop_world_test {

using testing::HasSubstr;

RunLog short_run(std::vector<std::string> assignments) {
  assignments.insert(assignments.end(), {"path.laps=1", "path.radius=12", "estimator.name=ekf"});
  return run_closed_loop(figure8_with(assignments));
}

double largest_error(const RunLog& log, double from, double to) {
  double largest = 0.0;
  for (const Sample& sample : log.samples)
    if (sample.time >= from && sample.time <= to)
      largest = std::max(largest, (sample.state - sample.true_state).head(2).norm());
  return largest;
}

TEST(LoopWorld, AFaultReachesTheEstimatorAndTheLog) {
  const RunLog plain = short_run({}),
               spike = short_run({"faults=[{kind: spike, start: 4, sensors: [x_gps, y_gps], size: 100}]"});
  ASSERT_GT(spike.samples.size(), 25u);
  for (std::size_t k = 0; k < 20; ++k) {
    EXPECT_EQ(spike.samples[k].state, plain.samples[k].state) << "before it, nothing differs: " << k;
    EXPECT_EQ(spike.samples[k].faults, "");
  }
  EXPECT_EQ(spike.samples[20].faults, "spike");
  EXPECT_NE(spike.samples[20].state, plain.samples[20].state);
  EXPECT_EQ(spike.samples[21].faults, "");
}

TEST(LoopWorld, WheelSpinSlowsTheVehicle) {
  const RunLog plain = short_run({}),
               spin = short_run({"faults=[{kind: wheel_spin, start: 3, length: 0.4, sensors: [u1], size: 0.5}]"});
  const auto way = [](const RunLog& log, std::size_t k) {
    return (log.samples[k + 1].true_state - log.samples[k].true_state).head(2).norm();
  };
  EXPECT_EQ(way(spin, 14), way(plain, 14));
  EXPECT_NEAR(way(spin, 15), 0.5 * way(plain, 15), 0.05 * way(plain, 15));
}

TEST(LoopWorld, SensorsMeasureAtTheirRatesAndArriveLate) {
  const Scenario scenario = figure8_with({"sensors.delta.rate=20", "sensors.x_gps={rate: 5, phase: 0.1, latency: 0.05}",
                                          "sensors.y_gps={rate: 5, phase: 0.1, latency: 0.05}", "estimator.name=ekf"});
  const auto estimator = scenario.robot().make_estimator(scenario.initial_state());
  LoopWorld world(scenario, {.outputs = {}, .inputs = {}});
  const std::vector<double> inputs{5.0, 0.0};
  for (int k = 0; k < 20; ++k) {
    const double time = 0.2 * k;
    world.measure(time);
    world.deliver(time, [&](double stamp, const double* outputs) { estimator->push_measurement(stamp, outputs); });
    estimator->estimate(world.on_robots_clock(time));
    world.drive(inputs, time, 0.2);
    estimator->push_input(time, world.measured_inputs(inputs).data());
  }
  // From 0 to 3.8 s: nodes are a step apart, however often there are measurements.
  EXPECT_EQ(estimator->counts().nodes, 20);
  EXPECT_EQ(estimator->counts().dropped, 0);
  EXPECT_EQ(estimator->counts().rejected, 0);
  // Of the angle 20 a second; of the position those at 0.1, 0.3 ... 3.7 s, which are late.
  std::int64_t taken = 0;
  for (const SensorHealth& sensor : estimator->watch()->sensor_states()) taken += sensor.accepted;
  EXPECT_GE(taken, 3.8 * 20);
}

TEST(LoopWorld, ADriveBeginsWithAnEstimateThoughNothingComes) {
  const RunLog log = short_run({"faults=[{kind: silence, start: 0, length: 1}]"});
  ASSERT_GT(log.samples.size(), 10u);
  EXPECT_EQ(log.samples[1].faults, "silence");
  EXPECT_EQ(log.samples[1].state.size(), 4);
  EXPECT_LT(largest_error(log, 0.0, 1.0), 5.0);
}

TEST(LoopWorld, FaultsAreInTheFilesOfARun) {
  const Scenario scenario = figure8_with(
      {"path.laps=1", "path.radius=12", "estimator.name=ekf", "faults=[{kind: doubled, start: 2, length: 1}]"});
  const RunLog log = run_closed_loop(scenario);
  EXPECT_THAT(steps_csv(log, scenario), HasSubstr(",doubled,ok,"));
  const std::string shade = "fill-opacity=\"0.12\"";
  EXPECT_THAT(run_svg(log, scenario), HasSubstr(shade));
  const Scenario plain = figure8_with({"path.laps=1", "path.radius=12", "estimator.name=ekf"});
  EXPECT_THAT(run_svg(run_closed_loop(plain), plain), testing::Not(HasSubstr(shade)));
}

}  // namespace loop_world_test
}  // namespace rhec::sim
