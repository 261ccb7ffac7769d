#pragma once

#include <string>
#include <vector>

#include "rhec/core/estimation/smoother.hpp"
#include "rhec/sim/replay/drive_replay.hpp"

namespace rhec::sim {

/// A drive estimated as one problem, and the causal estimates that it began with.
struct SmoothedDriveReplay {
  DriveReplay smoothed;  ///< at the times of `causal`
  DriveReplay causal;
  Report report;  ///< of the single large problem
  std::vector<SmoothedRun::Law> laws;
  int intervals = 0;
  bool has_sigmas = false;
  double solve_seconds = 0.0;
};

/// As `replay_drive`, and then all its nodes at once. Neither knows what is withheld; its smoothed prediction is an
/// interpolation.
RHEC_EXPORT SmoothedDriveReplay smooth_drive(const std::string& name, const Robot& robot, const logs::Drive& drive,
                                             const HoldOut& hold_out,
                                             const std::optional<Eigen::VectorXd>& simulated_start = {},
                                             const LoopHooks& hooks = {});

}  // namespace rhec::sim
