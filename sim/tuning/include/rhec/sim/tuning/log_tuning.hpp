#pragma once

#include <functional>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "rhec/core/base/export.hpp"
#include "rhec/core/config/settings.hpp"
#include "rhec/sim/logs/recorded_log.hpp"
#include "rhec/sim/tuning/tunable.hpp"

namespace rhec::sim {

struct LogTuningOptions {
  HoldOut hold_out{.every = 5, .phase = 4};  ///< fixes that nothing is tuned on; they judge the result
  TuningWishes wishes;
  int threads = 1;
  bool smooths = true;                                            ///< judges by the smoother, too
  double most_seconds = std::numeric_limits<double>::infinity();  ///< of the search; then the best so far is taken
};

struct TuningProgress {
  std::string stage;  ///< what is done at present
  int evaluations = 0;
  double gain = 0.0;  ///< of the log likelihood over the start
  double seconds = 0.0;
};
struct TuningHooks {
  std::function<void(const TuningProgress&)> progress = {};  ///< by any thread, one at a time
  std::function<bool()> stop = {};                           ///< true: ends the search with the best so far
};

/// A number that was tuned.
struct TunedNumber {
  Tunable tunable;
  double value = 0.0;          ///< as written
  double error = 0.0;          ///< standard error; of a scale in its unit, too. NaN: not known
  double hessian_error = 0.0;  ///< by the curvature of the likelihood alone
  bool is_told = true;         ///< false: the log says little of it, and it is as the scenario has it
  bool is_at_bound = false;    ///< of the range of the search
  /// The log likelihood, relative to its maximum, with the other numbers held: pairs with the value.
  std::vector<std::pair<double, double>> slice;
};
/// A law by which a parameter may vary, or a loss, beside the one that the others are compared with.
struct TriedLaw {
  std::string key;          ///< e.g. "estimator.priors.kappa"
  std::string law;          ///< e.g. "matern"
  double gain = 0.0;        ///< of the log likelihood
  double gain_error = 0.0;  ///< its standard error, by blocks of the log
  bool is_taken = false;
};
/// An estimator that may be the result, and how well it predicts fixes of those that were tuned on, withheld from it.
struct TriedEstimator {
  std::string name;                 ///< e.g. "rhe, tuned"
  double median = 0.0, rmse = 0.0;  ///< [m], the latter with errors capped at `error_cap`
  bool is_taken = false;
};
/// Two numbers that the log tells apart badly.
struct ConfoundedPair {
  std::string first, second;
  double correlation = 0.0;
};
inline constexpr double confounded_from = 0.95;

/// A figure before and after, with intervals of 95 %; `change` is that of the pairs.
struct Compared {
  std::string name, unit;
  double before = 0.0, after = 0.0;
  std::pair<double, double> before_interval, after_interval, change_interval;
};

/// Innovations of a sensor by the scenario's own estimator, nothing of which is withheld from it but what judges.
struct TunedSensor {
  std::string name;
  double expected = 0.0;             ///< mean number of values of a measurement: what the NIS is to be
  double before = 0.0, after = 0.0;  ///< mean NIS, normalised innovation squared
};

struct LogTuning {
  Settings settings;  ///< the scenario with what was found: complete, one estimator
  std::string variant;
  std::string filter;  ///< the one whose innovations were looked at: ekf or bank
  std::vector<TunedNumber> numbers;
  std::vector<TriedLaw> laws;
  std::vector<TriedEstimator> estimators;
  std::vector<ConfoundedPair> confounded;
  std::vector<std::string> remarks;                        ///< what cannot be told, in words
  std::vector<Compared> judged;                            ///< by fixes that nothing was tuned on; empty without any
  std::vector<TunedSensor> sensors;                        ///< of a log with the vehicle's own sensors
  int fixes = 0;                                           ///< or measurements, that count in the likelihood
  std::string entry_name = "fix", entries_name = "fixes";  ///< what these are called
  std::string unit = "m";                                  ///< of what is withheld
  double log_likelihood_before = 0.0, log_likelihood_after = 0.0;
  double degrees_before = 0.0, degrees_after = 0.0;  ///< of freedom of Student's t
  int evaluations = 0;
  bool stopped = false;
  double seconds = 0.0;
};

/// The fewest fixes that a log must have to tune on.
inline constexpr int least_fixes = 30;

/// Tunes a scenario (one variant, without `variants`) on a log by the likelihood of its innovations (docs/tune.md).
/// Throws Error if the scenario is wrong, or the log too short.
RHEC_EXPORT LogTuning tune_on_log(const Host& host, const Settings& settings, const LogTables& tables,
                                  const LogTuningOptions& options, const TuningHooks& hooks = {});

/// The files of a tuning.
RHEC_EXPORT std::string tuned_yaml(const LogTuning& tuning, const std::string& origin);
RHEC_EXPORT std::string summary_json(const LogTuning& tuning);
RHEC_EXPORT std::string tuning_svg(const LogTuning& tuning);

}  // namespace rhec::sim
