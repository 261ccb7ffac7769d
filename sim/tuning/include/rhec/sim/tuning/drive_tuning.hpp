#pragma once

#include <string>
#include <vector>

#include "rhec/sim/replay/replay_scenario.hpp"
#include "rhec/sim/replay/replay_summary.hpp"
#include "rhec/sim/tuning/log_tuning.hpp"

namespace rhec::sim {

struct DriveTuningOptions {
  HoldOut hold_out{.every = 5, .phase = 4};  ///< measurements of the position that nothing is tuned on
  TuningWishes wishes;
  int threads = 1;
  double most_seconds = std::numeric_limits<double>::infinity();  ///< of the search; then the best so far is taken
};

/// A scenario tuned on a log with the vehicle's own sensors.
struct DriveTuning {
  Settings settings;  ///< the scenario with what was found; as it was if that predicts clearly better
  bool is_taken = false;
  std::vector<TunedNumber> numbers;
  AccuracySummary before, after;  ///< of the scenario's estimator, at what is withheld
  std::vector<SensorSummary> innovations_before, innovations_after;
  int measurements = 0;  ///< that count in the likelihood
  double log_likelihood_before = 0.0, log_likelihood_after = 0.0;
  int evaluations = 0;
  bool stopped = false;
  double seconds = 0.0;
};

/// Finds the noise of sensors and inputs, delays of sensors, lever arms, and the process noise of slip that make the
/// innovations of an extended Kalman filter most likely, with tails as heavy as the log has them (`log_likelihood`).
/// `settings` has one variant. What was found is taken unless the scenario's own estimator then predicts what was
/// withheld worse by 5 % (median times root mean square). Throws Error if the log has fewer than `least_fixes`
/// measurements.
RHEC_EXPORT DriveTuning tune_on_drive(const Host& host, const Settings& settings, const logs::Drive& drive,
                                      const DriveTuningOptions& options, const TuningHooks& hooks = {});

/// The numbers that are tuned on a drive.
RHEC_EXPORT std::vector<Tunable> drive_tunables(const Host& host, const Robot& robot, const Settings& settings,
                                                const std::vector<Sensor>& sensors, const TuningWishes& wishes);

RHEC_EXPORT std::string tuned_yaml(const DriveTuning& tuning, const std::string& origin);
RHEC_EXPORT std::string summary_json(const DriveTuning& tuning);

}  // namespace rhec::sim
