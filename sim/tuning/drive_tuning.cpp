#include "rhec/sim/tuning/drive_tuning.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <memory>
#include <optional>

#include "drive_innovations.hpp"
#include "log_tuner.hpp"
#include "rhec/core/base/error.hpp"
#include "rhec/sim/loop/scenario.hpp"
#include "rhec/sim/replay/drive_smoothing.hpp"
#include "rhec/sim/replay/replay_scenario.hpp"
#include "rhec/sim/world/truth_estimator.hpp"
#include "tuned_log.hpp"

namespace rhec::sim {
namespace {

constexpr double nothing = std::numeric_limits<double>::quiet_NaN();
// Ground that is driven before measurements count where a heading is searched; at most this share of the log.
constexpr double found_after = 25.0, most_found = 0.1;
// Innovations are those of a measurement whose time is this close [s].
constexpr double same_stamp = 2e-6;
// Sensors that measure at one time are asked one after the other, this far apart [s]: each is then expected from what
// the others have said, so that densities multiply.
constexpr double stagger = 1e-5;

/// What is added to each output or input of a drive by the section `signals`, by its path; 0 where that says nothing.
double offset_at(const Settings& settings, const std::string& key) {
  const Settings* given = settings.find_path(key);
  return given ? given->as_number() : 0.0;
}

/// A drive with the vehicle's own sensors. An entry is what one sensor says in one event.
class TunedDrive final : public TunedLog {
 public:
  TunedDrive(const Host& host, const logs::Drive& drive, const Settings& settings, const HoldOut& hold_out)
      : host_(host), drive_(drive), base_(settings), judges_(hold_out) {
    if (settings.find("path")) start_ = Scenario(host, settings).initial_state();
    const Robot first = robot(settings);
    const ModelDescription& about = first.model()->description();
    for (const Variable& output : about.outputs) offsets_.push_back("signals.outputs." + output.name + ".offset");
    inputs_ = static_cast<std::size_t>(drive.inputs);
    for (std::size_t j = 0; j < inputs_; ++j) offsets_.push_back("signals.inputs." + about.inputs[j].name + ".offset");
    const DriveReplay replay = replay_drive(first, drive, {}, start_);
    sensors_ = replay.sensors;
    withheld_ = sensor_to_withhold(first, sensors_);
    unit_ = about.outputs[static_cast<std::size_t>(sensors_[static_cast<std::size_t>(withheld_)].outputs.front())].unit;
    const int heading = about.roles.heading;
    const bool is_searched = first.estimator_options().heading_starts > 1 ||
                             (heading >= 0 && std::isnan(start_of(first, drive, start_)[heading]));
    list_entries(is_searched ? known_from(replay, about.roles) : -std::numeric_limits<double>::infinity());
  }

  const std::vector<TunedEntry>& entries() const override { return entries_; }
  std::string name() const override { return "the log"; }
  std::string entry_name(bool is_plural) const override { return is_plural ? "measurements" : "measurement"; }
  std::string withheld_unit() const override { return unit_; }

  Robot robot(const Settings& settings) const override {
    return {host_, ReplayOptions::table().parse(settings, "scenario"), scenario_estimators()};
  }

  std::vector<Tunable> tunables(const Settings& settings, const TuningWishes& wishes) const override {
    std::vector<Sensor> measured;
    for (std::size_t s = 0; s < sensors_.size(); ++s)
      if (!by_sensor_[s].empty()) measured.push_back(sensors_[s]);
    std::vector<Tunable> all = drive_tunables(host_, robot(settings), settings, measured, wishes);
    for (const Tunable& tunable : all)
      for (const std::string& key : tunable.keys)
        if (key.starts_with("signals.") && std::find(offsets_.begin(), offsets_.end(), key) == offsets_.end())
          throw Error(fmt::format(
              "--tune {}: of the section `signals` only offsets can be tuned, as the log is read once; expected the "
              "offset of an output or input, or e.g. estimator.delays.OUTPUT",
              key));
    return all;
  }

