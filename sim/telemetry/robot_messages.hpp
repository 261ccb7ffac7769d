#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "rhec/logs/cdr/cdr_writer.hpp"
#include "rhec/logs/mcap/mcap_writer.hpp"
#include "rhec/logs/signals/log.hpp"

namespace rhec::sim {

/// A time [s] as a stamp, rounded to a nanosecond.
logs::Stamp stamp_at(double time) noexcept;

/// A channel of one of the messages that are built in.
std::uint16_t add_channel(logs::McapWriter& writer, const std::string& topic, const std::string& type);

// Messages of ROS 2, field by field in the order of their definitions.

struct PlanarPose {
  double x = 0.0, y = 0.0, heading = 0.0;  ///< [m], [rad]
};

/// sensor_msgs/JointState; `efforts` may be empty.
void write_joint_state(logs::Stamp when, std::string_view frame, std::span<const std::string> names,
                       std::span<const double> positions, std::span<const double> efforts, logs::CdrWriter& message);
/// nav_msgs/Odometry: the covariance is that of x, y and heading (3 x 3), the twist is in the vehicle's frame.
void write_odometry(logs::Stamp when, const PlanarPose& pose, const Eigen::Matrix3d& covariance, double speed,
                    double yaw_rate, logs::CdrWriter& message);
/// tf2_msgs/TFMessage from `odom` to `base_link`.
void write_transform(logs::Stamp when, const PlanarPose& pose, logs::CdrWriter& message);
/// nav_msgs/Path; `times` are stamps of the poses, one each.
void write_path(logs::Stamp when, std::span<const PlanarPose> poses, std::span<const logs::Stamp> times,
                logs::CdrWriter& message);

struct DiagnosticValue {
  std::string key, value;
};
/// diagnostic_msgs/DiagnosticArray with one status; levels are 0 (ok), 1 (warning), 2 (error).
void write_diagnostics(logs::Stamp when, std::uint8_t level, std::string_view name, std::string_view text,
                       std::span<const DiagnosticValue> values, logs::CdrWriter& message);

}  // namespace rhec::sim
