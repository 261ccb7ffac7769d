#include "tuned_tables.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "rhec/sim/logs/smoothing.hpp"

namespace rhec::sim {
namespace {

// Ground that is driven before fixes count: until then the filter finds its heading. At most this share of the log.
constexpr double table_found_after = 25.0, most_of_table = 0.1;

/// From when on the heading should be known [s].
double known_from(const std::vector<DeadReckoning>& rows) {
  const double most = rows.front().time + most_of_table * (rows.back().time - rows.front().time);
  double covered = 0.0, from = rows.front().time;
  for (std::size_t i = 1; i < rows.size() && covered < table_found_after && rows[i].time < most; ++i) {
    if (!std::isnan(rows[i].speed)) covered += std::abs(rows[i].speed) * (rows[i].time - rows[i - 1].time);
    from = rows[i].time;
  }
  return from;
}

/// Distances of withheld fixes. Those before the first estimate count as `error_cap`.
std::vector<double> residuals_of(const Replay& replayed, std::size_t fixes, const HoldOut& withheld) {
  std::vector<double> residuals(fixes, std::numeric_limits<double>::quiet_NaN());
  for (const LoggedEstimate& entry : replayed.estimates)
    if (entry.held_out) residuals[static_cast<std::size_t>(entry.fix)] = entry.residual;
  std::int64_t unpredicted = replayed.unpredicted;  // the first ones
  for (std::size_t i = 0; i < fixes && unpredicted > 0; ++i)
    if (withheld.holds(i)) residuals[i] = error_cap, --unpredicted;
  return residuals;
}

}  // namespace

TunedTables::TunedTables(const Host& host, const LogTables& tables, const Settings& settings, const HoldOut& hold_out)
    : host_(host), tables_(tables), judges_(hold_out) {
  const RecordedLog log = recorded_log(tables, LogScenario(host, settings));
  const double from = known_from(log.rows);
  for (std::size_t i = 0; i < log.fixes.size(); ++i) {
    const bool is_known = log.fixes[i].time > from;
    entries_.push_back({.time = log.fixes[i].time,
                        .sensor = 0,
                        .counts = is_known && !hold_out.holds(i),
                        .is_judge = is_known && hold_out.holds(i)});
  }
}

Robot TunedTables::robot(const Settings& settings) const {
  return LogScenario(host_, settings).variants().front().robot;
}

std::vector<Tunable> TunedTables::tunables(const Settings& settings, const TuningWishes& wishes) const {
  return tunables_of(host_, LogScenario(host_, settings), wishes);
}

/// What sensors are off by is what is tuned: nobody takes it out of them.
std::vector<Innovation> TunedTables::innovations(const Settings& settings, const HoldOut& withheld) const {
  Settings as_measured = settings;
  as_measured.set("estimator.health.offsets", Settings::scalar("false"));
  const LogScenario scenario(host_, as_measured);
  return sim::innovations(scenario.variants().front().robot, recorded_log(tables_, scenario), scenario.log(), withheld);
}

std::vector<double> TunedTables::predictions(const Settings& settings, const HoldOut& withheld,
                                             bool without_judges) const {
  const LogScenario scenario(host_, settings);
  RecordedLog log = recorded_log(tables_, scenario);
  if (without_judges)
    for (std::size_t i = 0; i < log.fixes.size(); ++i)
      if (judges_.holds(i)) log.fixes[i].x = log.fixes[i].y = std::nan("");
  return residuals_of(replay(scenario.variants().front().robot, log, scenario.log(), withheld), log.fixes.size(),
                      withheld);
}

std::vector<double> TunedTables::interpolations(const Settings& settings, const HoldOut& withheld) const {
  const LogScenario scenario(host_, settings);
  const RecordedLog log = recorded_log(tables_, scenario);
  return residuals_of(
      smooth(scenario.name(), scenario.variants().front().robot, log, scenario.log(), withheld).smoothed,
      log.fixes.size(), withheld);
}

}  // namespace rhec::sim
