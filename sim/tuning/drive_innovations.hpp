#pragma once

#include <optional>
#include <vector>

#include "rhec/logs/mapping/drive.hpp"
#include "rhec/plugins/robot/robot.hpp"
#include "rhec/sim/replay/drive_replay.hpp"
#include "rhec/sim/tuning/innovations.hpp"

namespace rhec::sim {

/// What the robot's filter expected of a measurement of one sensor before it had it.
struct AskedInnovation {
  double time = 0.0;  ///< [s], as in the drive
  int sensor = 0;
  Innovation innovation;
};

/// The prediction error decomposition of a drive, whose events are in the order of their times, by the robot's
/// estimator, a filter that can go back by one node and has no judge (`estimator.health.watch`). Between two nodes the
/// filter goes on to each measurement on its own, so that it is asked by its own model of the inputs and of slip. What
/// is farther off than five standard deviations is not given to it, but for the eleventh in a row.
std::vector<AskedInnovation> asked_innovations(const Robot& robot, const logs::Drive& drive, const HoldOut& withheld,
                                               const std::optional<Eigen::VectorXd>& simulated_start);

}  // namespace rhec::sim
