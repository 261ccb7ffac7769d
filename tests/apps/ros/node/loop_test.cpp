// A live loop, in a world of messages that another implementation of DDS sends.
#include "apps/ros/node/loop.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <chrono>
#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "apps/ros/support/stranger.hpp"
#include "rhec/logs/cdr/message_reader.hpp"
#include "rhec/plugins/host/host.hpp"
#include "rhec/plugins/yaml/yaml.hpp"
#include "rhec/sim/telemetry/robot_messages.hpp"

namespace rhec::apps::ros::loop_test {
namespace {

constexpr const char* robot_file = R"(
step: 0.05
model: {name: skid_steer, wheel_radius: 0.1, track_width: 0.5, outputs: [x_gps, y_gps, heading]}
noise: {outputs: {x_gps: 0.02, y_gps: 0.02, heading: 0.01}}
estimator: {name: ekf}
controller: {horizon: 20}
)";

/// A robot at rest, whose sensors go on to say so.
class LoopTest : public StrangerTest {
 protected:
  void begin(RosOptions options) {
    options_ = std::move(options);
    robot_ = std::make_unique<Robot>(host_, RobotOptions::table().parse(parse_yaml(robot_file, "robot.yaml"), "test"));
    topics_ = std::make_unique<LiveTopics>(Settings(), Settings(), std::vector<std::filesystem::path>());
    intake_ = std::make_unique<Intake>(*topics_, logs::SignalMap(Settings(), robot_->model()->description()),
                                       robot_->bounded_description(), options_.checks);
    wire_ = std::make_unique<Participant>(WireOptions{.domain = domain_});
    loop_ = std::make_unique<Loop>(*wire_, *topics_, *intake_, *robot_, options_);
    measured_ = writer("rt/rhec/measured", "sensor_msgs/msg/JointState", false);
    commands_ = reader("rt/cmd_vel", "geometry_msgs/msg/TwistStamped", true, false);
    loop_->start({});
  }
  void TearDown() override {
    loop_.reset();
    wire_.reset();
    StrangerTest::TearDown();
  }
  static logs::Stamp now() {
    return std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::system_clock::now().time_since_epoch())
        .count();
  }
  void send(dds::DataWriter* writer, const logs::CdrWriter& message) {
    Bytes bytes(message.bytes().begin(), message.bytes().end());
    writer->write(&bytes);
  }
  void measure() {
    logs::CdrWriter message;
    const std::vector<std::string> names{"x_gps", "y_gps", "heading"};
    const std::vector<double> values{0.01 * (++sent_ % 3), 0.0, 0.002 * (sent_ % 2)};  // noise, or it seems stuck
    sim::write_joint_state(now(), "base_link", names, values, {}, message);
    send(measured_, message);
  }
  /// While it measures: whether something becomes so.
  template <class Condition>
  bool becomes_while_measuring(const Condition& condition) {
    return becomes([&] {
      measure();
      for (std::string& event : loop_->take_events()) events_.push_back(std::move(event));
      if (const auto places = loop_->take_wanted_path()) {
        std::vector<Waypoint> waypoints;
        for (const Position& place : *places) waypoints.push_back({place.x, place.y, 1.0});
        loop_->follow(robot_->make_controller(Path(waypoints)));
      }
      for (Bytes bytes = take(commands_); !bytes.empty(); bytes = take(commands_)) speed_ = speed_of(bytes);
      return condition();
    });
  }
  static double speed_of(const Bytes& bytes) {
    logs::MessageReader reader(std::make_shared<const logs::MessageType>(
                                   logs::link_message("geometry_msgs/msg/TwistStamped", logs::builtin_definitions())),
                               {.fields = {"twist.linear.x"}});
    double speed = 0.0;
    reader.read({.bytes = bytes}, &speed);
    return speed;
  }
  void send_path(const std::string& frame) {
    if (!paths_) paths_ = writer("rt/plan", "nav_msgs/msg/Path", true);
    const std::array poses{sim::PlanarPose{0.0, 0.0, 0.0}, sim::PlanarPose{10.0, 0.0, 0.0}};
    const std::array<logs::Stamp, 2> times{now(), now()};
    logs::CdrWriter message;
    sim::write_path(now(), frame, poses, times, message);
    send(paths_, message);
  }
  bool has_event(const std::string& part) const {
    return std::ranges::any_of(events_,
                               [&](const std::string& event) { return event.find(part) != std::string::npos; });
  }

  const Host host_;
  RosOptions options_;
  std::unique_ptr<Robot> robot_;
  std::unique_ptr<LiveTopics> topics_;
  std::unique_ptr<Intake> intake_;
  std::unique_ptr<Participant> wire_;
  std::unique_ptr<Loop> loop_;
  dds::DataWriter *measured_ = nullptr, *paths_ = nullptr;
  dds::DataReader* commands_ = nullptr;
  std::vector<std::string> events_;
  double speed_ = std::nan("");
  int sent_ = 0;
};

RosOptions steering() {
  RosOptions options;
  options.command.steer = true;
  return options;
}

