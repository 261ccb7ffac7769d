#pragma once

#include <string>
#include <vector>

#include "rhec/core/config/settings.hpp"
#include "rhec/plugins/robot/robot.hpp"
#include "rhec/sim/logs/recorded_log.hpp"
#include "rhec/sim/replay/replay_summary.hpp"
#include "rhec/sim/tuning/innovations.hpp"
#include "rhec/sim/tuning/tunable.hpp"

namespace rhec::sim {

/// A measurement of a log that a filter can be asked about before it has it.
struct TunedEntry {
  double time = 0.0;  ///< [s]
  int sensor = 0;
  bool counts = false;    ///< in the likelihood
  bool is_judge = false;  ///< withheld from the search
};

/// A log as tuning sees it, of either kind: entries, and what scenarios expect of them. Results have one item for each
/// entry, whatever the scenario. All members are safe to call from several threads at once.
class TunedLog {
 public:
  virtual ~TunedLog() = default;
  virtual const std::vector<TunedEntry>& entries() const = 0;
  /// Of the log, for errors: its file, if it has one.
  virtual std::string name() const = 0;
  /// What an entry is called: "fix", "fixes".
  virtual std::string entry_name(bool is_plural) const = 0;
  /// Of what is withheld, "m" for positions.
  virtual std::string withheld_unit() const = 0;

  /// The variant of a scenario. Throws Error where it is wrong.
  virtual Robot robot(const Settings& settings) const = 0;
  virtual std::vector<Tunable> tunables(const Settings& settings, const TuningWishes& wishes) const = 0;
  /// Of all entries that `withheld` leaves to the scenario's estimator; the others have the size 0.
  virtual std::vector<Innovation> innovations(const Settings& settings, const HoldOut& withheld) const = 0;
  /// Distances of withheld entries from what was predicted; NaN for the others. `without_judges`: those that judge are
  /// not there at all.
  virtual std::vector<double> predictions(const Settings& settings, const HoldOut& withheld,
                                          bool without_judges) const = 0;
  /// The same, interpolated by the smoother.
  virtual std::vector<double> interpolations(const Settings& settings, const HoldOut& withheld) const = 0;
  /// Innovations by sensor, of the scenario's own estimator; empty where that is not known.
  virtual std::vector<SensorSummary> sensors(const Settings& settings, const HoldOut& withheld) const = 0;
};

}  // namespace rhec::sim
