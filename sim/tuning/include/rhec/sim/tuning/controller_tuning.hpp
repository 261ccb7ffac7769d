#pragma once

#include <limits>
#include <string>
#include <vector>

#include "rhec/core/base/export.hpp"
#include "rhec/core/config/settings.hpp"
#include "rhec/sim/tuning/log_tuning.hpp"
#include "rhec/sim/tuning/tunable.hpp"

namespace rhec::sim {

/// A world that the controller drives in: the scenario with these assignments over it.
struct DrivingCase {
  std::string name;
  Settings settings;
};

struct ControllerTuningOptions {
  int first_seed = 1, seeds = 3;           ///< that it is tuned on, in every case
  int judge_first_seed = 101, judges = 6;  ///< that it is judged on
  double effort = 1.0;                     ///< of what is chosen: at most so many times that of the scenario
  int threads = 1;
  int most_evaluations = 40;                                      ///< of each trade-off
  double most_seconds = std::numeric_limits<double>::infinity();  ///< of the search
};

/// A controller that was tried. Ratios to the scenario's own on the same seeds, as geometric means over cases and
/// seeds.
struct TriedController {
  std::vector<double> values;  ///< of the numbers tuned, in their order
  double tracking = 1.0;       ///< mean distance from the path
  double effort = 1.0;  ///< root mean square of the inputs' changes from sample to sample, without that of the speed
  bool is_complete = true;    ///< every run reached the end of its path
  bool is_efficient = false;  ///< none that was tried tracks better with as little effort (Pareto)
};

struct ControllerTuning {
  Settings settings;  ///< the scenario with what was chosen
  std::vector<Tunable> numbers;
  std::vector<TriedController> tried;  ///< the first one is the scenario's
  int chosen = 0;                      ///< of these
  std::vector<Compared> judged;        ///< by seeds that nothing was tuned on
  int runs = 0;
  bool stopped = false;
  double seconds = 0.0;
};

/// Tunes weights and horizon of a controller in closed loops: for several trade-offs of tracking against effort, the
/// sum of their logarithms is minimised. Chosen is what tracks best within the effort that is allowed. Throws Error if
/// the scenario is wrong, or its own controller does not reach the end of its path.
RHEC_EXPORT ControllerTuning tune_controller(const Host& host, const Settings& settings,
                                             const std::vector<DrivingCase>& cases,
                                             const ControllerTuningOptions& options, const TuningHooks& hooks = {});

/// The files of such a tuning.
RHEC_EXPORT std::string tuned_yaml(const ControllerTuning& tuning, const std::string& origin);
RHEC_EXPORT std::string summary_json(const ControllerTuning& tuning);
RHEC_EXPORT std::string pareto_csv(const ControllerTuning& tuning);
RHEC_EXPORT std::string pareto_svg(const ControllerTuning& tuning);

}  // namespace rhec::sim