TEST_F(LoopTest, FollowsAPathThatComesAndStopsWhenItIsTold) {
  begin(steering());
  ASSERT_TRUE(becomes_while_measuring([&] { return has_event("waits for a path"); }));
  EXPECT_TRUE(std::isnan(speed_));  // before it drives, it commands nothing
  ASSERT_TRUE(becomes_while_measuring([&] {
    if (!(speed_ > 0.1)) send_path("odom");
    return speed_ > 0.1;
  }));
  dds::DataWriter* const stops = writer("rt/rhec/stop", "std_msgs/msg/Bool", true);
  for (const bool is_stopped : {true, false}) {
    ASSERT_TRUE(becomes_while_measuring([&] {
      logs::CdrWriter message;
      message.flag(is_stopped);
      send(stops, message);
      return is_stopped ? speed_ == 0.0 : speed_ > 0.1;
    })) << is_stopped;
  }
  loop_->stop();
  const LoopReport report = loop_->report();
  EXPECT_GT(report.driven, 0);
  EXPECT_GT(report.cycles, report.driven);
  ASSERT_TRUE(becomes([&] {  // the last command is a stop
    const Bytes bytes = take(commands_);
    if (!bytes.empty()) speed_ = speed_of(bytes);
    return speed_ == 0.0;
  }));
}

TEST_F(LoopTest, SilenceStopsTheRobot) {
  begin(steering());
  ASSERT_TRUE(becomes_while_measuring([&] {
    if (!(speed_ > 0.1)) send_path("odom");
    return speed_ > 0.1;
  }));
  ASSERT_TRUE(becomes([&] {
    for (Bytes bytes = take(commands_); !bytes.empty(); bytes = take(commands_)) speed_ = speed_of(bytes);
    return speed_ == 0.0;
  }));
  EXPECT_TRUE(becomes_while_measuring([&] { return speed_ > 0.1; }));  // and it goes on when they come again
}

TEST_F(LoopTest, WhatIsBrokenIsCountedAndGoesNoFurther) {
  begin(steering());
  ASSERT_TRUE(becomes_while_measuring([&] { return has_event("waits for a path"); }));
  for (int i = 0; i < 20; ++i) {
    measure();
    logs::CdrWriter cut;
    cut.u32(0xffffffffu);
    send(measured_, cut);
    send_path("another_frame");
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  loop_->stop();
  loop_->check();
  const LoopReport report = loop_->report();
  const TopicCount& measured = report.topics.at(static_cast<std::size_t>(topics_->topic("/rhec/measured")));
  EXPECT_GT(measured.refused[static_cast<std::size_t>(Refusal::broken)], 0);
  EXPECT_GT(measured.used, 0);
  EXPECT_GT(report.other.refused[static_cast<std::size_t>(Refusal::frame)], 0);
  EXPECT_EQ(report.driven, 0);
  EXPECT_EQ(report.lost, 0);
}

TEST_F(LoopTest, WithoutAHeadingItWaitsForMotion) {
  RosOptions options = steering();
  options.command.heading_sigma = 1e-6;
  begin(options);
  EXPECT_TRUE(becomes_while_measuring([&] { return has_event("waits for a heading"); }));
  send_path("odom");
  int looks = 0;
  EXPECT_TRUE(becomes_while_measuring([&] { return ++looks > 30; }));
  EXPECT_TRUE(std::isnan(speed_));
}

TEST_F(LoopTest, TellsItsEstimates) {
  begin({});
  dds::DataReader* const odometry = reader("rt/rhec/odometry", "nav_msgs/msg/Odometry", true, false);
  dds::DataReader* const diagnostics = reader("rt/diagnostics", "diagnostic_msgs/msg/DiagnosticArray", true, false);
  Bytes pose, health;
  EXPECT_TRUE(becomes_while_measuring([&] {
    if (pose.empty()) pose = take(odometry);
    if (health.empty()) health = take(diagnostics);
    return !pose.empty() && !health.empty();
  }));
  EXPECT_EQ(read_header(pose).frame, "odom");
  EXPECT_TRUE(has_event("estimates, does not steer"));
}

TEST_F(LoopTest, NoticesAnotherOwnerOfItsTransform) {
  begin({});
  dds::DataWriter* const transforms = writer("rt/tf", "tf2_msgs/msg/TFMessage", true);
  EXPECT_TRUE(becomes_while_measuring([&] {
    logs::CdrWriter message;
    sim::write_transform(now(), {"base_link", "wheel"}, {}, message);  // no rival
    send(transforms, message);
    message.clear();
    sim::write_transform(now(), {"map", "base_link"}, {}, message);
    send(transforms, message);
    return has_event("another node sends the transform from 'map' to base_link");
  }));
  EXPECT_FALSE(has_event("wheel"));
}

TEST_F(LoopTest, SaysWhichProcessorsThereAre) {
  begin({});
  loop_->stop();
  Loop other(*wire_, *topics_, *intake_, *robot_, options_);
  EXPECT_THROW(other.start({.processor = 1023}), Error);
}

TEST(Driving, HasWords) {
  for (const Driving driving : {Driving::waiting, Driving::heading, Driving::no_path, Driving::stopped, Driving::silent,
                                Driving::finished, Driving::estimating, Driving::driving})
    EXPECT_STRNE(in_words(driving), "");
}

}  // namespace
}  // namespace rhec::apps::ros::loop_test
