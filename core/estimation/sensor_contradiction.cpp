#include <algorithm>
#include <cmath>

#include "innovation.hpp"
#include "sensor_judge_parts.hpp"

// A measured input that is wrong beside a sensor that sees the same, as an encoder of what is steered: only the
// position tells which of the two it is.

namespace rhec {

namespace {

// Since so many measured positions an input may be wrong.
constexpr int input_wrong_since[] = {2, 4, 8, 16, 32};
// Failures of a position at which that is looked for.
constexpr int failures_looked_at = 5;
// So many measurements in a row have to agree with an input again: if it says something else than it did when it was
// wrong, or what is measured moves, by so many standard deviations; or for longer, for an input that reads zero agrees
// as long as the vehicle goes straight, too.
constexpr int agrees_again = 3, agrees_without_motion = 10;
constexpr double moves = 6.0;
// Samples for which the input is the one that is suspected first.
constexpr int remembered = 500;
// An input that is known by what a sensor says of it alone may change by its typical magnitude within this time [s].
constexpr double changes_within = 0.1;

void loosen(int input, WalkingFilter& filter) noexcept {
  const double scale = filter.model().description().inputs[static_cast<std::size_t>(input)].scale;
  filter.inputs().walk_at_least(input, scale * scale / changes_within);
}

}  // namespace

/// What a wrong input has made of slip is not known any more; what it has taken to its bounds is what it usually is.
void SensorJudge::forget_slip(WalkingFilter& filter) const noexcept {
  const std::vector<Variable>& about = filter.model().description().parameters;
  filter.restart_parameters(setup_.parameter_sigmas);
  for (std::size_t p = 0; p < about.size(); ++p) {
    double& slip = filter.mean()[filter.model().state_count() + static_cast<Eigen::Index>(p)];
    const bool is_within = slip > setup_.noise.parameter_lower[p] && slip < setup_.noise.parameter_upper[p];
    if (!is_within)
      slip = std::clamp(about[p].nominal, setup_.noise.parameter_lower[p], setup_.noise.parameter_upper[p]);
  }
}

/// Goes on from what was known so many entries ago to what is expected now, as if the input had not been measured
/// since, with what the sensor has said in truth, and with the positions that were rejected. What was made of the input
/// for slip counts no longer. Whether all of it passes its gates then, and what is measured now a close one.
bool SensorJudge::replay_without_input(const Contradiction& each, int ago, WalkingFilter& filter) noexcept {
  Memory& memory = *memory_;
  const auto input = static_cast<std::size_t>(each.input);
  bool is_explained = true;
  const auto compare = [&](Measured outputs, const std::vector<double>& limits) {
    filter.expect();
    for (std::size_t s = 0; s < sensors_.size(); ++s)
      if ((s == each.sensor || sees_position(sensors_[s].outputs)) && filter.innovation(sensors_[s], outputs, scratch_))
        is_explained = is_explained && scratch_.nis <= limits[static_cast<std::size_t>(scratch_.value.size())];
    if (is_explained) filter.update_as_expected(outputs);
  };
  filter.inputs().forget();
  loosen(each.input, filter);
  memory.recent->go_back(ago, filter);
  forget_slip(filter);
  for (; is_explained && ago > 0; --ago) {
    const RecentSamples::Entry &from = memory.recent->entry(ago), &next = memory.recent->entry(ago - 1);
    std::copy(from.inputs.begin(), from.inputs.end(), memory.inputs_without.begin());
    memory.inputs_without[input] = Memory::unknown;
    filter.predict(memory.inputs_without.data(), next.time - from.time);
    memory.replayed = next.outputs;
    for (const int j : sensors_[each.sensor].outputs) memory.replayed.values()[j] = Memory::unknown;
    memory.replayed.add(next.contradicting.measured());
    memory.replayed.add(next.rejected.measured());
    compare(memory.replayed.measured(), limits_);
  }
  if (!is_explained) return false;
  std::copy(input_.begin(), input_.end(), memory.inputs_without.begin());
  memory.inputs_without[input] = Memory::unknown;
  filter.predict(memory.inputs_without.data(), memory.duration);
  memory.replayed.assign(weighed(raw_.data()));
  as_measured(sensors_[each.sensor], memory.replayed.values());
  compare(memory.replayed.measured(), close_limits_);
  return is_explained;
}

/// How many entries there are since what was known before the sensor that contradicts began to fail; 0: it does not,
/// or that is not remembered.
int SensorJudge::entries_since_failure(const Contradiction& each) noexcept {
  const Record& record = records_[each.sensor];
  if (record.failures == 0) return 0;
  const int ago = memory_->recent->since(record.since);
  return ago < memory_->recent->known() ? ago : 0;
}

bool SensorJudge::doubts_input(std::size_t input) const noexcept { return memory_->doubts[input].is_doubted; }

/// What is taken out of a sensor's outputs is put back.
void SensorJudge::as_measured(const Sensor& sensor, double* outputs) const noexcept {
  for (const int j : sensor.outputs) outputs[j] += memory_->offsets->offset(j);
}

/// Whether all of it is explained by an input that is wrong since some time; `filter` is what is known then.
bool SensorJudge::is_explained_without_input(const Contradiction& each, WalkingFilter& filter) noexcept {
  int replayed = 0;
  const auto explains = [&](int ago) {
    if (ago == 0 || memory_->has_gap(ago) || replayed + ago > most_replayed) return false;
    replayed += ago;
    return replay_without_input(each, ago, filter);
  };
  if (explains(entries_since_failure(each))) return true;
  return std::ranges::any_of(input_wrong_since,
                             [&](int positions) { return explains(memory_->recent->with_positions_known(positions)); });
}

/// Whether an input is wrong, with the sensor that contradicts it being right: the estimate then goes on without it.
bool SensorJudge::distrust(const Contradiction& each) noexcept {
  Memory& memory = *memory_;
  const auto input = static_cast<std::size_t>(each.input);
  WalkingFilter &filter = own_->filter, &trial = *memory.trial;
  if (!is_explained_without_input(each, trial)) return false;
  memory.doubts[input] = {.is_doubted = true, .least = infinity, .most = -infinity, .remembered = remembered};
  input_findings_ |= reason::rejected;
  doubted_input_ = each.input;
  as_measured(sensors_[each.sensor], raw_.data());
  for (const int j : sensors_[each.sensor].outputs) memory.offsets->forget(j);
  memory.offsets->forget_onsets();
  filter.mean() = trial.mean();
  filter.covariance() = trial.covariance();
  filter.inputs() = trial.inputs();
  for (Hypothesis* of : {slip_.get(), edge_.get(), moved_.get(), back_.get(), memory.double_fault.get()})
    loosen(each.input, of->filter);
  std::ranges::fill(records_, Record{});
  end_dispute();
  // Methods that know more of slip than the filter does learn it anew from here.
  memory.jumps[0] = memory.recent->keep_newest();
  memory.jump_count = 1;
  held_count_ = 0;
  return true;
}

/// Whether an input is wrong, and a sensor that contradicts it is blamed for that.
bool SensorJudge::distrust_instead() noexcept {
  return std::ranges::any_of(memory_->contradictions, [&](const Contradiction& each) {
    const auto is_off = [&](int j) { return memory_->offsets->offset(j) != 0.0; };
    const bool is_blamed =
        records_[each.sensor].failures > 0 || std::ranges::any_of(sensors_[each.sensor].outputs, is_off);
    return is_blamed && !memory_->doubts[static_cast<std::size_t>(each.input)].is_doubted && distrust(each);
  });
}

/// Whether a position fails since then.
bool SensorJudge::consider_inputs() noexcept {
  const int position = disputed_position();
  if (position < 0) return false;
  const Record& record = records_[static_cast<std::size_t>(position)];
  if (record.after_gap || record.failures > failures_looked_at || is_placed_by_other(position)) return false;
  return distrust_instead();
}

/// Whether a sensor that is suspected contradicts an input that was wrong of late, and still is.
bool SensorJudge::distrust_again() noexcept {
  return std::ranges::any_of(memory_->contradictions, [&](const Contradiction& each) {
    const Memory::Doubt& doubt = memory_->doubts[static_cast<std::size_t>(each.input)];
    if (doubt.is_doubted || doubt.remembered == 0) return false;
    const bool is_suspected = records_[each.sensor].failures >= suspect_after ||
                              std::ranges::find(sensors_[each.sensor].outputs, memory_->offsets->suspected()) !=
                                  sensors_[each.sensor].outputs.end();
    return is_suspected && distrust(each);
  });
}

/// Whether inputs that are doubted agree again with those who contradicted them.
void SensorJudge::test_doubted() noexcept {
  Memory& memory = *memory_;
  for (std::size_t j = 0; j < memory.doubts.size(); ++j) {
    Memory::Doubt& doubt = memory.doubts[j];
    doubt.remembered -= doubt.remembered > 0 && !doubt.is_doubted && memory.is_counted;
    if (!doubt.is_doubted) continue;
    input_findings_ |= reason::rejected;
    doubted_input_ = static_cast<int>(j);
    WalkingFilter& trial = *memory.trial;
    trial.mean() = memory.before_mean;
    trial.covariance() = memory.before_covariance;
    std::copy(input_.begin(), input_.end(), memory.inputs_without.begin());
    memory.inputs_without[j] = memory.measured_inputs[j];
    trial.predict(memory.inputs_without.data(), memory.duration);
    trial.expect();
    for (const Contradiction& each : memory.contradictions) {
      if (each.input != static_cast<int>(j) || !trial.innovation(sensors_[each.sensor], weighed(raw_.data()), scratch_))
        continue;
      const double value = raw_[static_cast<std::size_t>(each.output)],
                   variance = scratch_.covariance.diagonal().maxCoeff();
      if (!(scratch_.nis <= close_limits_[static_cast<std::size_t>(scratch_.value.size())])) {
        doubt.agreed = 0;
        doubt.least = doubt.most = trial.expected(each.output);
        continue;
      }
      ++doubt.agreed;
      doubt.least = std::min(doubt.least, value);
      doubt.most = std::max(doubt.most, value);
      const double range = doubt.most - doubt.least;
      const bool has_moved = range * range > moves * moves * variance;
      doubt.is_doubted = doubt.agreed < (has_moved ? agrees_again : agrees_without_motion);
      if (!doubt.is_doubted) break;
    }
  }
}

}  // namespace rhec
