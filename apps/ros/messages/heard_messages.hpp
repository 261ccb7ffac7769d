#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "rhec/logs/cdr/cdr_cursor.hpp"
#include "rhec/logs/signals/log.hpp"

// What is read of messages beyond single numbers. All throw RecordError for a message that is broken or not finite.
namespace rhec::apps::ros {

struct MessageHeader {
  logs::Stamp stamp = 0;
  std::string_view frame;
};
/// Of a message that begins with one.
MessageHeader read_header(std::span<const std::byte> message);
MessageHeader read_header(logs::CdrCursor& cursor);
/// A coordinate on the ground [m], which is not farther away than the earth is large.
double read_coordinate(logs::CdrCursor& cursor, logs::Kind kind);

struct Position {
  double x = 0.0, y = 0.0;  ///< [m]
};
/// The places of a nav_msgs/Path or of a geometry_msgs/PoseArray.
struct Positions {
  MessageHeader header;
  std::vector<Position> places;
};
Positions read_path(std::span<const std::byte> message);
Positions read_pose_array(std::span<const std::byte> message);

/// One transform of a tf2_msgs/TFMessage.
struct PlaceOfFrame {
  std::string parent, child;
  double translation[3] = {}, rotation[4] = {};  ///< [m]; x, y, z, w
};
std::vector<PlaceOfFrame> read_transforms(std::span<const std::byte> message);

/// std_msgs/Bool
bool read_flag(std::span<const std::byte> message);
/// rosgraph_msgs/Clock, which is not before 1970
logs::Stamp read_clock(std::span<const std::byte> message);

/// What a sensor_msgs/NavSatFix says of itself.
struct FixQuality {
  bool has_fix = false;
  std::optional<double> sigma;  ///< the larger of those of east and north [m]; none: it is not known
};
FixQuality read_fix_quality(std::span<const std::byte> message);

}  // namespace rhec::apps::ros
