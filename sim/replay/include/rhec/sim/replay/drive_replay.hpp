#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "rhec/core/estimation/estimator.hpp"
#include "rhec/core/estimation/sensor.hpp"
#include "rhec/logs/mapping/drive.hpp"
#include "rhec/plugins/robot/robot.hpp"
#include "rhec/sim/logs/recorded_log.hpp"
#include "rhec/sim/problems/recording_solver.hpp"

namespace rhec::sim {

/// An estimate of a drive.
struct DriveEstimate {
  double time = 0.0;               ///< [s], as in the drive
  Eigen::VectorXd values, sigmas;  ///< of [state; parameters]; sigmas NaN where unknown
  HealthLevel health = HealthLevel::ok;
  bool fallback = false;
  std::string findings = {};  ///< why it is not ok, in words
};

/// What a measurement differed by from what was expected of it.
struct DriveInnovation {
  double time = 0.0;  ///< [s]
  int sensor = 0;
  bool accepted = true;
  double nis = 0.0, log_determinant = 0.0;  ///< nu' S^-1 nu, and of S
  std::vector<double> values, sigmas;  ///< of the sensor's outputs that were measured, and what was expected of them
};

/// A measurement that was withheld, and what was predicted of it.
struct DrivePrediction {
  std::size_t event = 0;          ///< of the drive
  double time = 0.0;              ///< when it was measured [s]: its stamp, less the delay of its sensor
  std::vector<double> residuals;  ///< measured - predicted, by output of the sensor; NaN where it was not measured
  double distance = 0.0;          ///< the norm of those
};

struct DriveReplay {
  std::string name;  ///< of the variant
  std::vector<Sensor> sensors;
  std::vector<DriveEstimate> estimates;
  std::vector<DriveInnovation> innovations;  ///< empty where nobody judges (`estimator.health.watch`)
  Estimator::Counts counts;
  std::vector<double> solve_us;
  double start = 0.0;    ///< of the first node [s], as in the drive
  double seconds = 0.0;  ///< of the whole replay
  int withheld_sensor = -1;
  std::vector<DrivePrediction> predictions;
  std::int64_t unpredicted = 0;  ///< withheld measurements before the first estimate
};

/// The sensor whose measurements are withheld to see how well they are predicted: that of the position, by its unit; of
/// a vehicle without one, the first.
RHEC_EXPORT int sensor_to_withhold(const Robot& robot, const std::vector<Sensor>& sensors);

/// Replays a drive through a new estimator: pushes what was known in the order of arrival, with its own stamps, and
/// asks for the estimate every `step` from the first measurement on. One in `hold_out.every` measurements of
/// `sensor_to_withhold` is not pushed, but predicted at its time from what had arrived until then.
///
/// `simulated_start`: the state with which the estimator begins if the first measurement agrees with it; else it begins
/// where the first measurement says (`start_of`), unless `estimator.initial.state` does.
RHEC_EXPORT DriveReplay replay_drive(const Robot& robot, const logs::Drive& drive, const HoldOut& hold_out = {},
                                     const std::optional<Eigen::VectorXd>& simulated_start = {},
                                     const LoopHooks& hooks = {});

/// The state that the first measurement of each output tells of directly: a position, a heading, an angle; NaN of a
/// heading that none tells of, all else 0.
RHEC_EXPORT Eigen::VectorXd start_of(const Robot& robot, const logs::Drive& drive,
                                     const std::optional<Eigen::VectorXd>& simulated_start = {});

}  // namespace rhec::sim
