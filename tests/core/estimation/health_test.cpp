#include "rhec/core/estimation/health.hpp"

#include <gtest/gtest.h>

#include <set>

namespace rhec {
namespace health_test {

TEST(Health, InWords) {
  const std::vector<Sensor> sensors{{"x_gps and y_gps", {0, 1}}, {"delta", {2}, "rad"}};
  Health health;
  health.sensors.resize(2);
  EXPECT_EQ(in_words(health, sensors), "ok");
  health.level = HealthLevel::degraded;
  health.sensors[0].reasons = reason::rejected | reason::moved;
  health.inputs.reasons = reason::implausible;
  EXPECT_EQ(in_words(health, sensors), "degraded: x_gps and y_gps rejected and moved; inputs implausible");
  health.sensors[1] = {.reasons = reason::off, .accepted = 3, .rejected = 0, .offset = -0.0517};
  EXPECT_EQ(in_words(health, sensors),
            "degraded: x_gps and y_gps rejected and moved; delta off by about -0.052 rad; inputs implausible");
  health.sensors[1].rival = 0;
  EXPECT_EQ(in_words(health, sensors),
            "degraded: x_gps and y_gps rejected and moved; delta off by about -0.052 rad from x_gps and y_gps; inputs "
            "implausible");
  health.sensors[1].offset = 0.0;
  EXPECT_EQ(in_words(health, sensors),
            "degraded: x_gps and y_gps rejected and moved; delta was off from x_gps and y_gps; inputs implausible");
  health.sensors[1] = {};
  health.inputs = {.reasons = reason::implausible | reason::off, .offset = 0.234};
  health.off_input = 1;
  EXPECT_EQ(in_words(health, sensors, {{"v", {}, "m/s"}, {"omega", {}, "rad/s"}}),
            "degraded: x_gps and y_gps rejected and moved; inputs implausible; input omega off by about 0.23 rad/s");
  EXPECT_EQ(in_words(health, sensors), "degraded: x_gps and y_gps rejected and moved; inputs implausible and off");
  health.inputs.offset = 0.0;
  health.off_input = -1;
  EXPECT_EQ(in_words(health, sensors), "degraded: x_gps and y_gps rejected and moved; inputs implausible and were off");
  health = {.level = HealthLevel::lost, .reasons = reason::uncertain, .sensors = health.sensors, .inputs = {}};
  EXPECT_EQ(in_words(health, sensors), "lost: uncertain; x_gps and y_gps rejected and moved");
}

TEST(Health, EveryReasonHasAWordOfItsOwn) {
  std::set<std::string> words;
  for (const std::uint32_t each : reason::all) words.insert(name_of_reason(each));
  EXPECT_EQ(words.size(), std::size(reason::all));
  EXPECT_FALSE(words.contains(""));
}

}  // namespace health_test
}  // namespace rhec
