#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "rhec/core/estimation/estimator.hpp"
#include "rhec/sim/loop/scenario.hpp"

namespace rhec::sim {

/// What an estimator says at one sample of a drive that it does not steer.
struct RideSample {
  bool is_faulty = false;  ///< something has gone wrong since the sample before
  /// Distance of the position from the true one [m]. Once all receivers have moved for good, by the same, the true one
  /// is that in their coordinates.
  double error = 0.0;
  double heading_error = 0.0;        ///< absolute, 0 of a vehicle without a heading [rad]
  Eigen::VectorXd parameter_errors;  ///< absolute
  double displaced = 0.0;            ///< by how much the position was measured wrongly [m]; 0 where it was not measured
  /// How far the position has gone along with that: 0 at the truth, 1 at what was measured.
  double followed = 0.0;
  bool is_inside = true;          ///< the true position is in the ellipse of 3 standard deviations (99.73 %)
  bool is_heading_inside = true;  ///< likewise, within 3 standard deviations
  bool is_finite = true;          ///< all numbers of the estimate are
  bool is_bounded = true;         ///< states and parameters are within their bounds
  HealthLevel health = HealthLevel::ok;
  std::uint32_t reasons = 0;  ///< of the estimate, its sensors and inputs, together
  double log_volume = 0.0;    ///< log sqrt(det P) of [x; p]; NaN where P is not positive definite
};

/// What an estimator said of a drive.
struct Ride {
  std::vector<RideSample> samples;
  Estimator::Counts counts;
  std::vector<Sensor> sensors;         ///< those that were judged; empty where nobody judges
  std::vector<SensorHealth> verdicts;  ///< by sensor, at the end
};

/// Drives `scenario` for so many samples, or to the end of its path, steered by what the simulation knows: whatever the
/// estimators say, the vehicle drives the same way. The estimators of `riders`, scenarios that differ from it in their
/// estimator alone, get what its sensors and inputs measure, faults included.
///
/// Returns what each said. Throws Error for a vehicle that leaves its path, which no estimator can be blamed for.
RHEC_EXPORT std::vector<Ride> ride_along(const Scenario& scenario, std::span<const Scenario> riders, int samples);

}  // namespace rhec::sim
