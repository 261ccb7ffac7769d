#pragma once

#include <atomic>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "rhec/core/base/clock.hpp"
#include "rhec/sim/tuning/innovations.hpp"
#include "rhec/sim/tuning/log_tuning.hpp"
#include "rhec/sim/tuning/precision.hpp"
#include "rhec/sim/tuning/search.hpp"
#include "tuned_log.hpp"

namespace rhec::sim {

/// A log likelihood that is higher by no more than this is no better.
inline constexpr double as_good = 2.0;
/// What a search may take.
inline constexpr int evaluations_per_number = 30;

/// `tune_on_log` and `tune_on_drive`, step by step.
class LogTuner {
 public:
  LogTuner(const Settings& settings, const TunedLog& log, const LogTuningOptions& options, const TuningHooks& hooks);
  LogTuning run();

 private:
  /// The filter whose innovations are looked at, and what of it is tuned.
  struct Filter {
    Settings settings;
    std::vector<Tunable> tunables;
  };
  struct Terms {
    LogLikelihood likelihood;
    Eigen::VectorXd terms;  ///< of the fixes that count
  };
  /// What is found for the numbers of a changed part of the scenario, while the others keep their values.
  struct Trial {
    Filter filter;
    Terms terms;
    TriedLaw law;
  };

  int size() const { return static_cast<int>(filter_.tunables.size()); }
  const std::vector<Variable>& parameters() const { return robot_.model()->description().parameters; }
  double seconds() const;
  bool stopped() const;
  void begin(const std::string& stage);
  void tell() const;

  // What is looked at.
  void make_filter();
  Terms terms_of(const Settings& settings) const;
  Terms terms_at(const Filter& filter, const Eigen::VectorXd& at) const;
  double value_at(const Filter& filter, const Eigen::VectorXd& at) const;

  // What is most likely.
  SearchOptions search_options(const Filter& filter, double step, int most_evaluations) const;
  void search(double step);
  Trial try_law(const std::string& key, const Settings& law) const;
  void compare_with(const Terms& present, Trial& trial) const;
  void take(const Trial& trial);
  void try_laws(const Variable& parameter);

  // What that is worth.
  std::vector<HoldOut> rests() const;
  std::vector<double> errors_of(const Settings& settings, const HoldOut& rest) const;
  void settle();
  int block_count() const;
  Precision precision_of(const Filter& filter, const Eigen::VectorXd& at) const;
  void find_precision();
  void hold_what_is_not_told();
  void take_values();
  void choose_estimator();
  void note_what_is_not_told();
  void find_slices();
  void judge();

  const TunedLog& log_;
  Settings settings_;
  LogTuningOptions options_;
  const TuningHooks& hooks_;
  Robot robot_;               ///< as the scenario has it
  std::vector<bool> counts_;  ///< by entry; after the first look those that a filter was asked about
  Filter filter_, before_;
  Eigen::VectorXd at_;                  ///< the best so far
  std::optional<Precision> precision_;  ///< none if stopped before
  std::vector<bool> is_told_;           ///< by the precision
  std::string estimator_;               ///< of the scenario
  bool is_held_ = false;                ///< what is not told is as the scenario has it
  LogTuning result_;

  Clock::time_point began_ = Clock::now();
  mutable std::mutex mutex_;  ///< of what follows
  mutable std::atomic<bool> stopped_ = false;
  mutable int evaluations_ = 0;
  mutable std::vector<std::pair<double, Eigen::VectorXd>> tried_;  ///< by the search, and how likely they are
  std::string stage_;
  double start_value_ = 0.0, best_value_ = 0.0;
};

}  // namespace rhec::sim
