#include "rhec/sim/telemetry/robot_messages.hpp"

#include <array>
#include <cmath>

namespace rhec::sim {
namespace {

void write_quaternion(double heading, logs::CdrWriter& message) {
  message.numbers(std::array{0.0, 0.0, std::sin(0.5 * heading), std::cos(0.5 * heading)});
}

}  // namespace

logs::Stamp stamp_at(double time) noexcept { return static_cast<logs::Stamp>(std::llround(time * 1e9)); }

void write_pose(const PlanarPose& pose, logs::CdrWriter& message) {
  message.numbers(std::array{pose.x, pose.y, 0.0});
  write_quaternion(pose.heading, message);
}

void write_joint_state(logs::Stamp when, std::string_view frame, std::span<const std::string> names,
                       std::span<const double> positions, std::span<const double> efforts, logs::CdrWriter& message) {
  message.header(when, frame);
  message.length(names.size());
  for (const std::string& name : names) message.text(name);
  message.length(positions.size());
  message.numbers(positions);
  message.length(0);  // velocities
  message.length(efforts.size());
  message.numbers(efforts);
}

void write_odometry(logs::Stamp when, const Frames& frames, const PlanarPose& pose, const Eigen::Matrix3d& covariance,
                    double speed, double yaw_rate, logs::CdrWriter& message) {
  message.header(when, frames.fixed);
  message.text(frames.vehicle);
  write_pose(pose, message);
  std::array<double, 36> full{};  // of x, y, z, roll, pitch, yaw
  constexpr std::array<std::size_t, 3> places{0, 1, 5};
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) full[6 * places[i] + places[j]] = covariance(i, j);
  message.numbers(full);
  message.numbers(std::array{speed, 0.0, 0.0, 0.0, 0.0, yaw_rate});
  message.numbers(std::array<double, 36>{});
}

void write_transform(logs::Stamp when, const Frames& frames, const PlanarPose& pose, logs::CdrWriter& message) {
  message.length(1);
  message.header(when, frames.fixed);
  message.text(frames.vehicle);
  message.numbers(std::array{pose.x, pose.y, 0.0});
  write_quaternion(pose.heading, message);
}

void write_path(logs::Stamp when, std::string_view frame, std::span<const PlanarPose> poses,
                std::span<const logs::Stamp> times, logs::CdrWriter& message) {
  message.header(when, frame);
  message.length(poses.size());
  for (std::size_t i = 0; i < poses.size(); ++i) {
    message.header(times[i], frame);
    write_pose(poses[i], message);
  }
}

void write_diagnostics(logs::Stamp when, std::uint8_t level, std::string_view name, std::string_view text,
                       std::span<const DiagnosticValue> values, logs::CdrWriter& message) {
  message.header(when, "");
  message.length(1);
  message.u8(level);
  message.text(name);
  message.text(text);
  message.text("");
  message.length(values.size());
  for (const DiagnosticValue& value : values) {
    message.text(value.key);
    message.text(value.value);
  }
}

}  // namespace rhec::sim