  /// Everything is known when it was measured: what a filter knows at a measurement would else leap with delays.
  std::vector<Innovation> innovations(const Settings& settings, const HoldOut& withheld) const override {
    Settings punctual = settings;
    punctual.set("estimator.delays", Settings::null());
    punctual.set("estimator.health.watch", Settings::scalar("false"));
    const Robot chosen = robot(punctual);
    const ModelDescription& about = chosen.model()->description();
    std::vector<double> delays;
    for (const Sensor& sensor : sensors_)
      delays.push_back(offset_at(
          settings, "estimator.delays." + about.outputs[static_cast<std::size_t>(sensor.outputs.front())].name));
    std::vector<Innovation> found(entries_.size());
    for (const AskedInnovation& each :
         asked_innovations(chosen, in_time(shifted(settings), delays), withheld, start_)) {
      const auto s = static_cast<std::size_t>(each.sensor);
      const double stamp = each.time + delays[s] - stagger * static_cast<double>(s);
      const std::vector<std::size_t>& candidates = by_sensor_[s];
      auto at = std::lower_bound(candidates.begin(), candidates.end(), stamp - same_stamp,
                                 [&](std::size_t entry, double time) { return entries_[entry].time < time; });
      // Of measurements at one time they come one after the other.
      while (at != candidates.end() && found[*at].size > 0) ++at;
      if (at != candidates.end() && entries_[*at].time <= stamp + same_stamp) found[*at] = each.innovation;
    }
    return found;
  }

  std::vector<double> predictions(const Settings& settings, const HoldOut& withheld,
                                  bool without_judges) const override {
    logs::Drive drive = shifted(settings);
    if (without_judges)
      for (std::size_t i = 0; i < entries_.size(); ++i)
        if (is_withheld_[i])
          for (const int j : sensors_[static_cast<std::size_t>(withheld_)].outputs)
            drive.values[drive.events[events_[i]].values + static_cast<std::size_t>(j)] = nothing;
    return distances_of(replay_drive(robot(settings), drive, withheld, start_));
  }

  std::vector<double> interpolations(const Settings& settings, const HoldOut& withheld) const override {
    return distances_of(smooth_drive("tuned", robot(settings), shifted(settings), withheld, start_).smoothed);
  }

  std::vector<SensorSummary> sensors(const Settings& settings, const HoldOut& withheld) const override {
    const Robot chosen = robot(settings);
    return summarise_innovations(replay_drive(chosen, shifted(settings), withheld, start_), chosen);
  }

 private:
  /// From when on a heading that is searched should be known [s].
  double known_from(const DriveReplay& replay, const Roles& roles) const {
    const double begin = drive_.events.front().time, end = drive_.events.back().time;
    const double most = begin + most_found * (end - begin);
    if (roles.position_x < 0 || roles.position_y < 0) return begin;
    double covered = 0.0, from = begin;
    for (std::size_t i = 1; i < replay.estimates.size() && covered < found_after && from < most; ++i) {
      const Eigen::VectorXd &one = replay.estimates[i - 1].values, &other = replay.estimates[i].values;
      covered +=
          std::hypot(other[roles.position_x] - one[roles.position_x], other[roles.position_y] - one[roles.position_y]);
      from = replay.estimates[i].time;
    }
    return std::min(from, most);
  }

  void list_entries(double known_from) {
    by_sensor_.resize(sensors_.size());
    std::size_t count = 0;
    for (std::size_t i = 0; i < drive_.events.size(); ++i) {
      const logs::DriveEvent& event = drive_.events[i];
      if (!event.is_output) continue;
      for (std::size_t s = 0; s < sensors_.size(); ++s) {
        if (std::ranges::all_of(sensors_[s].outputs, [&](int j) { return std::isnan(drive_.values_of(event)[j]); }))
          continue;
        const bool is_withheld = static_cast<int>(s) == withheld_ && judges_.holds(count++);
        const bool is_known = event.time > known_from;
        by_sensor_[s].push_back(entries_.size());
        if (static_cast<int>(s) == withheld_) by_event_[i] = entries_.size();
        entries_.push_back({.time = event.time,
                            .sensor = static_cast<int>(s),
                            .counts = is_known && !is_withheld,
                            .is_judge = is_known && is_withheld});
        events_.push_back(i);
        is_withheld_.push_back(is_withheld);
      }
    }
    for (std::vector<std::size_t>& entries : by_sensor_)
      std::stable_sort(entries.begin(), entries.end(),
                       [&](std::size_t a, std::size_t b) { return entries_[a].time < entries_[b].time; });
  }

  /// The drive with the offsets of a scenario in the place of those that it was read with.
  logs::Drive shifted(const Settings& settings) const {
    logs::Drive drive = drive_;
    const std::size_t outputs = offsets_.size() - inputs_;
    for (std::size_t k = 0; k < offsets_.size(); ++k) {
      const double by = offset_at(settings, offsets_[k]) - offset_at(base_, offsets_[k]);
      if (by == 0.0) continue;
      const bool is_output = k < outputs;
      for (const logs::DriveEvent& event : drive.events)
        if (event.is_output == is_output) drive.values[event.values + (is_output ? k : k - outputs)] += by;
    }
    return drive;
  }

