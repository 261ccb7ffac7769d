#pragma once

#include "rhec/core/estimation/smoother.hpp"
#include "rhec/sim/files/json.hpp"
#include "rhec/sim/loop/closed_loop.hpp"

namespace rhec::sim {

/// A simulated drive estimated as a whole, beside the estimates that drove it.
struct SmoothedDrive {
  RunLog causal;
  RunLog smoothed;  ///< the same samples with the smoother's estimates; the time of its solve is spread over them
  Report report;    ///< of the smoother
  std::vector<SmoothedRun::Law> laws;
  int intervals = 0;
  bool has_sigmas = false;  ///< whether the solver returned covariances
  double solve_seconds = 0.0;
};

/// Runs a closed loop, then estimates all of its samples at once, with the robot's smoother. Throws Error if the drive
/// has fewer than two samples.
RHEC_EXPORT SmoothedDrive smooth_closed_loop(const Scenario& scenario, const LoopHooks& hooks = {});

/// Content of summary.json: that of the smoothed drive, as of any run; under `causal` that of the estimates that drove
/// it, and under `smoother` how the problem was solved.
RHEC_EXPORT std::string summary_json(const SmoothedDrive& drive, const Scenario& scenario);

}  // namespace rhec::sim
