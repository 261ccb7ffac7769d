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

TEST(Proposal, LeavesToFillInWhatIsNotThere) {
  const std::string proposal = propose_signals({}, described());
  EXPECT_EQ(from(proposal, "delta"), "");
  EXPECT_THAT(proposal, testing::HasSubstr("delta: none    # steering angle [rad]; nothing was found"));
}

}  // namespace proposal_test
}  // namespace rhec::logs
