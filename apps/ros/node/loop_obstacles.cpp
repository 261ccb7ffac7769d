// Obstacles that the loop has heard of, for the terms of the controller.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "loop.hpp"

namespace rhec::apps::ros {

void Loop::hear_obstacles(SeenObstacles seen) {
  obstacles_ = std::move(seen.obstacles);
  obstacles_stamp_ = seen.header.stamp == 0 ? time_.now() : seen.header.stamp;
  report_.obstacles_seen = obstacles_.size();
  regard_obstacles();
}

/// The nearest first, since terms have room for so many.
void Loop::regard_obstacles() {
  if (!controller_) return;
  const auto distance = [this](const Obstacle& obstacle) {
    return std::hypot(obstacle.x - last_x_, obstacle.y - last_y_) -
           std::max(obstacle.semi_axis_along, obstacle.semi_axis_across);
  };
  std::ranges::sort(obstacles_, {}, distance);
  report_.obstacles_regarded =
      static_cast<std::size_t>(controller_->set_obstacles(obstacles_, time_of(obstacles_stamp_)));
  if (report_.obstacles_regarded >= obstacles_.size() || std::exchange(has_told_crowd_, true)) return;
  say(fmt::format(
      "{} obstacles are seen, and the terms of the controller regard {} of them, the nearest; `most` of the "
      "term `obstacles` makes room",
      obstacles_.size(), report_.obstacles_regarded));
}

void Loop::note_place(const Estimate& estimate) {
  const Roles& roles = robot_.model()->description().roles;
  last_x_ = estimate.state[roles.position_x];
  last_y_ = estimate.state[roles.position_y];
}

}  // namespace rhec::apps::ros
