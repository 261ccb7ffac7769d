#pragma once

#include <array>
#include <string_view>
#include <utility>
#include <vector>

#include "rhec/logs/cdr/cdr_writer.hpp"

// Messages of obstacles, as those who see them send them.
namespace rhec::apps::ros {

struct ToldObstacle {
  double x = 0.0, y = 0.0, radius = 0.0, velocity_x = 0.0, velocity_y = 0.0;
  std::vector<std::pair<double, double>> outline = {};  ///< empty: the point x, y
};

/// geometry_msgs/PoseArray
inline void write_obstacle_poses(logs::Stamp when, std::string_view frame, const std::vector<ToldObstacle>& told,
                                 logs::CdrWriter& message) {
  message.header(when, frame);
  message.length(told.size());
  for (const ToldObstacle& each : told) message.numbers(std::array{each.x, each.y, 0.0, 0.0, 0.0, 0.0, 1.0});
}

/// costmap_converter_msgs/ObstacleArrayMsg
inline void write_obstacle_array(logs::Stamp when, std::string_view frame, const std::vector<ToldObstacle>& told,
                                 logs::CdrWriter& message, std::string_view frame_of_each = "") {
  message.header(when, frame);
  message.length(told.size());
  for (const ToldObstacle& each : told) {
    message.header(when, frame_of_each);
    auto outline = each.outline;
    if (outline.empty()) outline.emplace_back(each.x, each.y);
    message.length(outline.size());
    for (const auto& [x, y] : outline)
      for (const double value : {x, y, 0.0}) message.f32(static_cast<float>(value));
    message.f64(each.radius);
    message.f64(0.0);  // its id: as many bytes
    message.numbers(std::array{0.0, 0.0, 0.0, 1.0});
    message.numbers(std::array{each.velocity_x, each.velocity_y, 0.0, 0.0, 0.0, 0.0});
    message.numbers(std::vector<double>(36, 0.0));
  }
}

}  // namespace rhec::apps::ros