  /// What each sensor says as an event of its own, at the time at which it was measured, all in this order.
  logs::Drive in_time(const logs::Drive& drive, const std::vector<double>& delays) const {
    logs::Drive result;
    result.start = drive.start;
    result.outputs = drive.outputs;
    result.inputs = drive.inputs;
    const auto add = [&](const logs::DriveEvent& event, double time, const auto& value_of) {
      result.events.push_back(event);
      result.events.back().time = result.events.back().arrival = time;
      result.events.back().values = result.values.size();
      const std::size_t count = event.is_output ? offsets_.size() - inputs_ : inputs_;
      for (std::size_t j = 0; j < count; ++j) result.values.push_back(value_of(j));
      if (const double* const sigmas = drive.sigmas_of(event))
        result.values.insert(result.values.end(), sigmas, sigmas + count);
    };
    for (const logs::DriveEvent& event : drive.events) {
      const double* values = drive.values_of(event);
      if (!event.is_output) {
        add(event, event.time, [&](std::size_t j) { return values[j]; });
        continue;
      }
      for (std::size_t s = 0; s < sensors_.size(); ++s) {
        const std::vector<int>& outputs = sensors_[s].outputs;
        if (std::ranges::all_of(outputs, [&](int j) { return std::isnan(values[j]); })) continue;
        add(event, event.time - delays[s] + stagger * static_cast<double>(s), [&](std::size_t j) {
          return std::find(outputs.begin(), outputs.end(), static_cast<int>(j)) != outputs.end() ? values[j] : nothing;
        });
      }
    }
    std::stable_sort(result.events.begin(), result.events.end(),
                     [](const logs::DriveEvent& a, const logs::DriveEvent& b) { return a.time < b.time; });
    return result;
  }

  /// Those before the first estimate count as `error_cap`.
  std::vector<double> distances_of(const DriveReplay& replay) const {
    std::vector<double> distances(entries_.size(), nothing);
    for (const DrivePrediction& prediction : replay.predictions)
      distances[by_event_.at(prediction.event)] = prediction.distance;
    std::int64_t unpredicted = replay.unpredicted;
    for (std::size_t i = 0; i < entries_.size() && unpredicted > 0; ++i)
      if (is_withheld_[i] && std::isnan(distances[i])) distances[i] = error_cap, --unpredicted;
    return distances;
  }

  const Host& host_;
  const logs::Drive& drive_;
  Settings base_;
  HoldOut judges_;
  std::optional<Eigen::VectorXd> start_;
  std::vector<Sensor> sensors_;
  int withheld_ = 0;
  std::string unit_;
  std::vector<std::string> offsets_;  ///< keys, of outputs and then of inputs
  std::size_t inputs_ = 0;
  std::vector<TunedEntry> entries_;
  std::vector<std::size_t> events_;                  ///< of the drive, by entry
  std::vector<bool> is_withheld_;                    ///< by entry
  std::vector<std::vector<std::size_t>> by_sensor_;  ///< entries in the order of their times
  std::map<std::size_t, std::size_t> by_event_;      ///< entries of the sensor that is withheld
};

/// Settings in which a signal that is only named has a section of its own, so that it takes an offset.
Settings with_sections_of_signals(const Settings& settings) {
  Settings result = settings;
  for (const char* const key : {"signals.outputs", "signals.inputs"}) {
    const Settings* signals = settings.find_path(key);
    if (!signals || signals->kind() != Settings::Kind::map) continue;
    for (const auto& [name, source] : signals->members()) {
      const bool is_none = source.kind() == Settings::Kind::scalar && source.text() == "none";
      if (source.kind() == Settings::Kind::map || is_none) continue;
      Settings section = Settings::map(source.origin());
      section.add("from", source);
      result.set(fmt::format("{}.{}", key, name), section);
    }
  }
  return result;
}

}  // namespace

LogTuning tune_on_drive(const Host& host, const Settings& settings, const logs::Drive& drive,
                        const LogTuningOptions& options, const TuningHooks& hooks) {
  const Settings whole = with_sections_of_signals(settings);
  const TunedDrive log(host, drive, whole, options.hold_out);
  return LogTuner(whole, log, options, hooks).run();
}

}  // namespace rhec::sim
