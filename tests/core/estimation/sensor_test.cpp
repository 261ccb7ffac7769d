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

TEST(Sensors, CoordinatesOfOneNoiseAreOneSensor) {
  ModelDescription about;
  about.outputs = {variable("x", "m"), variable("psi", "rad"), variable("y", "m"), variable("range", "m")};
  const std::vector<Sensor> sensors = sensors_of(about, {0.01, 0.02, 0.01, 0.03});
  ASSERT_EQ(sensors.size(), 3u);
  EXPECT_EQ(sensors[0].name, "x and y");
  EXPECT_EQ(sensors[0].outputs, (std::vector<int>{0, 2}));
  EXPECT_EQ(sensors[1].name, "psi");
  EXPECT_EQ(sensors[2].outputs, (std::vector<int>{3}));
}

/// Of a tractor and its trailer, say, with receivers and encoders that are stated alike.
TEST(Sensors, WhatCanFailByItselfIsASensorByItself) {
  ModelDescription about;
  about.outputs = {variable("x_front", "m"), variable("x_rear", "m"),        variable("y_front", "m"),
                   variable("y_rear", "m"),  variable("steering", "rad"),    variable("hitch", "rad"),
                   variable("vx", "m/s"),    variable("wheel_speed", "m/s"), variable("vy", "m/s")};
  const std::vector<Sensor> sensors = sensors_of(about, std::vector<double>(about.outputs.size(), 0.01));
  ASSERT_EQ(sensors.size(), 6u);
  EXPECT_EQ(sensors[0].name, "x_front and y_front");
  EXPECT_EQ(sensors[1].name, "x_rear and y_rear");
  EXPECT_EQ(sensors[2].name, "steering");
  EXPECT_EQ(sensors[3].name, "hitch");
  EXPECT_EQ(sensors[4].name, "vx and vy");
  EXPECT_EQ(sensors[5].name, "wheel_speed");
}

TEST(Sensors, CoordinatesMayHaveAnyNames) {
  ModelDescription about;
  about.states = {variable("easting", "km")};
  about.roles.position_x = 0;
  about.outputs = {variable("east", "km"), variable("depth", "m"), variable("north", "km"), variable("height", "m")};
  const std::vector<Sensor> sensors = sensors_of(about, std::vector<double>(about.outputs.size(), 0.01));
  ASSERT_EQ(sensors.size(), 3u);
  EXPECT_EQ(sensors[0].name, "east and north");
  EXPECT_EQ(sensors[1].name, "depth");
  EXPECT_EQ(sensors[2].name, "height");
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
  about.outputs.assign(7, variable("y", "m"));
  EXPECT_EQ(sensors_of(about, std::vector<double>(7, 1.0)).size(), 4u);
  about.outputs = {variable("x_gps", "m"), variable("y_gps", "m"), variable("z_gps", "m"), variable("z", "m")};
  const std::vector<Sensor> sensors = sensors_of(about, std::vector<double>(4, 1.0));
  ASSERT_EQ(sensors.size(), 2u);
  EXPECT_EQ(sensors[0].outputs, (std::vector<int>{0, 1, 2}));
  EXPECT_EQ(std::ssize(sensors[0].outputs), most_sensor_outputs);
}

}  // namespace sensor_test
}  // namespace rhec
