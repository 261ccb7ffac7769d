#include "rhec/core/estimation/health.hpp"

#include <gtest/gtest.h>

#include <set>

namespace rhec {
namespace health_test {

Variable variable(const char* name, const char* unit) {
  Variable result;
  result.name = name;
  result.unit = unit;
  return result;
}

TEST(Health, InWords) {
  const std::vector<Sensor> sensors{{"x_gps and y_gps", {0, 1}}, {"delta", {2}}};
  Health health;
  health.sensors.resize(2);
  EXPECT_EQ(in_words(health, sensors), "ok");
  health.level = HealthLevel::degraded;
  health.sensors[0].reasons = reason::rejected | reason::moved;
  health.inputs.reasons = reason::implausible;
  EXPECT_EQ(in_words(health, sensors), "degraded: x_gps and y_gps rejected and moved; inputs implausible");
  health = {.level = HealthLevel::lost, .reasons = reason::uncertain, .sensors = health.sensors, .inputs = {}};
  EXPECT_EQ(in_words(health, sensors), "lost: uncertain; x_gps and y_gps rejected and moved");
}

TEST(Health, EveryReasonHasAWordOfItsOwn) {
  std::set<std::string> words;
  for (const std::uint32_t each : reason::all) words.insert(name_of_reason(each));
  EXPECT_EQ(words.size(), std::size(reason::all));
  EXPECT_FALSE(words.contains(""));
}

TEST(Sensors, OutputsOfOneUnitAndNoiseAreOneSensor) {
  ModelDescription about;
  about.outputs = {variable("x", "m"), variable("psi", "rad"), variable("y", "m"), variable("range", "m")};
  const std::vector<Sensor> sensors = sensors_of(about, {0.01, 0.02, 0.01, 0.03});
  ASSERT_EQ(sensors.size(), 3u);
  EXPECT_EQ(sensors[0].name, "x and y");
  EXPECT_EQ(sensors[0].outputs, (std::vector<int>{0, 2}));
  EXPECT_EQ(sensors[1].name, "psi");
  EXPECT_EQ(sensors[2].outputs, (std::vector<int>{3}));
}

TEST(Sensors, NoSensorHasMoreOutputsThanFit) {
  ModelDescription about;
  about.outputs.assign(2 * most_sensor_outputs + 1, variable("y", "m"));
  const std::vector<Sensor> sensors = sensors_of(about, std::vector<double>(about.outputs.size(), 1.0));
  ASSERT_EQ(sensors.size(), 3u);
  EXPECT_EQ(sensors[2].outputs.size(), 1u);
}

}  // namespace health_test
}  // namespace rhec
