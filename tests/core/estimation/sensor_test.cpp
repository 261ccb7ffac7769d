#include "rhec/core/estimation/sensor.hpp"

#include <gtest/gtest.h>

#include <string>

namespace rhec {
namespace sensor_test {

Variable variable(const char* name, const char* unit) {
  Variable result;
  result.name = name;
  result.unit = unit;
  return result;
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

TEST(Sensors, WhatIsMeasuredTwiceIsSeenByTwo) {
  ModelDescription about;
  for (const char* name : {"x", "y", "x_2", "y_2"}) {
    about.outputs.push_back(variable(name, "m"));
    about.outputs.back().device = std::string(name).ends_with("_2");
  }
  const std::vector<Sensor> sensors = sensors_of(about, {0.01, 0.01, 0.01, 0.01});
  ASSERT_EQ(sensors.size(), 2u);
  EXPECT_EQ(sensors[0].outputs, (std::vector<int>{0, 1}));
  EXPECT_EQ(sensors[1].name, "x_2 and y_2");
}

TEST(Sensors, NoSensorHasMoreOutputsThanFit) {
  ModelDescription about;
  about.outputs.assign(2 * most_sensor_outputs + 1, variable("y", "m"));
  const std::vector<Sensor> sensors = sensors_of(about, std::vector<double>(about.outputs.size(), 1.0));
  ASSERT_EQ(sensors.size(), 3u);
  EXPECT_EQ(sensors[2].outputs.size(), 1u);
}

}  // namespace sensor_test
}  // namespace rhec
