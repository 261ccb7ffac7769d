#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "innovation.hpp"
#include "sensor_judge_parts.hpp"

// A compass or an encoder that was believed, and is wrong: the position tells.

namespace rhec {

namespace {

// Since so many measured positions it may be wrong.
constexpr int wrong_since[] = {3, 6, 12, 24};
// Measurements of a disputed position at which that is looked for.
constexpr int looked_for = 5;
// A sensor that is off since then has jumped by at least this share of its innovation at once, as nu' S^-1 nu.
constexpr double at_once = 0.25;
// How wrong an angle may have been made by a sensor before it was rejected [rad].
constexpr double wrong_angle = 0.3;

}  // namespace

/// That a sensor is wrong since so many samples. `anew`: what it has said of its states before counts no longer, nor
/// does what was made of that for slip.
struct SensorJudge::Suspicion {
  std::size_t sensor = 0;
  int ago = 0;
  bool anew = false;
};

/// Goes on from what was known before a suspicion to what is expected now, without what is not missing in `retracted`,
/// but with the positions that were rejected since. Whether these pass their gates then, and the sensor has jumped and
/// fails a close gate (or is rejected anyway). `change`: what is remembered becomes that.
bool SensorJudge::replay_without(const Suspicion& suspicion, WalkingFilter& filter, bool change) noexcept {
  Memory& memory = *memory_;
  const Sensor& sensor = sensors_[suspicion.sensor];
  const bool is_rejected = records_[suspicion.sensor].failures > 0;
  bool is_off = is_rejected, are_explained = true;
  double jump = 0.0;
  Innovation::OfSensor<1> before;
  const auto compare = [&](Measured outputs, Measured positions) {
    filter.expect();
    if (!is_rejected && filter.innovation(sensor, outputs, scratch_)) {
      if (before.size() != scratch_.value.size()) before.setZero(scratch_.value.size());
      jump = std::max(jump, squared_size(scratch_.value - before, scratch_.covariance));
      before = scratch_.value;
      const auto degrees = static_cast<std::size_t>(before.size());
      const bool has_jumped = suspicion.anew || jump > at_once * scratch_.nis;
      is_off = scratch_.nis > (has_jumped ? close_limits_ : limits_)[degrees];
    }
    for (const Sensor& each : sensors_)
      if (sees_position(each.outputs) && filter.innovation(each, positions, scratch_))
        are_explained = are_explained && scratch_.nis <= close_limits_[static_cast<std::size_t>(scratch_.value.size())];
  };
  memory.recent->go_back(suspicion.ago, filter);
  if (suspicion.anew) {
    filter.restart_parameters(setup_.parameter_sigmas);
    const std::vector<Variable>& states = filter.model().description().states;
    for (int i = 0; i < filter.model().state_count(); ++i) {
      if (std::ranges::none_of(sensor.outputs, [&](int j) { return filter.depends_on(j, i); })) continue;
      const double sigma = states[i].is_angle ? wrong_angle : states[i].scale;
      filter.covariance()(i, i) = std::max(filter.covariance()(i, i), sigma * sigma);
    }
  }
  memory.recent->replay(suspicion.ago, filter, [&](RecentSamples::Entry& entry) {
    compare(entry.judged(), entry.rejected.measured());
    memory.replayed = entry.outputs;
    memory.replayed.remove(memory.retracted.data());
    memory.replayed.add(entry.rejected.measured());
    filter.update_as_expected(memory.replayed.measured());
    if (!change) return;
    std::swap(entry.outputs, memory.replayed);
    entry.rejected.clear();
    entry.note(filter);
  });
  filter.predict(input_.data(), memory.duration);
  compare(weighed(raw_.data()), weighed(raw_.data()));
  return is_off && are_explained;
}

/// The filter becomes what it would be if the suspicion had been known, and positions that were rejected are given
/// back.
SensorJudge::Finding SensorJudge::accuse(const Suspicion& suspicion, const Record& error,
                                         const double* outputs) noexcept {
  Memory& memory = *memory_;
  held_count_ = memory.jump_count = 0;
  for (int ago = suspicion.ago; ago-- > 0 && held_count_ < std::ssize(held_);) {
    const RecentSamples::Entry& entry = memory.recent->entry(ago);
    const double* const rejected = entry.rejected.measured().values;
    if (std::all_of(rejected, rejected + raw_.size(), [](double each) { return std::isnan(each); })) continue;
    Held& held = held_[held_count_++];
    held.time = entry.time;
    held.outputs = entry.rejected;
  }
  const double since = memory.recent->entry(suspicion.ago).time;
  memory.released = {since, since, memory.retracted.data()};
  memory.since_release = std::numeric_limits<int>::max();
  replay_without(suspicion, own_->filter, true);
  memory.recent->keep_newest();
  bool was_used = false;
  for (const int j : sensors_[suspicion.sensor].outputs) {
    double& value = raw_[static_cast<std::size_t>(j)];
    was_used = was_used || (records_[suspicion.sensor].failures == 0 && !std::isnan(value));
    value = Memory::unknown;
  }
  own_->filter.update_as_expected(weighed(raw_.data()));
  memory.offsets->forget_onsets();
  acquit(outputs);
  end_dispute();
  // Slip that has jumped just now does not explain a sensor that has been wrong for some time.
  is_disputed_ = true;
  disputed_samples_ = suspicion.ago;
  std::fill(records_.begin(), records_.end(), Record{});
  records_[suspicion.sensor] = error;
  findings_[suspicion.sensor] |= reason::rejected;
  states_[suspicion.sensor].accepted -= was_used;
  states_[suspicion.sensor].rejected += was_used;
  return {.release = true, .retract = true};
}

/// Whether another sensor that sees the position has passed its gate, and has not been silent for long since.
bool SensorJudge::is_placed_by_other(int position) const noexcept {
  for (std::size_t s = 0; s < sensors_.size(); ++s)
    if (static_cast<int>(s) != position && sees_position(sensors_[s].outputs) && records_[s].failures == 0 &&
        is_heard(s))
      return true;
  return false;
}

/// Whether a position fails since another sensor is wrong: without that one since some time all positions are
/// explained, and it is not.
bool SensorJudge::consider_other(const double* outputs, Finding& finding) noexcept {
  Memory& memory = *memory_;
  const int position = disputed_position();
  if (position < 0) return false;
  const Record& record = records_[static_cast<std::size_t>(position)];
  // Another position that passes says that this one is wrong; behind a gap it is the estimate.
  if (record.after_gap || is_placed_by_other(position)) return false;
  const bool is_unexplained = moved_->refuted > 0 && moved_->explained < Memory::informed;
  const bool is_withdrawn = record.failures == suspect_position && memory.offsets->has_recent();
  const bool is_late = record.failures > looked_for || is_withdrawn;
  if (is_late && !is_unexplained) return false;
  int replayed = 0;
  for (const int positions : wrong_since) {
    const int ago = memory.recent->with_positions(positions);
    if (ago == 0 || memory.has_gap(ago)) return false;
    for (std::size_t s = 0; s < sensors_.size(); ++s) {
      if (sees_position(sensors_[s].outputs)) continue;
      const Record& own = records_[s];
      const Suspicion suspicion{.sensor = s, .ago = ago, .anew = own.failures > 0 || is_late};
      // One that fails at once with the position does so because of slip.
      if (own.failures > 0 && own.failures < suspect_after + record.failures) continue;
      const double since = own.failures > 0 ? std::min(own.since, record.since) : record.since;
      if (suspicion.anew && ago <= memory.recent->since(since) + 1) continue;
      std::ranges::fill(memory.retracted, Memory::unknown);
      for (const int j : sensors_[s].outputs) memory.retracted[static_cast<std::size_t>(j)] = 0.0;
      // An encoder that is much quicker than the position makes that long.
      replayed += ago;
      if (replayed > most_replayed) return false;
      WalkingFilter& trial = *memory.trial;
      if (!replay_without(suspicion, trial, false)) continue;
      Record error = own;
      if (trial.innovation(sensors_[s], weighed(raw_.data()), scratch_)) {
        error = {};
        error.begin(scratch_);
      }
      error.failures = std::max(ago, suspect_after);
      error.since = memory.recent->entry(ago - 1).time;
      finding = accuse(suspicion, error, outputs);
      return true;
    }
  }
  return false;
}

/// Which of what is watched for offsets is more probably off than not, and explains a position that has failed more
/// than once: both together say enough. -1: none.
int SensorJudge::offset_in_dispute() noexcept {
  WalkingFilter& filter = own_->filter;
  const OffsetWatch& offsets = *memory_->offsets;
  const int probable = offsets.probable(), output = probable < 0 ? -1 : offsets.watched_output(probable);
  if (!is_disputed_ || disputed_samples_ > looked_for || probable < 0 || (output >= 0 && sees_position(output)))
    return -1;
  bool is_position_explained = false;
  for (std::size_t s = 0; s < sensors_.size(); ++s) {
    const bool is_rejected = (findings_[s] & reason::rejected) != 0;
    if (!is_rejected || !filter.innovation(sensors_[s], weighed(raw_.data()), scratch_)) continue;
    offsets.widen_by_candidate(filter, sensors_[s], raw_.data(), scratch_);
    const bool passes = scratch_.nis <= close_limits_[static_cast<std::size_t>(scratch_.value.size())];
    if (!passes || !sees_position(sensors_[s].outputs)) return -1;
    is_position_explained = true;
  }
  return is_position_explained ? probable : -1;
}

}  // namespace rhec
