#pragma once

#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "rhec/core/control/path.hpp"
#include "rhec/core/estimation/health.hpp"
#include "rhec/logs/signals/log.hpp"
#include "rhec/plugins/robot/robot.hpp"
#include "rhec/sim/problems/recording_solver.hpp"
#include "rhec/sim/replay/drive_replay.hpp"

namespace rhec::sim {

/// One estimate, as others' tools are told of it.
struct TrackSample {
  logs::Stamp stamp = 0;
  Eigen::VectorXd state, parameters;                          ///< as in Robot::estimated_description
  Eigen::VectorXd sigmas;                                     ///< of [state; parameters]; empty if unknown
  Eigen::Matrix3d pose_covariance = Eigen::Matrix3d::Zero();  ///< of x, y, heading
  std::vector<double> inputs;                                 ///< commanded; empty: none
  HealthLevel health = HealthLevel::ok;
  std::string findings;
  std::vector<Eigen::Vector3d> plan;  ///< x, y, heading of its nodes; empty: none
  double plan_step = 0.0;             ///< between them [s]
};

/// Writes estimates to a file of one form.
class RHEC_EXPORT TrackWriter {
 public:
  virtual ~TrackWriter() = default;
  virtual void write(const TrackSample& sample) = 0;
  /// Puts the file in its place.
  virtual void close() = 0;
};

/// MCAP with messages of ROS 2, for Foxglove and PlotJuggler: /rhec/odometry with covariance, /rhec/path (the
/// reference, if there is one), /rhec/plan, /tf, /rhec/slip and /rhec/inputs (JointState: items by name, the standard
/// deviation as effort), /rhec/state (all that is estimated), /diagnostics (health).
RHEC_EXPORT std::unique_ptr<TrackWriter> open_track_mcap(const std::filesystem::path& file, const Robot& robot,
                                                         const Path* reference = nullptr);
/// A table with a column `time`, for PlotJuggler: states, parameters, sigmas, inputs.
RHEC_EXPORT std::unique_ptr<TrackWriter> open_track_csv(const std::filesystem::path& file, const Robot& robot);
/// The trajectory as the TUM benchmark has it, for evo: timestamp tx ty tz qx qy qz qw.
RHEC_EXPORT std::unique_ptr<TrackWriter> open_track_tum(const std::filesystem::path& file, const Robot& robot);

/// What an estimate of a drive says, e.g. a smoothed one; without covariances of pairs.
RHEC_EXPORT TrackSample track_sample(const DriveEstimate& estimate, const Robot& robot, logs::Stamp start);
/// What a sample of a loop or a replay says, `start` being the stamp of time 0.
RHEC_EXPORT TrackSample track_sample(const LoopSample& sample, const Robot& robot, logs::Stamp start);

}  // namespace rhec::sim
