#include "apps/ros/simulation/sensor_messages.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>

#include "apps/ros/node/intake.hpp"
#include "rhec/core/base/error.hpp"
#include "rhec/plugins/yaml/yaml.hpp"

namespace rhec::apps::ros::sensor_messages_test {
namespace {

constexpr double missing = std::numeric_limits<double>::quiet_NaN();
constexpr logs::Stamp now = 1'700'000'000'000'000'000;

ModelDescription vehicle() {
  ModelDescription about;
  about.name = "vehicle";
  about.outputs = {{.name = "x", .unit = "m", .meaning = ""},
                   {.name = "y", .unit = "m", .meaning = ""},
                   {.name = "heading", .unit = "rad", .meaning = "", .is_angle = true}};
  about.inputs = {{.name = "speed", .unit = "m/s", .meaning = ""}, {.name = "turn", .unit = "rad/s", .meaning = ""}};
  return about;
}

// Every form, unit, sign, offset and delay: what is written is read as what it was.
TEST(SensorMessages, AreReadAsWhatWasMeasured) {
  const Settings signals = parse_yaml(R"(
origin: [51.0, 7.0, 100.0]
outputs:
  x: {from: /fix, as: east}
  y: {from: /fix, as: north}
  heading: {from: "/imu:orientation", as: heading, sign: -1, offset: 0.5, delay: 0.05}
inputs:
  speed: {from: ["/joint_states:velocity[left]", "/joint_states:velocity[right]"], as: mean, unit: rpm, radius: 0.2}
  turn: {from: ["/joint_states:velocity[left]", "/joint_states:velocity[right]"], as: turn, unit: rpm, radius: 0.2, track: 0.6}
)",
                                      "test");
  const LiveTopics topics(signals, Settings(), {});
  const logs::SignalMap map(signals, vehicle());
  SensorMessages sensors(topics, map, "base_link");
  Intake intake(topics, map, vehicle(), {});
  std::vector<logs::SignalRow> rows;
  const auto read = [&](int topic, std::span<const std::byte> message) {
    const auto taken = intake.take(topic, message, now);
    rows.insert(rows.end(), taken.begin(), taken.end());
  };
  const std::array outputs{123.25, -45.5, 1.25}, inputs{1.5, -0.75, 0.0};
  sensors.write(true, now, outputs.data(), read);
  sensors.write(false, now, inputs.data(), read);
  std::vector<double> found(5, missing);
  for (const logs::SignalRow& row : rows) {
    EXPECT_EQ(row.stamp, now);
    for (std::size_t j = 0; j < row.values.size(); ++j)
      if (!std::isnan(row.values[j])) found[row.is_output ? j : 3 + j] = row.values[j];
  }
  EXPECT_NEAR(found[0], 123.25, 1e-6);
  EXPECT_NEAR(found[1], -45.5, 1e-6);
  EXPECT_NEAR(found[2], 1.25, 1e-12);
  EXPECT_NEAR(found[3], 1.5, 1e-12);
  EXPECT_NEAR(found[4], -0.75, 1e-12);
}

TEST(SensorMessages, WhatIsNotMeasuredIsNotSent) {
  const Settings signals = parse_yaml(
      "{outputs: {x: {from: /fix, as: east}, y: none, heading: '/joint_states:position[h]'}, "
      "inputs: {speed: none, turn: none}}",
      "test");
  const LiveTopics topics(signals, Settings(), {});
  SensorMessages sensors(topics, logs::SignalMap(signals, vehicle()), "base_link");
  EXPECT_TRUE(sensors.is_made(topics.topic("/fix")));
  EXPECT_FALSE(sensors.is_made(topics.topic(logs::inputs_topic)));
  int count = 0;
  const std::array outputs{missing, 1.0, 0.5};
  sensors.write(true, now, outputs.data(), [&](int topic, std::span<const std::byte>) {
    ++count;
    EXPECT_EQ(topic, topics.topic("/joint_states"));
  });
  EXPECT_EQ(count, 1);
}

TEST(SensorMessages, RefusesDerivatives) {
  const Settings signals = parse_yaml(
      "{outputs: {x: {from: /fix, as: east}, y: none, heading: none}, inputs: {speed: {from: "
      "'/odom:pose.pose.position.x', derivative: true}, turn: none}}",
      "test");
  const LiveTopics topics(signals, Settings(), {});
  EXPECT_THROW(SensorMessages(topics, logs::SignalMap(signals, vehicle()), "base_link"), Error);
}

}  // namespace
}  // namespace rhec::apps::ros::sensor_messages_test
