#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "apps/ros/node/loop.hpp"
#include "apps/ros/support/stranger.hpp"
#include "rhec/logs/cdr/message_reader.hpp"
#include "rhec/plugins/host/host.hpp"
#include "rhec/plugins/yaml/yaml.hpp"
#include "rhec/sim/telemetry/robot_messages.hpp"

// A live loop, in a world of messages that another implementation of DDS sends.
namespace rhec::apps::ros {

inline constexpr const char* resting_robot = R"(
step: 0.05
model: {name: skid_steer, wheel_radius: 0.1, track_width: 0.5, outputs: [x_gps, y_gps, heading]}
noise: {outputs: {x_gps: 0.02, y_gps: 0.02, heading: 0.01}}
estimator: {name: ekf}
controller: {horizon: 20}
)";

/// A robot at rest, whose sensors go on to say so.
class LoopTest : public StrangerTest {
 protected:
  void begin(RosOptions options, const char* file = resting_robot) {
    options_ = std::move(options);
    robot_ = std::make_unique<Robot>(host_, RobotOptions::table().parse(parse_yaml(file, "robot.yaml"), "test"));
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
  /// The computer's time, or that of `tick`.
  logs::Stamp now() const {
    if (clocks_) return simulated_;
    return std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::system_clock::now().time_since_epoch())
        .count();
  }
  void send(dds::DataWriter* writer, const logs::CdrWriter& message) {
    Bytes bytes(message.bytes().begin(), message.bytes().end());
    writer->write(&bytes);
  }
  /// Lets the time of /clock go on, or jump.
  void tick(double seconds) {
    if (!clocks_) clocks_ = writer("rt/clock", "rosgraph_msgs/msg/Clock", true);
    simulated_ += static_cast<logs::Stamp>(std::llround(seconds * 1e9));
    logs::CdrWriter message;
    message.stamp(simulated_);
    send(clocks_, message);
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
  dds::DataWriter *measured_ = nullptr, *paths_ = nullptr, *clocks_ = nullptr;
  logs::Stamp simulated_ = 1'000'000'000'000;
  dds::DataReader* commands_ = nullptr;
  std::vector<std::string> events_;
  double speed_ = std::nan("");
  int sent_ = 0;
};

inline RosOptions steering() {
  RosOptions options;
  options.command.steer = true;
  return options;
}

}  // namespace rhec::apps::ros
