#include "apps/ros/node/intake.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "apps/ros/messages/message_writer.hpp"
#include "rhec/core/base/error.hpp"
#include "rhec/plugins/yaml/yaml.hpp"

namespace rhec::apps::ros::intake_test {
namespace {

constexpr logs::Stamp second = 1'000'000'000, now = 1'700'000'000 * second;

ModelDescription vehicle() {
  ModelDescription about;
  about.name = "vehicle";
  about.outputs = {{.name = "x", .unit = "m", .meaning = ""},
                   {.name = "y", .unit = "m", .meaning = ""},
                   {.name = "angle", .unit = "rad", .meaning = "", .lower = -1.0, .upper = 1.0}};
  about.inputs = {{.name = "speed", .unit = "m/s", .meaning = ""}};
  return about;
}

class IntakeTest : public testing::Test {
 protected:
  int topic(const std::string& name) const { return topics_.topic(name); }
  MessageWriter message(const std::string& name) const { return MessageWriter(topics_.message_type(topic(name))); }
  std::size_t rows(const std::string& name, std::span<const std::byte> bytes) {
    return intake_.take(topic(name), bytes, now).size();
  }
  std::int64_t refused(const std::string& name, Refusal why) const {
    return intake_.counts()[static_cast<std::size_t>(topic(name))].refused[static_cast<std::size_t>(why)];
  }
  std::size_t fix(double latitude, int status, double variance, int covariance_type, logs::Stamp stamp = now,
                  const char* frame = "gps") {
    MessageWriter writer = message("/fix");
    writer.set("latitude", latitude);
    writer.set("longitude", 7.0);
    writer.set("altitude", 100.0);
    writer.set("status.status", status);
    writer.set("position_covariance[0]", variance);
    writer.set("position_covariance_type", covariance_type);
    return rows("/fix", writer.write(stamp, frame));
  }

  Settings signals_ = parse_yaml(R"(
outputs:
  x: {from: /fix, as: east}
  y: {from: /fix, as: north}
  angle: "/joint_states:position[steer]"
inputs: {speed: "/joint_states:velocity[wheel]"}
)",
                                 "test");
  LiveTopics topics_{signals_, Settings(), {}};
  Intake intake_{topics_, logs::SignalMap(signals_, vehicle()), vehicle(), {.behind = 2.0, .ahead = 0.2}};
};

TEST_F(IntakeTest, GoodMessagesBecomeRows) {
  ASSERT_EQ(fix(51.0, 0, 0.0, 0), 1u);
  const auto found = [&] {
    MessageWriter writer = message("/joint_states");
    writer.set("position[steer]", 0.25);
    writer.set("velocity[wheel]", 2.0);
    const auto taken = intake_.take(topic("/joint_states"), writer.write(now, ""), now);
    return std::vector<logs::SignalRow>(taken.begin(), taken.end());
  }();
  ASSERT_EQ(found.size(), 2u);
  EXPECT_TRUE(found[0].is_output);
  EXPECT_EQ(found[0].values[2], 0.25);
  EXPECT_EQ(found[1].values[0], 2.0);
  EXPECT_EQ(found[1].stamp, now);
  EXPECT_EQ(intake_.measured(), (std::vector<bool>{true, true, true}));
}

TEST_F(IntakeTest, ConditionsLeaveMessagesOut) {
  const Settings good = parse_yaml(R"(
outputs:
  x: {from: /fix, as: east, when: {of: "/fix:status.status", at_least: 2}}
  y: {from: /fix, as: north, when: {of: "/fix:status.status", at_least: 2}}
  angle: none
inputs: {speed: "/joint_states:velocity[wheel]"}
)",
                                   "test");
  const LiveTopics topics(good, Settings(), {});
  Intake intake(topics, logs::SignalMap(good, vehicle()), vehicle(), {.behind = 2.0, .ahead = 0.2});
  const auto rows_of = [&](int status) {
    MessageWriter writer(topics.message_type(topics.topic("/fix")));
    writer.set("latitude", 51.0);
    writer.set("longitude", 7.0);
    writer.set("status.status", status);
    return intake.take(topics.topic("/fix"), writer.write(now, "gps"), now).size();
  };
  EXPECT_EQ(rows_of(2), 1u);
  EXPECT_EQ(rows_of(1), 0u);
  const TopicCount& count = intake.counts()[static_cast<std::size_t>(topics.topic("/fix"))];
  EXPECT_EQ(count.used, 1);
  EXPECT_EQ(count.refused[static_cast<std::size_t>(Refusal::left_out)], 1);
  EXPECT_NE(count.last.find("signals.SIGNAL.when"), std::string::npos);
}

