// A live loop in the time of /clock.
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <string>
#include <thread>

#include "apps/ros/node/loop.hpp"
#include "apps/ros/support/live_loop.hpp"

namespace rhec::apps::ros::loop_time_test {
namespace {

class LoopTime : public LoopTest {
 protected:
  void begin_in_simulated_time() {
    RosOptions options = steering();
    options.use_sim_time = true;
    begin(options);
  }
  /// As `becomes_while_measuring`, with a time that goes on with each measurement.
  template <class Condition>
  bool becomes_while_ticking(const Condition& condition) {
    return becomes_while_measuring([&] {
      tick(0.05);
      return condition();
    });
  }
  bool drives() {
    return becomes_while_ticking([&] {
      if (!(speed_ > 0.1)) send_path("odom");
      return speed_ > 0.1;
    });
  }
};

TEST_F(LoopTime, WithoutAClockItWaitsAndSaysSo) {
  begin_in_simulated_time();
  dds::DataReader* const diagnostics = reader("rt/diagnostics", "diagnostic_msgs/msg/DiagnosticArray", true, false);
  Bytes health;
  ASSERT_TRUE(becomes_while_measuring([&] {
    if (health.empty()) health = take(diagnostics);
    return has_event("waits for the time on /clock") && !health.empty();
  }));
  EXPECT_FALSE(has_event("estimates begin"));
  logs::MessageReader level(std::make_shared<const logs::MessageType>(
                                logs::link_message("diagnostic_msgs/msg/DiagnosticArray", logs::builtin_definitions())),
                            {.fields = {"status[0].level"}});
  double warning = 0.0;
  level.read({.bytes = health}, &warning);
  EXPECT_EQ(warning, 1.0);
  ASSERT_TRUE(becomes_while_ticking([&] { return has_event("estimates begin"); }));
  EXPECT_TRUE(has_event("the time begins on /clock"));
}

TEST_F(LoopTime, StepsAreStepsOfTheClock) {
  begin_in_simulated_time();
  ASSERT_TRUE(becomes_while_ticking([&] { return has_event("estimates begin"); }));
  constexpr int steps = 16, parts = 10;
  for (int i = 0; i < steps; ++i) {  // three times as slow as the computer's time, or slower
    for (int part = 0; part < parts; ++part) {
      tick(0.05 / parts);
      std::this_thread::sleep_for(std::chrono::milliseconds(15));
    }
    measure();
  }
  loop_->stop();
  loop_->check();
  const LoopReport report = loop_->report();
  EXPECT_GE(report.cycles, steps / 2);
  EXPECT_LE(report.cycles, steps + steps / 2);  // on the computer's clock three times as many are due
  EXPECT_EQ(report.jumps, 0);
}

TEST_F(LoopTime, AJumpBackBeginsAnew) {
  begin_in_simulated_time();
  ASSERT_TRUE(drives());
  events_.clear();
  tick(-600.0);
  ASSERT_TRUE(becomes_while_ticking(
      [&] { return std::ranges::find(events_, std::string("estimates begin")) != events_.end(); }));
  EXPECT_TRUE(has_event("the time jumped back by 600 s"));
  EXPECT_EQ(loop_->jumps(), 1);
  ASSERT_TRUE(becomes_while_ticking([&] { return has_event("waits for a path"); }));  // the path was another time's
  ASSERT_TRUE(becomes_while_ticking([&] { return speed_ == 0.0; }));
  EXPECT_TRUE(drives());
  loop_->stop();
  loop_->check();
  EXPECT_EQ(loop_->report().jumps, 1);
  EXPECT_EQ(loop_->report().lost, 0);
}

TEST_F(LoopTime, ALittleBackIsNoJump) {
  begin_in_simulated_time();
  ASSERT_TRUE(becomes_while_ticking([&] { return has_event("estimates begin"); }));
  int times = 0;
  ASSERT_TRUE(becomes_while_ticking([&] {
    tick(-0.02);
    return ++times > 20;
  }));
  EXPECT_EQ(loop_->jumps(), 0);
}

TEST_F(LoopTime, ATimeThatStandsStillStopsTheRobot) {
  begin_in_simulated_time();
  ASSERT_TRUE(drives());
  ASSERT_TRUE(becomes_while_measuring([&] { return speed_ == 0.0; }));
  EXPECT_TRUE(has_event("the time stands still"));
  EXPECT_TRUE(becomes_while_ticking([&] { return speed_ > 0.1; }));  // and it goes on with it
  EXPECT_TRUE(has_event("the time goes on"));
}

TEST_F(LoopTime, ClocksThatCannotBeAreCounted) {
  begin_in_simulated_time();
  ASSERT_TRUE(becomes_while_ticking([&] { return has_event("estimates begin"); }));
  logs::CdrWriter cut, nanoseconds, before;
  cut.i32(5);
  nanoseconds.i32(5);
  nanoseconds.u32(1'000'000'000);
  before.i32(-5);
  before.u32(0);
  for (const logs::CdrWriter* message : {&cut, &nanoseconds, &before}) send(clocks_, *message);
  int times = 0;
  ASSERT_TRUE(becomes_while_ticking([&] { return ++times > 10; }));
  loop_->stop();
  loop_->check();
  const LoopReport report = loop_->report();
  EXPECT_EQ(report.other.refused[static_cast<std::size_t>(Refusal::broken)], 3);
  EXPECT_EQ(report.jumps, 0);
}

}  // namespace
}  // namespace rhec::apps::ros::loop_time_test
