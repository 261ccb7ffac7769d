// Obstacles that a live loop hears of, and what its controller does with them.
#include <gtest/gtest.h>

#include <array>
#include <chrono>
#include <cmath>
#include <limits>
#include <string>
#include <thread>
#include <vector>

#include "apps/ros/node/loop.hpp"
#include "apps/ros/support/live_loop.hpp"
#include "apps/ros/support/obstacles.hpp"

namespace rhec::apps::ros::loop_obstacles_test {
namespace {

constexpr const char* careful_robot = R"(
step: 0.05
model: {name: skid_steer, wheel_radius: 0.1, track_width: 0.5, outputs: [x_gps, y_gps, heading]}
noise: {outputs: {x_gps: 0.02, y_gps: 0.02, heading: 0.01}}
estimator: {name: ekf}
controller:
  horizon: 40
  weights: {stage: {x: 1, y: 1, omega_left: 0.002, omega_right: 0.002}, terminal: {x: 10, y: 10}}
  terms: [{name: obstacles, most: 2, vehicle_radius: 0.3}]
)";

class LoopObstacles : public LoopTest {
 protected:
  void begin_among(ObstacleForm form) {
    RosOptions options = steering();
    options.names.obstacles = "/obstacles";
    options.obstacles = {.form = form, .radius = 0.4};
    begin(options, careful_robot);
    form_ = form;
    obstacles_ = writer("rt/obstacles", type_of(form), true);
    plans_ = reader("rt/rhec/plan", "nav_msgs/msg/Path", true, false);
  }
  void see(const std::vector<ToldObstacle>& told, const std::string& frame = "odom", double age = 0.0) {
    logs::CdrWriter message;
    const logs::Stamp when = now() - static_cast<logs::Stamp>(std::llround(age * 1e9));
    if (form_ == ObstacleForm::poses)
      write_obstacle_poses(when, frame, told, message);
    else
      write_obstacle_array(when, frame, told, message);
    send(obstacles_, message);
  }
  /// Among obstacles that are told again and again: until the plan, which leads along the x axis for 2 s, is so.
  template <class Condition>
  bool plan_becomes(const std::vector<ToldObstacle>& told, const Condition& condition) {
    return becomes_while_measuring([&] {
      if (!(speed_ > 0.1)) send_path("odom");
      see(told);
      for (Bytes bytes = take(plans_); !bytes.empty(); bytes = take(plans_)) plan_ = read_path(bytes).places;
      return speed_ > 0.1 && !plan_.empty() && condition();
    });
  }
  double widest() const {
    double widest = 0.0;
    for (const Position& place : plan_) widest = std::max(widest, std::abs(place.y));
    return widest;
  }

  ObstacleForm form_ = ObstacleForm::poses;
  dds::DataWriter* obstacles_ = nullptr;
  dds::DataReader* plans_ = nullptr;
  std::vector<Position> plan_;
};

TEST_F(LoopObstacles, PlansLeadAroundWhatRests) {
  begin_among(ObstacleForm::poses);
  EXPECT_TRUE(plan_becomes({{.x = 1.2, .y = 0.1}}, [&] { return widest() > 0.3; }));
  EXPECT_TRUE(plan_becomes({}, [&] { return widest() < 0.1; }));  // none are there any more
}

TEST_F(LoopObstacles, WhatMovesIsExpectedWhereItWillBe) {
  begin_among(ObstacleForm::obstacle_array);
  // It crosses the path: where it is now it is in nobody's way, and where it is in a second it is.
  EXPECT_TRUE(plan_becomes({{.x = 1.0, .y = 2.0, .radius = 0.4, .velocity_y = -2.0}}, [&] {
    double closest = std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < plan_.size(); ++i) {
      const double time = 0.05 * static_cast<double>(i);
      closest = std::min(closest, std::hypot(plan_[i].x - 1.0, plan_[i].y - (2.0 - 2.0 * time)));
    }
    return closest > 0.6 && (widest() > 0.05 || plan_.back().x < 1.6);
  }));
  // At rest where it was, it changes nothing.
  EXPECT_TRUE(
      plan_becomes({{.x = 1.0, .y = 2.0, .radius = 0.4}}, [&] { return widest() < 0.1 && plan_.back().x > 1.6; }));
}

TEST_F(LoopObstacles, TheNearestAreRegarded) {
  begin_among(ObstacleForm::obstacle_array);
  const std::vector<ToldObstacle> told{
      {.x = 50.0, .radius = 0.4}, {.x = 60.0, .radius = 0.4}, {.x = 1.2, .y = 0.1, .radius = 0.4}};
  EXPECT_TRUE(plan_becomes(told, [&] {
    return widest() > 0.3 && has_event("3 obstacles are seen, and the terms of the controller regard 2");
  }));
  loop_->stop();
  EXPECT_EQ(loop_->report().obstacles_seen, 3u);
  EXPECT_EQ(loop_->report().obstacles_regarded, 2u);
}

TEST_F(LoopObstacles, WhatCannotBeIsCountedAndRegardedByNobody) {
  begin_among(ObstacleForm::obstacle_array);
  const ToldObstacle in_the_way{.x = 1.2, .y = 0.1, .radius = 0.4};
  ASSERT_TRUE(becomes_while_measuring([&] {
    if (!(speed_ > 0.1)) send_path("odom");
    return speed_ > 0.1;
  }));
  ToldObstacle not_a_number = in_the_way, negative = in_the_way;
  not_a_number.velocity_x = std::nan("");
  negative.radius = -1.0;
  for (int i = 0; i < 10; ++i) {
    see({in_the_way}, "map");
    see({in_the_way}, "odom", 60.0);
    see({in_the_way}, "odom", -60.0);
    see({not_a_number});
    see({negative});
    logs::CdrWriter cut;
    cut.header(now(), "odom");
    cut.length(1);
    send(obstacles_, cut);
    std::this_thread::sleep_for(std::chrono::milliseconds(30));
  }
  loop_->stop();
  loop_->check();
  const LoopReport report = loop_->report();
  EXPECT_EQ(report.other.refused[static_cast<std::size_t>(Refusal::frame)], 10);
  EXPECT_EQ(report.other.refused[static_cast<std::size_t>(Refusal::stamp)], 20);
  EXPECT_EQ(report.other.refused[static_cast<std::size_t>(Refusal::broken)], 30);
  EXPECT_EQ(report.obstacles_seen, 0u);
}

}  // namespace
}  // namespace rhec::apps::ros::loop_obstacles_test
