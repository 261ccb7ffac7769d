#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "rhec/core/base/export.hpp"
#include "rhec/logs/cdr/cdr_writer.hpp"
#include "rhec/logs/signals/log.hpp"

namespace rhec::sim {

// Messages of ROS 2, field by field in the order of their definitions: for logs, and for the wire.

/// A time [s] as a stamp, rounded to a nanosecond.
RHEC_EXPORT logs::Stamp stamp_at(double time) noexcept;

/// The frames of REP 105 that estimates are given in.
struct Frames {
  std::string fixed = "odom", vehicle = "base_link";
};

struct PlanarPose {
  double x = 0.0, y = 0.0, heading = 0.0;  ///< [m], [rad]
};

/// geometry_msgs/Pose: z is 0, and the orientation a rotation about the vertical.
RHEC_EXPORT void write_pose(const PlanarPose& pose, logs::CdrWriter& message);
/// sensor_msgs/JointState; `efforts` may be empty.
RHEC_EXPORT void write_joint_state(logs::Stamp when, std::string_view frame, std::span<const std::string> names,
                                   std::span<const double> positions, std::span<const double> efforts,
                                   logs::CdrWriter& message);
/// nav_msgs/Odometry: the covariance is that of x, y and heading (3 x 3), the twist is in the vehicle's frame.
RHEC_EXPORT void write_odometry(logs::Stamp when, const Frames& frames, const PlanarPose& pose,
                                const Eigen::Matrix3d& covariance, double speed, double yaw_rate,
                                logs::CdrWriter& message);
/// tf2_msgs/TFMessage from the fixed frame to the vehicle's.
RHEC_EXPORT void write_transform(logs::Stamp when, const Frames& frames, const PlanarPose& pose,
                                 logs::CdrWriter& message);
/// nav_msgs/Path; `times` are stamps of the poses, one each.
RHEC_EXPORT void write_path(logs::Stamp when, std::string_view frame, std::span<const PlanarPose> poses,
                            std::span<const logs::Stamp> times, logs::CdrWriter& message);

struct DiagnosticValue {
  std::string key, value;
};
/// diagnostic_msgs/DiagnosticArray with one status; levels are 0 (ok), 1 (warning), 2 (error), 3 (stale).
RHEC_EXPORT void write_diagnostics(logs::Stamp when, std::uint8_t level, std::string_view name, std::string_view text,
                                   std::span<const DiagnosticValue> values, logs::CdrWriter& message);

}  // namespace rhec::sim
