#include <cmath>
#include <string>
#include <vector>

#include "rhec/logs/mcap/mcap_writer.hpp"
#include "rhec/sim/telemetry/track_writer.hpp"
#include "robot_messages.hpp"

namespace rhec::sim {
namespace {

// Poses of a reference path are this far apart, at most so many [m].
constexpr double spacing = 0.5;
constexpr int most_poses = 20000;

class McapTrack final : public TrackWriter {
 public:
  McapTrack(const std::filesystem::path& file, const Robot& robot, const Path* reference)
      : writer_(file), roles_(robot.model()->description().roles) {
    const ModelDescription& about = robot.estimated_description();
    states_ = names_of(about.states);
    parameters_ = names_of(about.parameters);
    inputs_ = names_of(robot.model()->description().inputs);
    has_pose_ = roles_.position_x >= 0 && roles_.position_y >= 0;
    odometry_ = add_channel(writer_, "/rhec/odometry", "nav_msgs/msg/Odometry");
    transforms_ = add_channel(writer_, "/tf", "tf2_msgs/msg/TFMessage");
    plan_ = add_channel(writer_, "/rhec/plan", "nav_msgs/msg/Path");
    slip_ = add_channel(writer_, "/rhec/slip", "sensor_msgs/msg/JointState");
    state_ = add_channel(writer_, "/rhec/state", "sensor_msgs/msg/JointState");
    input_ = add_channel(writer_, "/rhec/inputs", "sensor_msgs/msg/JointState");
    diagnostics_ = add_channel(writer_, "/diagnostics", "diagnostic_msgs/msg/DiagnosticArray");
    if (reference) add_reference(*reference);
  }

  void write(const TrackSample& sample) override {
    if (!reference_.empty()) {
      put(path_, sample.stamp, [&](logs::CdrWriter& message) {
        write_path(sample.stamp, reference_, std::vector<logs::Stamp>(reference_.size(), sample.stamp), message);
      });
      reference_.clear();
    }
    if (has_pose_) write_pose(sample);
    if (!sample.plan.empty()) write_plan(sample);
    write_values(slip_, sample.stamp, parameters_, sample.parameters, sample.sigmas.tail(tail_of(sample)));
    write_values(state_, sample.stamp, states_, sample.state,
                 sample.sigmas.head(sample.sigmas.size() - tail_of(sample)));
    if (!sample.inputs.empty())
      put(input_, sample.stamp, [&](logs::CdrWriter& message) {
        write_joint_state(sample.stamp, "base_link", inputs_, sample.inputs, {}, message);
      });
    write_health(sample);
    last_ = sample;
    has_last_ = true;
  }
  void close() override { writer_.close(); }

 private:
  static Eigen::Index tail_of(const TrackSample& sample) {
    return sample.sigmas.size() > 0 ? sample.parameters.size() : 0;
  }

  template <class Fill>
  void put(std::uint16_t channel, logs::Stamp when, const Fill& fill) {
    message_.clear();
    fill(message_);
    writer_.write(channel, when, message_.bytes());
  }

  void add_reference(const Path& reference) {
    path_ = add_channel(writer_, "/rhec/path", "nav_msgs/msg/Path");
    const double step = std::max(spacing, reference.length() / most_poses);
    for (double s = 0.0; s <= reference.length(); s += step) {
      const PathPoint point = reference.point_at(s);
      reference_.push_back({point.x, point.y, point.heading});
    }
  }

  PlanarPose pose_of(const TrackSample& sample) const {
    return {sample.state[roles_.position_x], sample.state[roles_.position_y],
            roles_.heading >= 0 ? sample.state[roles_.heading] : 0.0};
  }

  void write_pose(const TrackSample& sample) {
    const PlanarPose pose = pose_of(sample);
    double speed = 0.0, yaw_rate = 0.0;  // by the difference from the last estimate
    const double duration = has_last_ ? logs::seconds_between(last_.stamp, sample.stamp) : 0.0;
    if (duration > 0.0) {
      const PlanarPose before = pose_of(last_);
      const double middle = 0.5 * (pose.heading + before.heading);
      speed = ((pose.x - before.x) * std::cos(middle) + (pose.y - before.y) * std::sin(middle)) / duration;
      yaw_rate = std::remainder(pose.heading - before.heading, 2.0 * M_PI) / duration;
    }
    put(odometry_, sample.stamp, [&](logs::CdrWriter& message) {
      write_odometry(sample.stamp, pose, sample.pose_covariance, speed, yaw_rate, message);
    });
    put(transforms_, sample.stamp, [&](logs::CdrWriter& message) { write_transform(sample.stamp, pose, message); });
  }

  void write_plan(const TrackSample& sample) {
    std::vector<PlanarPose> poses;
    std::vector<logs::Stamp> times;
    for (const Eigen::Vector3d& node : sample.plan) {
      times.push_back(sample.stamp + stamp_at(sample.plan_step * static_cast<double>(poses.size())));
      poses.push_back({node[0], node[1], node[2]});
    }
    put(plan_, sample.stamp, [&](logs::CdrWriter& message) { write_path(sample.stamp, poses, times, message); });
  }

  template <class Values, class Sigmas>
  void write_values(std::uint16_t channel, logs::Stamp when, const std::vector<std::string>& names,
                    const Values& values, const Sigmas& sigmas) {
    const std::vector<double> positions(values.begin(), values.end()), efforts(sigmas.begin(), sigmas.end());
    put(channel, when,
        [&](logs::CdrWriter& message) { write_joint_state(when, "base_link", names, positions, efforts, message); });
  }

  void write_health(const TrackSample& sample) {
    const std::vector<DiagnosticValue> values{{"health", name_of(sample.health)}, {"findings", sample.findings}};
    put(diagnostics_, sample.stamp, [&](logs::CdrWriter& message) {
      write_diagnostics(sample.stamp, static_cast<std::uint8_t>(sample.health), "rhec: estimate",
                        sample.findings.empty() ? name_of(sample.health) : sample.findings, values, message);
    });
  }

  logs::McapWriter writer_;
  Roles roles_;
  std::vector<std::string> states_, parameters_, inputs_;
  bool has_pose_ = false, has_last_ = false;
  std::uint16_t odometry_ = 0, transforms_ = 0, plan_ = 0, path_ = 0, slip_ = 0, state_ = 0, input_ = 0,
                diagnostics_ = 0;
  std::vector<PlanarPose> reference_;
  TrackSample last_;
  logs::CdrWriter message_;
};

}  // namespace

std::unique_ptr<TrackWriter> open_track_mcap(const std::filesystem::path& file, const Robot& robot,
                                             const Path* reference) {
  return std::make_unique<McapTrack>(file, robot, reference);
}

}  // namespace rhec::sim
