#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "rhec/core/estimation/receding_horizon_estimation.hpp"
#include "rhec/core/qp/riccati.hpp"
#include "rhec/plugins/robot/robot.hpp"
#include "rhec/sim/logs/recorded_log.hpp"
#include "rhec/sim/loop/closed_loop.hpp"
#include "rhec/sim/problems/recording_solver.hpp"

namespace rhec::sim {

/// Keeps what the windows of a loop's estimator and the plans of its controller looked like, for `rhec report`: of
/// every n-th sample and of each whose solver's result could not be used. What was measured at a node is kept once.
///
/// It looks on only: the loop's results are the same bits with it and without it.
class RHEC_EXPORT HorizonLog {
 public:
  /// Of a loop that drives this robot, about so many samples long; at most about `most` of them are kept.
  HorizonLog(const Robot& robot, std::int64_t samples, std::int64_t most = 1000);
  ~HorizonLog();
  HorizonLog(HorizonLog&&) noexcept;

  /// What to hang into the loop as LoopHooks::sampled; this object must outlive it.
  void take(const LoopSample& sample);

  std::int64_t every() const noexcept;
  /// Samples that were kept.
  std::int64_t kept() const noexcept;
  /// Lines of JSON: what was measured at all nodes, then the windows and plans.
  std::string nodes_line(int variant) const;
  const std::string& records() const noexcept;

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

/// horizons.jsonl of a run and of estimations from a log: the model and what the ground was like, then the lines of
/// each HorizonLog. docs/results.md describes them. The same bytes for the same scenario and seed. Of a log, the
/// horizons are those of each variant for each suffix that its name has.
RHEC_EXPORT std::string horizons_text(const HorizonLog& horizons, const RunLog& log, const Scenario& scenario);
RHEC_EXPORT std::string horizons_text(const std::vector<HorizonLog>& horizons, const RecordedLog& log,
                                      const LogScenario& scenario, const HoldOut& hold_out,
                                      const std::vector<std::string>& suffixes = {""});

}  // namespace rhec::sim
