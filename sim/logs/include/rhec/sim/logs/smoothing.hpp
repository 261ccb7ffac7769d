#pragma once

#include <string>

#include "rhec/core/estimation/full_information.hpp"
#include "rhec/sim/logs/recorded_log.hpp"

namespace rhec::sim {

/// Behind the name of a variant: its estimates of the drive as it went.
inline constexpr const char* causal_suffix = " causal";

/// A recorded drive estimated as a whole, and the estimates of the drive as it went that it started from.
struct SmoothedReplay {
  Replay smoothed;  ///< at the same times as `causal`: at its nodes, and at the fixes that were withheld
  Replay causal;
  Report report;            ///< of the one large problem
  int intervals = 0;        ///< N of it
  bool has_sigmas = false;  ///< the solver gave covariances
  double solve_seconds = 0.0;
};

/// Replays a log with the robot's estimator, then estimates all of its nodes at once. A withheld fix is not seen by
/// either; the smoothed position at its time is integrated from the node before it.
RHEC_EXPORT SmoothedReplay smooth(const std::string& name, const Robot& robot, const RecordedLog& log,
                                  const LogOptions& options, const HoldOut& hold_out, const LoopHooks& hooks = {});

}  // namespace rhec::sim
