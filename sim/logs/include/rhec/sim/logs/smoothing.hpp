#pragma once

#include <cstddef>
#include <string>

#include "rhec/core/estimation/smoother.hpp"
#include "rhec/sim/logs/recorded_log.hpp"

namespace rhec::sim {

/// Suffix of a variant's name for its causal (online) estimates.
inline constexpr const char* causal_suffix = " causal";

/// The node of a smoothed run at a time since its first node [s]: the last one that is not later, up to rounding.
RHEC_EXPORT std::ptrdiff_t node_at(const SmoothedRun& run, double time);

/// A recorded drive estimated as one problem, and the causal estimates used as its initial guess.
struct SmoothedReplay {
  Replay smoothed;  ///< at the same times as `causal`: its nodes and the withheld fixes
  Replay causal;
  Report report;  ///< of the single large problem
  std::vector<SmoothedRun::Law> laws;
  int intervals = 0;        ///< its N
  bool has_sigmas = false;  ///< whether the solver returned covariances
  double solve_seconds = 0.0;
};

/// Replays a log with the robot's estimator, then estimates all of its nodes at once. Neither uses withheld fixes; the
/// smoothed position at a withheld fix is integrated from the preceding node.
RHEC_EXPORT SmoothedReplay smooth(const std::string& name, const Robot& robot, const RecordedLog& log,
                                  const LogOptions& options, const HoldOut& hold_out, const LoopHooks& hooks = {});

}  // namespace rhec::sim
