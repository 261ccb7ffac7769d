#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "rhec/core/control/path.hpp"
#include "rhec/plugins/robot/robot.hpp"
#include "rhec/sim/telemetry/robot_messages.hpp"
#include "rhec/sim/telemetry/track_writer.hpp"

namespace rhec::sim {

/// What is told of an estimate, each by a message on a topic of its own.
enum class TrackTopic : std::uint8_t { odometry, transforms, plan, slip, state, inputs, diagnostics, path };
inline constexpr std::size_t track_topic_count = 8;

/// Estimates as messages of ROS 2, for whoever keeps or sends them.
class RHEC_EXPORT TrackMessages {
 public:
  struct Topic {
    const char *name, *type;
  };
  static const Topic& topic(TrackTopic which) noexcept;

  explicit TrackMessages(const Robot& robot, Frames frames = {});

  /// A message is valid during the call that hands it out.
  using Take = std::function<void(TrackTopic topic, logs::Stamp when, std::span<const std::byte> message)>;
  /// The messages of an estimate: what it does not have (a plan, inputs) has none.
  void write(const TrackSample& sample, const Take& take);
  /// The path that is followed.
  void write_path(const Path& path, logs::Stamp when, const Take& take);

 private:
  template <class Fill>
  void put(TrackTopic topic, logs::Stamp when, const Take& take, const Fill& fill);
  template <class Values, class Sigmas>
  void write_values(TrackTopic topic, logs::Stamp when, const std::vector<std::string>& names, const Values& values,
                    const Sigmas& sigmas, const Take& take);
  PlanarPose pose_of(const TrackSample& sample) const;
  void write_motion(const TrackSample& sample, const Take& take);
  void write_plan(const TrackSample& sample, const Take& take);
  void write_health(const TrackSample& sample, const Take& take);

  Frames frames_;
  Roles roles_;
  std::vector<std::string> states_, parameters_, inputs_;
  bool has_last_ = false;
  logs::Stamp last_stamp_ = 0;  ///< of the last estimate, for speeds
  PlanarPose last_pose_;
  logs::CdrWriter message_;
  std::vector<PlanarPose> poses_;
  std::vector<logs::Stamp> times_;
  std::vector<double> positions_, efforts_;
};

}  // namespace rhec::sim
