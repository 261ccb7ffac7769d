#include "rhec/sim/world/sensor_schedule.hpp"

#include <gmock/gmock.h>

#include <cmath>

#include "rhec/plugins/yaml/yaml.hpp"
#include "sim/support/bicycle.hpp"
#include "support/error_of.hpp"

namespace rhec::sim {
namespace sensor_schedule_test {

using testing::ElementsAre;
using testing::HasSubstr;

SensorSchedule schedule_of(const std::string& yaml) {
  return SensorSchedule(read_sensor_timings(parse_yaml(yaml, "sensors.yaml"), Bicycle().description()));
}

/// Which of x, y and delta measure at a time.
std::vector<bool> due(const SensorSchedule& schedule, double time, bool is_sample) {
  std::vector<double> outputs(3, 0.0);
  schedule.keep_due(time, is_sample, outputs);
  std::vector<bool> all;
  for (const double value : outputs) all.push_back(!std::isnan(value));
  return all;
}

TEST(SensorSchedule, WithoutRatesAllMeasureAtSamples) {
  const SensorSchedule schedule = schedule_of("{}");
  EXPECT_TRUE(std::isinf(schedule.next_after(0.0)));
  EXPECT_THAT(due(schedule, 0.4, true), ElementsAre(true, true, true));
  EXPECT_THAT(schedule.latencies(), ElementsAre(0.0));
}

TEST(SensorSchedule, ARateIsKeptWhateverTheLoopDoes) {
  const SensorSchedule schedule = schedule_of("{x: {rate: 5, phase: 0.13}, delta: {rate: 20}}");
  EXPECT_THAT(due(schedule, 0.0, true), ElementsAre(false, true, true));
  EXPECT_THAT(due(schedule, 0.13, false), ElementsAre(true, false, false));
  EXPECT_THAT(due(schedule, 0.35, false), ElementsAre(false, false, true));
  int x = 0, delta = 0;
  for (double time = 0.0; time < 100.0; time = schedule.next_after(time)) {
    x += due(schedule, time, false)[0];
    delta += due(schedule, time, false)[2];
  }
  EXPECT_EQ(x, 500);
  EXPECT_EQ(delta, 2000);
}

TEST(SensorSchedule, LatenciesPartTheOutputs) {
  const SensorSchedule schedule = schedule_of("{x: {latency: 0.25}, y: {latency: 0.25}}");
  EXPECT_THAT(schedule.latencies(), ElementsAre(0.0, 0.25));
  std::vector<double> outputs(3, 1.0);
  schedule.keep_latency(0.25, outputs);
  EXPECT_EQ(outputs[0], 1.0);
  EXPECT_TRUE(std::isnan(outputs[2]));
}

TEST(SensorSchedule, MistakesAreTold) {
  EXPECT_THAT(error_of([] { schedule_of("{delt: {rate: 5}}"); }), HasSubstr("did you mean 'delta'"));
  EXPECT_THAT(error_of([] { schedule_of("{x: {rat: 5}}"); }), HasSubstr("did you mean 'rate'"));
  EXPECT_THAT(error_of([] { schedule_of("{x: {latency: -1}}"); }), HasSubstr("sensors.yaml:1"));
}

}  // namespace sensor_schedule_test
}  // namespace rhec::sim
