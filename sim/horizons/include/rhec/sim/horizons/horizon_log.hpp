#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "rhec/core/estimation/windowed_estimation.hpp"
#include "rhec/core/qp/riccati.hpp"
#include "rhec/plugins/robot/robot.hpp"
#include "rhec/sim/logs/recorded_log.hpp"
#include "rhec/sim/loop/closed_loop.hpp"
#include "rhec/sim/problems/recording_solver.hpp"
#include "rhec/sim/replay/replay_input.hpp"

namespace rhec::sim {

/// Windows kept for a report of a recorded drive, over all variants.
inline constexpr std::int64_t most_windows_of_log = 1500;

/// Records the estimator's windows and the controller's plans of a loop for `rhec report`: for every n-th sample, and
/// for each sample whose solver result was unusable. Measurements at a node are stored once.
///
/// It only observes: the loop's results are bit-identical with and without it.
class RHEC_EXPORT HorizonLog {
 public:
  /// For a loop with this robot of about `samples` samples; keeps at most about `most` of them.
  HorizonLog(const Robot& robot, std::int64_t samples, std::int64_t most = 1000);
  ~HorizonLog();
  HorizonLog(HorizonLog&&) noexcept;

  /// Callback for LoopHooks::sampled; this object must outlive the loop.
  void take(const LoopSample& sample);

  std::int64_t every() const noexcept;
  /// Number of recorded samples.
  std::int64_t kept() const noexcept;
  /// JSON lines: first the measurements at all nodes, then the windows and plans.
  std::string nodes_line(int variant) const;
  const std::string& records() const noexcept;

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

/// Content of horizons.jsonl for a run or for estimates from a log: the model and the true ground parameters, then the
/// lines of each HorizonLog. docs/results.md describes them. Byte-identical for the same scenario and seed. For a log,
/// there are horizons for each variant and each suffix of its name.
RHEC_EXPORT std::string horizons_text(const HorizonLog& horizons, const RunLog& log, const Scenario& scenario);
RHEC_EXPORT std::string horizons_text(const std::vector<HorizonLog>& horizons, const RecordedLog& log,
                                      const LogScenario& scenario, const HoldOut& hold_out,
                                      const std::vector<std::string>& suffixes = {""});
RHEC_EXPORT std::string horizons_text(const std::vector<HorizonLog>& horizons, const ReplayInput& input,
                                      const std::vector<std::string>& suffixes = {""});

}  // namespace rhec::sim
