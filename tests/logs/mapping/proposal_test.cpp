#include "rhec/logs/mapping/proposal.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "logs/support/described.hpp"
#include "rhec/logs/mapping/signal_map.hpp"
#include "rhec/plugins/yaml/yaml.hpp"

namespace rhec::logs {
namespace proposal_test {

TopicSurvey topic(const std::string& name, const std::string& type, const std::vector<std::string>& fields) {
  TopicSurvey made;
  made.topic = {name, type, 10};
  made.count = 10;
  for (const std::string& field : fields) made.fields.push_back({.name = field, .count = 10});
  return made;
}

/// A proposal is a section that the map takes.
std::string from(const std::string& proposal, const std::string& variable) {
  const Settings settings = parse_yaml(proposal, "proposal.yaml");
  const SignalMap map(*settings.find("signals"), described());
  for (const MappedSignal& signal : map.signals())
    if (signal.variable.name == variable)
      return signal.from.empty() ? "" : signal.from.front().topic + ":" + signal.from.front().field;
  return "?";
}

TEST(Proposal, FindsWhatRobotsOfRosSay) {
  Survey survey;
  survey.topics = {
      topic("/fix", "sensor_msgs/msg/NavSatFix", {"latitude", "longitude", "altitude"}),
      topic("/imu", "sensor_msgs/msg/Imu", {"orientation.w", "angular_velocity.z"}),
      topic("/joint_states", "sensor_msgs/msg/JointState", {"position[steering]", "velocity[rear_left_wheel]"}),
      topic("/odom", "nav_msgs/msg/Odometry", {"twist.twist.linear.x"})};
  const std::string proposal = propose_signals(survey, described());
  EXPECT_EQ(from(proposal, "x_gps"), "/fix:");
  EXPECT_EQ(from(proposal, "y_gps"), "/fix:");
  EXPECT_EQ(from(proposal, "psi_m"), "/imu:orientation");
  EXPECT_EQ(from(proposal, "delta"), "/joint_states:position[steering]");
  EXPECT_EQ(from(proposal, "v"), "/odom:twist.twist.linear.x");
  EXPECT_EQ(from(proposal, "delta_rate"), "/joint_states:position[steering]");
  EXPECT_THAT(proposal, testing::HasSubstr("derivative: true"));
}

TEST(Proposal, TellsOfFixesThatAreNowBetterNowWorse) {
  Survey survey;
  survey.topics = {topic("/fix", "sensor_msgs/msg/NavSatFix", {"latitude", "longitude", "altitude", "status.status"})};
  survey.topics[0].fields.push_back({.name = "position_covariance[0]", .count = 10, .least = 1.0, .most = 1.0});
  FieldSurvey &status = survey.topics[0].fields[3], &variance = survey.topics[0].fields[4];
  status.least = -1.0;
  status.most = 2.0;
  const std::string proposal = propose_signals(survey, described());
  EXPECT_THAT(proposal, testing::HasSubstr("when: {of: \"/fix:status.status\", at_least: 2}"));
  EXPECT_EQ(from(proposal, "x_gps"), "/fix:");
  EXPECT_THAT(proposal, testing::Not(testing::HasSubstr("variance")));
  variance.least = 1e-4;
  variance.most = 4.0;
  EXPECT_THAT(propose_signals(survey, described()),
              testing::AllOf(testing::HasSubstr("0.01 to 2 m to the east"),
                             testing::HasSubstr("variance: \"/fix:position_covariance[0]\", and [4] to the north")));
  variance.least = 2.0;
  EXPECT_THAT(propose_signals(survey, described()), testing::Not(testing::HasSubstr("variance")));
  status.most = 0.0;  // fixes and none
  EXPECT_THAT(propose_signals(survey, described()), testing::Not(testing::HasSubstr("when:")));
}

TEST(Proposal, FindsColumnsByTheirNames) {
  Survey survey;
  survey.topics = {topic("", "table", {"lat", "lon", "alt", "yaw", "steer_angle", "speed_kmh", "delta_rate"})};
  const std::string proposal = propose_signals(survey, described());
  EXPECT_EQ(from(proposal, "x_gps"), ":lat");
  EXPECT_EQ(from(proposal, "psi_m"), ":yaw");
  EXPECT_EQ(from(proposal, "delta"), ":steer_angle");
  EXPECT_EQ(from(proposal, "v"), ":speed_kmh");
  EXPECT_EQ(from(proposal, "delta_rate"), ":delta_rate");
}

const MappedSignal* mapped(const SignalMap& map, const std::string& variable) {
  for (const MappedSignal& signal : map.signals())
    if (signal.variable.name == variable) return &signal;
  return nullptr;
}

/// A sprayer whose signals have units of their own, by their names, heads or ranges.
TEST(Proposal, HasTheUnitsThatSignalsSeemToHave) {
  ModelDescription about = described();
  about.inputs = {{.name = "omega_left", .unit = "rad/s", .meaning = "wheels of the left side"},
                  {.name = "omega_right", .unit = "rad/s", .meaning = "wheels of the right side"},
                  {.name = "v", .unit = "m/s", .meaning = "wheel speed"}};
  Survey survey;
  survey.topics = {topic("", "table",
                         {"GPS front Lat", "GPS front Lon", "GPS rear Lat", "GPS rear Lon", "lateral_acceleration",
                          "heading", "steer, \"left\"", "rpm left", "ticks right", "wheel_speed_kmh"})};
  for (FieldSurvey& field : survey.topics[0].fields) {
    field.least = 0.0;
    field.most = 350.0;
  }
  const std::string proposal = propose_signals(survey, about);
  const SignalMap map(*parse_yaml(proposal, "proposal.yaml").find("signals"), about);
  EXPECT_EQ(mapped(map, "x_gps")->from[0].field, "GPS front Lat");
  EXPECT_EQ(mapped(map, "x_gps")->from[1].field, "GPS front Lon");
  EXPECT_EQ(mapped(map, "psi_m")->options.sign, -1);
  EXPECT_EQ(mapped(map, "psi_m")->options.unit, "deg");
  EXPECT_EQ(mapped(map, "delta")->from[0].field, "steer, \"left\"");
  EXPECT_EQ(mapped(map, "delta")->options.unit, "deg");
  EXPECT_EQ(mapped(map, "omega_left")->options.unit, "rpm");
  EXPECT_EQ(mapped(map, "omega_right")->options.counts, 1024.0);
  EXPECT_EQ(mapped(map, "v")->options.unit, "km/h");
  EXPECT_THAT(proposal, testing::HasSubstr("as: direction"));
  // What the head of a column says need not be said again.
  survey.topics[0].fields[6].unit = "deg";
  const std::string known = propose_signals(survey, about);
  EXPECT_THAT(known, testing::HasSubstr("delta: \"steer, \\\"left\\\"\"    #"));
}

TEST(Proposal, TheSpeedIsThatOfTheWheelsOfBothSides) {
  Survey survey;
  survey.topics = {topic("", "table", {"Radar speed", "rpm left", "rpm right"})};
  EXPECT_THAT(
      propose_signals(survey, described()),
      testing::HasSubstr(
          "v: {from: [\"rpm left\", \"rpm right\"], as: mean, unit: rpm, radius: 0.3}    # the wheel's radius"));
  survey.topics = {topic("/joint_states", "sensor_msgs/msg/JointState",
                         {"position[Left]", "position[Right]", "velocity[Left]", "velocity[Right]"})};
  const std::string proposal = propose_signals(survey, described());
  EXPECT_EQ(from(proposal, "v"), "/joint_states:velocity[Left]") << proposal;
}

TEST(Proposal, AClockIsAColumnThatRises) {
  Survey survey;
  survey.topics = {topic("", "table", {"speed", "Zeit"})};
  survey.topics[0].fields[0].is_rising = false;
  EXPECT_THAT(propose_signals(survey, described()), testing::Not(testing::HasSubstr("clock:")));
  survey.topics[0].unreadable = "no column 'time'";
  EXPECT_THAT(propose_signals(survey, described()), testing::HasSubstr("signals:\n  clock: Zeit    #"));
  EXPECT_EQ(from(propose_signals(survey, described()), "v"), ":speed");
}

TEST(Proposal, TopicsMayHaveAnyName) {
  Survey survey;
  survey.topics = {topic("gps/front", "sensor_msgs/msg/NavSatFix", {"latitude"}),
                   topic("gps rear", "sensor_msgs/msg/NavSatFix", {"latitude"}),
                   topic("/drive", "my_msgs/msg/Drive", {"left_wheel_speed"})};
  ModelDescription about = described();
  about.inputs[0] = {.name = "v_left", .unit = "m/s", .meaning = "speed of the left track"};
  const std::string proposal = propose_signals(survey, about);
  EXPECT_THAT(proposal, testing::HasSubstr("x_gps: {from: gps/front, as: east}"));
  EXPECT_THAT(proposal, testing::HasSubstr("psi_m: {from: [gps/front, \"gps rear\"], as: direction}"));
  EXPECT_THAT(proposal, testing::HasSubstr("v_left: \"/drive:left_wheel_speed\""));
}

TEST(Proposal, LeavesToFillInWhatIsNotThere) {
  const std::string proposal = propose_signals({}, described());
  EXPECT_EQ(from(proposal, "delta"), "");
  EXPECT_THAT(proposal, testing::HasSubstr("delta: none    # steering angle [rad]; nothing was found"));
}

}  // namespace proposal_test
}  // namespace rhec::logs