TEST_F(IntakeTest, FixesStateTheirAccuracy) {
  const Settings weighed = parse_yaml(R"(
outputs:
  x: {from: /fix, as: east, variance: "/fix:position_covariance[0]"}
  y: {from: /fix, as: north, variance: "/fix:position_covariance[4]"}
  angle: none
inputs: {speed: "/joint_states:velocity[wheel]"}
)",
                                      "test");
  const LiveTopics topics(weighed, Settings(), {});
  Intake intake(topics, logs::SignalMap(weighed, vehicle()), vehicle(), {.behind = 2.0, .ahead = 0.2});
  const auto row_of = [&](double variance, int kind) {
    MessageWriter writer(topics.message_type(topics.topic("/fix")));
    writer.set("latitude", 51.0);
    writer.set("longitude", 7.0);
    writer.set("position_covariance[0]", variance);
    writer.set("position_covariance[4]", 4.0 * variance);
    writer.set("position_covariance_type", kind);
    const auto rows = intake.take(topics.topic("/fix"), writer.write(now, "gps"), now);
    return rows.empty() ? logs::SignalRow() : rows.front();
  };
  const logs::SignalRow known = row_of(0.01, 2), unknown = row_of(0.01, 0);
  ASSERT_EQ(known.sigmas.size(), 3u);
  EXPECT_NEAR(known.sigmas[0], 0.1, 1e-12);
  EXPECT_NEAR(known.sigmas[1], 0.2, 1e-12);
  EXPECT_TRUE(std::isnan(known.sigmas[2]));
  EXPECT_EQ(unknown.values.size(), 3u);
  EXPECT_TRUE(unknown.sigmas.empty()) << "COVARIANCE_TYPE_UNKNOWN";
}

TEST_F(IntakeTest, StampsThatCannotBeAreRefused) {
  EXPECT_EQ(fix(51.0, 0, 0.0, 0, now - 3 * second), 0u);
  EXPECT_EQ(fix(51.0, 0, 0.0, 0, now + second), 0u);
  EXPECT_EQ(refused("/fix", Refusal::stamp), 2);
  EXPECT_EQ(fix(51.0, 0, 0.0, 0, now - second), 1u);
}

TEST_F(IntakeTest, FixesThatAreNoneAreRefused) {
  EXPECT_EQ(fix(51.0, -1, 0.0, 0), 0u);
  EXPECT_EQ(fix(51.0, 0, 36.0, 2), 0u);  // a standard deviation of 6 m
  EXPECT_EQ(refused("/fix", Refusal::fix), 2);
  EXPECT_FALSE(intake_.origin());
  EXPECT_EQ(fix(51.0, 0, 36.0, 0), 1u);  // of which it says that it is not known
  ASSERT_TRUE(intake_.origin());
  EXPECT_NEAR(intake_.origin()->latitude, 51.0, 1e-12);
}

TEST_F(IntakeTest, AFrameMustNotChange) {
  EXPECT_EQ(fix(51.0, 0, 0.0, 0, now, "gps"), 1u);
  EXPECT_EQ(fix(51.0, 0, 0.0, 0, now, "other"), 0u);
  EXPECT_EQ(refused("/fix", Refusal::frame), 1);
}

TEST_F(IntakeTest, NumbersThatCannotBeAreRefused) {
  EXPECT_EQ(fix(91.0, 0, 0.0, 0), 0u);
  EXPECT_EQ(fix(std::numeric_limits<double>::quiet_NaN(), 0, 0.0, 0), 0u);
  EXPECT_EQ(refused("/fix", Refusal::number), 2);
  for (const double angle : {1.5, -1.5, std::numeric_limits<double>::infinity()}) {
    MessageWriter writer = message("/joint_states");
    writer.set("position[steer]", angle);
    EXPECT_EQ(rows("/joint_states", writer.write(now, "")), 0u) << angle;
  }
  EXPECT_EQ(refused("/joint_states", Refusal::number), 3);
}

TEST_F(IntakeTest, JointsMayComeInSeveralMessages) {
  MessageWriter writer = message("/joint_states");
  writer.set("velocity[wheel]", 2.0);
  EXPECT_EQ(rows("/joint_states", writer.write(now, "")), 1u);
  EXPECT_EQ(intake_.counts()[static_cast<std::size_t>(topic("/joint_states"))].refusals(), 0);
}

TEST_F(IntakeTest, EveryCutOfAMessageIsRefused) {
  MessageWriter writer = message("/fix");
  writer.set("latitude", 51.0);
  writer.set("longitude", 7.0);
  const auto whole = writer.write(now, "gps");
  for (std::size_t size = 0; size < whole.size(); ++size) EXPECT_EQ(rows("/fix", whole.first(size)), 0u) << size;
  EXPECT_EQ(refused("/fix", Refusal::too_large), 1);  // what is empty was too large to be kept
  EXPECT_EQ(refused("/fix", Refusal::broken), static_cast<std::int64_t>(whole.size()) - 1);
}

TEST_F(IntakeTest, EveryRefusalHasAName) {
  for (std::size_t i = 0; i < refusal_count; ++i) EXPECT_STRNE(name_of(static_cast<Refusal>(i)), "");
}

}  // namespace
}  // namespace rhec::apps::ros::intake_test
