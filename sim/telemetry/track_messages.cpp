#include "rhec/sim/telemetry/track_messages.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace rhec::sim {
namespace {

// Poses of a reference path are this far apart, at most so many [m].
constexpr double spacing = 0.5;
constexpr int most_poses = 20000;

constexpr std::array<TrackMessages::Topic, track_topic_count> topics{{
    {"/rhec/odometry", "nav_msgs/msg/Odometry"},
    {"/tf", "tf2_msgs/msg/TFMessage"},
    {"/rhec/plan", "nav_msgs/msg/Path"},
    {"/rhec/slip", "sensor_msgs/msg/JointState"},
    {"/rhec/state", "sensor_msgs/msg/JointState"},
    {"/rhec/inputs", "sensor_msgs/msg/JointState"},
    {"/diagnostics", "diagnostic_msgs/msg/DiagnosticArray"},
    {"/rhec/path", "nav_msgs/msg/Path"},
}};

Eigen::Index tail_of(const TrackSample& sample) { return sample.sigmas.size() > 0 ? sample.parameters.size() : 0; }

}  // namespace

const TrackMessages::Topic& TrackMessages::topic(TrackTopic which) noexcept {
  return topics[static_cast<std::size_t>(which)];
}

TrackMessages::TrackMessages(const Robot& robot, Frames frames)
    : frames_(std::move(frames)), roles_(robot.model()->description().roles) {
  const ModelDescription& about = robot.estimated_description();
  states_ = names_of(about.states);
  parameters_ = names_of(about.parameters);
  inputs_ = names_of(robot.model()->description().inputs);
}

template <class Fill>
void TrackMessages::put(TrackTopic topic, logs::Stamp when, const Take& take, const Fill& fill) {
  message_.clear();
  fill(message_);
  take(topic, when, message_.bytes());
}

void TrackMessages::write(const TrackSample& sample, const Take& take) {
  if (roles_.position_x >= 0 && roles_.position_y >= 0) write_motion(sample, take);
  if (!sample.plan.empty()) write_plan(sample, take);
  write_values(TrackTopic::slip, sample.stamp, parameters_, sample.parameters, sample.sigmas.tail(tail_of(sample)),
               take);
  write_values(TrackTopic::state, sample.stamp, states_, sample.state,
               sample.sigmas.head(sample.sigmas.size() - tail_of(sample)), take);
  if (!sample.inputs.empty())
    put(TrackTopic::inputs, sample.stamp, take, [&](logs::CdrWriter& message) {
      write_joint_state(sample.stamp, frames_.vehicle, inputs_, sample.inputs, {}, message);
    });
  write_health(sample, take);
}

void TrackMessages::write_path(const Path& path, logs::Stamp when, const Take& take) {
  poses_.clear();
  const double step = std::max(spacing, path.length() / most_poses);
  for (double s = 0.0; s <= path.length(); s += step) {
    const PathPoint point = path.point_at(s);
    poses_.push_back({point.x, point.y, point.heading});
  }
  times_.assign(poses_.size(), when);
  put(TrackTopic::path, when, take,
      [&](logs::CdrWriter& message) { sim::write_path(when, frames_.fixed, poses_, times_, message); });
}

PlanarPose TrackMessages::pose_of(const TrackSample& sample) const {
  return {sample.state[roles_.position_x], sample.state[roles_.position_y],
          roles_.heading >= 0 ? sample.state[roles_.heading] : 0.0};
}

void TrackMessages::write_motion(const TrackSample& sample, const Take& take) {
  const PlanarPose pose = pose_of(sample);
  double speed = 0.0, yaw_rate = 0.0;  // by the difference from the last estimate
  const double duration = has_last_ ? logs::seconds_between(last_stamp_, sample.stamp) : 0.0;
  if (duration > 0.0) {
    const double middle = 0.5 * (pose.heading + last_pose_.heading);
    speed = ((pose.x - last_pose_.x) * std::cos(middle) + (pose.y - last_pose_.y) * std::sin(middle)) / duration;
    yaw_rate = std::remainder(pose.heading - last_pose_.heading, 2.0 * M_PI) / duration;
  }
  has_last_ = true;
  last_stamp_ = sample.stamp;
  last_pose_ = pose;
  put(TrackTopic::odometry, sample.stamp, take, [&](logs::CdrWriter& message) {
    write_odometry(sample.stamp, frames_, pose, sample.pose_covariance, speed, yaw_rate, message);
  });
  put(TrackTopic::transforms, sample.stamp, take,
      [&](logs::CdrWriter& message) { write_transform(sample.stamp, frames_, pose, message); });
}

void TrackMessages::write_plan(const TrackSample& sample, const Take& take) {
  poses_.clear();
  times_.clear();
  for (const Eigen::Vector3d& node : sample.plan) {
    times_.push_back(sample.stamp + stamp_at(sample.plan_step * static_cast<double>(poses_.size())));
    poses_.push_back({node[0], node[1], node[2]});
  }
  put(TrackTopic::plan, sample.stamp, take,
      [&](logs::CdrWriter& message) { sim::write_path(sample.stamp, frames_.fixed, poses_, times_, message); });
}

template <class Values, class Sigmas>
void TrackMessages::write_values(TrackTopic topic, logs::Stamp when, const std::vector<std::string>& names,
                                 const Values& values, const Sigmas& sigmas, const Take& take) {
  positions_.assign(values.begin(), values.end());
  efforts_.assign(sigmas.begin(), sigmas.end());
  put(topic, when, take, [&](logs::CdrWriter& message) {
    write_joint_state(when, frames_.vehicle, names, positions_, efforts_, message);
  });
}

void TrackMessages::write_health(const TrackSample& sample, const Take& take) {
  const std::array values{DiagnosticValue{"health", name_of(sample.health)},
                          DiagnosticValue{"findings", sample.findings}};
  put(TrackTopic::diagnostics, sample.stamp, take, [&](logs::CdrWriter& message) {
    write_diagnostics(sample.stamp, static_cast<std::uint8_t>(sample.health), "rhec: estimate",
                      sample.findings.empty() ? name_of(sample.health) : sample.findings, values, message);
  });
}

}  // namespace rhec::sim
