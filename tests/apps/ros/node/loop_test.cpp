// A live loop, in a world of messages that another implementation of DDS sends.
#include "apps/ros/node/loop.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <string>
#include <thread>

#include "apps/ros/support/live_loop.hpp"

namespace rhec::apps::ros::loop_test {
namespace {

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
  for (const Driving driving : {Driving::clock, Driving::waiting, Driving::heading, Driving::no_path, Driving::stopped,
                                Driving::silent, Driving::finished, Driving::estimating, Driving::facing_away,
                                Driving::turning_around, Driving::standing, Driving::going_back, Driving::driving})
    EXPECT_STRNE(in_words(driving), "");
}

}  // namespace
}  // namespace rhec::apps::ros::loop_test
