#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "rhec/core/base/export.hpp"

namespace rhec::logs {

enum class Kind : std::uint8_t {
  boolean,
  u8,
  i8,
  u16,
  i16,
  u32,
  i32,
  u64,
  i64,
  f32,
  f64,  // numbers
  text,
  wide_text,
  long_double,
  structure
};
enum class Shape : std::uint8_t { single, array, sequence };

struct FieldDefinition {
  std::string name;
  Kind kind = Kind::u8;
  std::string type = {};  ///< of a structure: "geometry_msgs/msg/Point"
  Shape shape = Shape::single;
  std::uint64_t length = 0;  ///< of an array
  int structure = -1;        ///< of a structure: its index in a MessageType
  bool is_octet = false;     ///< of a u8: `byte`, which ROS tells from `uint8`
};

struct StructureDefinition {
  std::string name;
  std::vector<FieldDefinition> fields;
};

/// Structures by their full names, "geometry_msgs/msg/Point".
using Definitions = std::map<std::string, StructureDefinition>;

/// "nav_msgs/Odometry" and "nav_msgs::msg::dds_::Odometry_" are "nav_msgs/msg/Odometry".
RHEC_EXPORT std::string full_type_name(std::string_view name);

/// Adds what a text in ROS's own language defines: the fields of `type`, and, behind lines of `=` and a line
/// "MSG: pkg/Name", those of the types that it contains, as MCAP and rosbag2 keep them. Throws Error with the line.
RHEC_EXPORT void parse_ros2msg(const std::string& type, std::string_view text, Definitions& definitions);
/// The same in OMG's IDL ("ros2idl"): modules, structures, typedefs, enumerations; constants and annotations are passed
/// over.
RHEC_EXPORT void parse_ros2idl(const std::string& type, std::string_view text, Definitions& definitions);
/// Common messages of ROS 2, which bags before ROS 2 Iron do not define: std_msgs, geometry_msgs, sensor_msgs,
/// nav_msgs, tf2_msgs, ...
RHEC_EXPORT const Definitions& builtin_definitions();

/// A message's structures, the first of which is the message itself; indices instead of names.
struct MessageType {
  std::string name;
  std::vector<StructureDefinition> structures;
};
/// Throws Error for a structure that is not defined, or that contains itself.
RHEC_EXPORT MessageType link_message(const std::string& type, const Definitions& definitions);

/// The definition of one structure as text in ROS's own language, with those that it contains: a schema for a log.
RHEC_EXPORT std::string ros2msg_text(const std::string& type, const Definitions& definitions);

}  // namespace rhec::logs
