#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "heard_messages.hpp"
#include "rhec/core/term/term.hpp"

// Messages that tell of obstacles. All throw RecordError for a message that is broken, or that has a number that cannot
// be.
namespace rhec::apps::ros {

/// What a message tells. Places and velocities are in the frame of its header, and of the time of its stamp.
struct SeenObstacles {
  MessageHeader header;
  std::vector<Obstacle> obstacles;
};

/// A geometry_msgs/PoseArray: centres of circles of this radius [m], which are at rest.
SeenObstacles read_obstacle_poses(std::span<const std::byte> message, double radius);

/// A costmap_converter_msgs/ObstacleArrayMsg: points, lines and polygons, each with a radius around it and a velocity.
/// A point becomes the circle of its radius, another outline an ellipse around the smallest rectangle that it fits
/// into. What has less than a millimetre in one direction gets `radius` [m] around it.
SeenObstacles read_obstacle_array(std::span<const std::byte> message, double radius);

/// The ellipse of the least area around the smallest rectangle around an outline, which has a corner at least, and what
/// is `radius` [m] or less away from it. Of one corner: a circle.
Obstacle ellipse_around(std::span<const Position> outline, double radius);

}  // namespace rhec::apps::ros
