#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "innovation.hpp"
#include "sensor_judge_parts.hpp"

// Who is wrong, where a sensor and the estimate disagree.

namespace rhec {

namespace {

// Samples in a row that measured inputs must fit before they are believed again.
constexpr int trusted_again = 3;
// New slip explains what the filter does not only if it leaves less than this share of nu' S^-1 nu.
constexpr double left_unexplained = 0.5;
// Samples of a dispute within which slip may have jumped.
constexpr int fresh = 2;
// With more than this probability what is disputed is slip that has jumped.
constexpr double probable = 0.9;
constexpr double even = 0.5;  // where it is as probable as that the sensor has jumped
// Slip that has jumped within an interval displaces the vehicle by at least this share of it on the next one again.
constexpr double goes_on_by = 0.5;
// So many samples behind slip that was found to have jumped what is disputed may be the same that it was.
constexpr int soon = 1;
// Slip that has changed within the gates has done so by this many measured positions ago.
constexpr int changed_before[] = {3, 6};
// It is at a bound then, but not beyond it by more than so many standard deviations.
constexpr double unlikely_slip = 1.0;
// A search that has not explained anything for so long begins anew.
constexpr int stale = 3;

void go_on_from(const WalkingFilter& from, WalkingFilter& filter) noexcept {
  filter.mean() = from.mean();
  filter.covariance() = from.covariance();
}

}  // namespace

/// What a position disputes has happened since the last one, of which samples of quicker sensors say little: so many
/// entries ago; 0: it is the last interval.
int SensorJudge::entries_since_position() noexcept {
  return is_position_disputed() ? memory_->recent->since_position() : 0;
}

void SensorJudge::start_slip() noexcept {
  WalkingFilter& filter = slip_->filter;
  slip_->is_active = true;
  slip_->explained = 0;
  const int back = entries_since_position();
  memory_->is_slip_near = back > 0;
  if (back > 0) {
    // Over a long interval what a position says of slip is far from linear, unless slip is nearly right already.
    replay_with_new_slip(back, nullptr);
    filter.update(weighed(raw_.data()));
    memory_->near_slip = filter.mean().tail(std::ssize(setup_.walk));
    memory_->slip_beyond = replay_with_new_slip(back, memory_->near_slip.data());
    return;
  }
  filter.mean() = memory_->before_mean;
  filter.covariance() = memory_->before_covariance;
  filter.restart_parameters(setup_.parameter_sigmas);
  filter.predict(input_.data(), memory_->duration);
}

void SensorJudge::start_blind() noexcept {
  blind_->is_active = true;
  blind_->explained = 0;
  const int since_believed = is_position_disputed() ? entries_since_believed() : 0;
  if (since_believed > 0 && replay_blind(since_believed)) {
    // They count where the dispute about them was cut short, as by a sensor that was found to be off.
    for (int ago = 0; ago < since_believed && disputed_samples_ == 1; ++ago)
      blind_->explained += memory_->recent->entry(ago).has_position;
  } else if (const int back = entries_since_position(); back > 0) {
    replay_blind(back);  // behind the last position, so that there is none
  } else {
    blind_->filter.mean() = memory_->before_mean;
    blind_->filter.covariance() = memory_->before_covariance;
  }
  predict_blind(believed_input_.data(), memory_->duration);
}

/// How many entries there are since the last position that was believed, and of those at least one that was not; 0: too
/// many, or none.
int SensorJudge::entries_since_believed() noexcept {
  RecentSamples& recent = *memory_->recent;
  const auto is_believed = [&](const RecentSamples::Entry& entry) {
    for (std::size_t j = 0; j < raw_.size(); ++j)
      if (!std::isnan(entry.outputs[static_cast<std::ptrdiff_t>(j)]) && sees_position(static_cast<int>(j))) return true;
    return false;
  };
  const int most = std::min(recent.known(), most_replayed);
  int ago = 0, rejected = 0;
  for (; ago < most && !is_believed(recent.entry(ago)); ++ago) rejected += recent.entry(ago).has_position;
  return rejected > 0 && ago < most && !memory_->has_gap(ago) ? ago : 0;
}

/// Goes through so many entries without knowing the inputs, with positions that were rejected, as long as these pass
/// their gates: inputs that are wrong may have been so since before the first of them. Whether all do.
bool SensorJudge::replay_blind(int back) noexcept {
  RecentSamples& recent = *memory_->recent;
  WalkingFilter& filter = blind_->filter;
  recent.go_back(back, filter);
  for (int ago = back; ago > 0; --ago) {
    const RecentSamples::Entry& entry = recent.entry(ago - 1);
    predict_blind(recent.entry(ago).inputs.data(), entry.time - recent.entry(ago).time);
    filter.expect();
    for (std::size_t s = 0; s < sensors_.size(); ++s)
      if (filter.innovation(sensors_[s], entry.rejected.measured(), scratch_) &&
          !(scratch_.nis <= limits_[static_cast<std::size_t>(scratch_.value.size())]))
        return false;
    memory_->replayed = entry.outputs;
    memory_->replayed.add(entry.rejected.measured());
    filter.update_as_expected(memory_->replayed.measured());
  }
  return true;
}

/// Slip is made anew so many entries ago, near a value (n_p; null: what it was), and what has been measured since used
/// with it. By how many of its standard deviations it would have to leave its bounds for that.
double SensorJudge::replay_with_new_slip(int back, const double* near) noexcept {
  WalkingFilter& filter = slip_->filter;
  memory_->recent->go_back(back, filter);
  if (near) std::copy_n(near, setup_.walk.size(), filter.mean().tail(std::ssize(setup_.walk)).data());
  filter.restart_parameters(setup_.parameter_sigmas);
  double beyond = 0.0;
  memory_->recent->replay(back, filter, [&](const RecentSamples::Entry& entry) {
    copy_numbers(filter.mean(), memory_->before_slip);
    filter.update(entry.outputs.measured());
    beyond = std::max(beyond, Memory::slip_beyond_bounds(filter, memory_->before_slip, setup_.noise));
  });
  filter.predict(input_.data(), memory_->duration);
  memory_->jumps[0] = memory_->recent->entry(back).time;
  return beyond;
}

/// The states that disputed sensors see are known anew: the position if it is among them, else all of them. One that
/// has followed the sensor for some time, until it jumped again, knows more of heading and slip than the estimate,
/// which has gone on without.
void SensorJudge::start_moved(Hypothesis& hypothesis) noexcept {
  WalkingFilter& filter = hypothesis.filter;
  const bool is_alone = &hypothesis == memory_->double_fault.get();
  hypothesis.begin();
  const ModelDescription& about = filter.model().description();
  if (!hypothesis.is_informed || is_alone) go_on_from(own_->filter, filter);
  const auto is_position = [&](int i) { return i == about.roles.position_x || i == about.roles.position_y; };
  for (std::size_t s = 0; s < sensors_.size(); ++s) {
    if (!(findings_[s] & reason::rejected) || (is_alone && !sees_position(sensors_[s].outputs))) continue;
    for (const int j : sensors_[s].outputs) {
      for (int i = 0; i < filter.model().state_count(); ++i) {
        if (!own_->filter.depends_on(j, i) || (sees_position(j) && !is_position(i))) continue;
        const double error = std::isnan(raw_[j]) ? 0.0 : 3.0 * std::abs(raw_[j] - own_->filter.expected(j));
        const double sigma =
            about.states[i].is_angle ? std::numbers::pi : std::max(displacement * about.states[i].scale, error);
        filter.covariance()(i, i) = std::max(filter.covariance()(i, i), sigma * sigma);
      }
    }
  }
}

/// Whether all measurements pass their gates.
bool SensorJudge::fits(WalkingFilter& filter, const double* outputs) noexcept {
  filter.expect();
  bool fits = true;
  for (std::size_t s = 0; s < sensors_.size(); ++s)
    if (filter.innovation(sensors_[s], weighed(outputs), scratch_))
      fits = fits && scratch_.nis <= limit(s, scratch_.value.size());
  return fits;
}

void SensorJudge::refute(Hypothesis& hypothesis) noexcept {
  hypothesis.is_informed = hypothesis.explained >= Memory::informed;
  hypothesis.is_active = false;
  hypothesis.explained = 0;
  ++hypothesis.refuted;
  if (&hypothesis == slip_.get()) slip_probability_ = 0.0;
}

/// Beside slip that has just been made anew goes one that is so on the next interval, too.
void SensorJudge::begin_edge(bool is_new) noexcept {
  edge_->is_active = is_new && slip_->is_active;
  if (!edge_->is_active) return;
  go_on_from(slip_->filter, edge_->filter);
  edge_->filter.restart_parameters(setup_.parameter_sigmas);
}

/// Whether slip that explains the first sample of a dispute, and not the second, has jumped within the interval before
/// the first: on the interval behind it the vehicle then slips as much on all of its way, and what is measured is off
/// farther, in the same direction. A receiver that has jumped stays where it is, or comes back.
bool SensorJudge::goes_on() noexcept {
  if (disputed_samples_ != fresh || slip_->explained != 1 || !edge_->is_active || !fits(edge_->filter, raw_.data()))
    return false;
  double along = 0.0, first = 0.0;
  for (std::size_t j = 0; j < raw_.size(); ++j) {
    const double error = memory_->first_errors[j];
    if (std::isnan(error) || std::isnan(raw_[j])) continue;
    along += error * (raw_[j] - own_->filter.expected(static_cast<int>(j)));
    first += error * error;
  }
  return first > 0.0 && along >= (1.0 + goes_on_by) * first;
}

/// nu' S^-1 nu of the sensors that were rejected, together.
double SensorJudge::disputed_nis(WalkingFilter& filter) noexcept {
  filter.expect();
  double sum = 0.0;
  for (std::size_t s = 0; s < sensors_.size(); ++s)
    if ((findings_[s] & reason::rejected) && filter.innovation(sensors_[s], weighed(raw_.data()), scratch_))
      sum += scratch_.nis;
  return sum;
}

/// Log likelihood of what is not missing of the present sample, but for a constant.
double SensorJudge::likelihood(WalkingFilter& filter, const double* outputs) noexcept {
  filter.expect();
  double sum = 0.0;
  Innovation innovation;
  for (const Sensor& each : sensors_)
    if (filter.innovation(each, weighed(outputs), innovation))
      sum -= 0.5 * (innovation.nis + log_determinant(innovation.covariance));
  return sum;
}

/// Where no slip within its bounds explains what follows slip that was found to have jumped, that has not: the sensor
/// has left in steps, and was wrong from the first on. The filter then goes on as if it had said nothing.
bool SensorJudge::retract_slip() noexcept {
  Memory& memory = *memory_;
  const bool is_slip = slip_->is_active && memory.slip_beyond < Memory::impossible_slip;
  if (disputed_samples_ != 1 || is_slip || memory.since_release > soon || !is_position_disputed()) return false;
  int ago = 0;
  while (ago < memory.recent->connected() && memory.recent->entry(ago).time > memory.released.outputs_from) ++ago;
  if (ago == memory.recent->connected()) return false;
  for (std::size_t s = 0; s < sensors_.size(); ++s)
    for (const int j : sensors_[s].outputs)
      memory.retracted[j] = (findings_[s] & reason::rejected) ? raw_[j] : Memory::unknown;
  WalkingFilter& filter = own_->filter;
  memory.recent->go_back(ago, filter);
  memory.recent->replay(ago, filter, [&](RecentSamples::Entry& entry) {
    entry.outputs.remove(memory.retracted.data());
    filter.update(entry.outputs.measured());
    entry.note(filter);
  });
  memory.recent->keep_newest();
  memory.before_mean = filter.mean();
  memory.before_covariance = filter.covariance();
  filter.predict(input_.data(), memory.duration);
  filter.expect();
  if (slip_->is_active) refute(*slip_);
  return true;
}

SensorJudge::Retraction SensorJudge::retraction() const noexcept { return memory_->released; }

std::span<const double> SensorJudge::jumps() const noexcept {
  return {memory_->jumps.data(), static_cast<std::size_t>(memory_->jump_count)};
}

void SensorJudge::confront(Hypothesis& hypothesis, const double* outputs, bool counts) noexcept {
  const bool has_moved =
      &hypothesis == moved_.get() || &hypothesis == memory_->double_fault.get() || &hypothesis == back_.get();
  const bool may_change_slip = counts && has_moved && is_position_disputed();
  if (fits(hypothesis.filter, outputs)) {
    hypothesis.filter.update_as_expected(weighed(outputs));
  } else if (!may_change_slip || !changes_slip(hypothesis)) {
    refute(hypothesis);
    return;
  }
  // Where a position is disputed, samples of a quick sensor that fails as well are not proof.
  hypothesis.explained += counts && (memory_->is_counted || !is_place_disputed());
}

/// Whether a position has failed at its last sample.
bool SensorJudge::is_place_disputed() const noexcept {
  for (std::size_t s = 0; s < sensors_.size(); ++s)
    if (records_[s].failures > 0 && sees_position(sensors_[s].outputs)) return true;
  return false;
}

/// Whether a sensor that sees the position was rejected.
bool SensorJudge::is_position_disputed() const noexcept {
  for (std::size_t s = 0; s < sensors_.size(); ++s)
    if ((findings_[s] & reason::rejected) && sees_position(sensors_[s].outputs)) return true;
  return false;
}

/// Whether nothing explains a position that is disputed, and no other sensor has said for as long where the vehicle is.
bool SensorJudge::is_place_lost() const noexcept {
  const int samples = std::min(disputed_samples_, unplaced_samples_), most = Memory::hopeless * setup_.proof;
  // Of a slow receiver so many samples are too long.
  const bool is_long = samples > setup_.proof && memory_->now - memory_->unplaced_from > most * setup_.step;
  return (samples > most || is_long) && is_position_disputed();
}

/// Whether a sensor of the motion, as a gyro, fails as well as the position, for as long as the proof would take with a
/// quick receiver.
bool SensorJudge::is_motion_contradicted() const noexcept {
  if (!(memory_->now - memory_->disputed_from > Memory::hopeless * setup_.proof * setup_.step)) return false;
  for (std::size_t s = 0; s < sensors_.size(); ++s)
    if (records_[s].failures >= suspect_after && !sees_position(sensors_[s].outputs)) return true;
  return false;
}

bool SensorJudge::sees_position(const std::vector<int>& outputs) const noexcept {
  return std::ranges::any_of(outputs, [&](int j) { return sees_position(j); });
}

bool SensorJudge::sees_position(int output) const noexcept {
  const Roles& roles = own_->filter.model().description().roles;
  return (roles.position_x >= 0 && own_->filter.depends_on(output, roles.position_x)) ||
         (roles.position_y >= 0 && own_->filter.depends_on(output, roles.position_y));
}

/// Whether a sensor that is not disputed has said where the vehicle is, and has not been silent for long since.
bool SensorJudge::is_placed_otherwise() const noexcept {
  return unplaced_samples_ < std::min(disputed_samples_, setup_.proof);
}

/// A disputed position can be followed only if nothing else says where the vehicle is, and any other sensor only if
/// nothing else is measured, in this sample or lately.
bool SensorJudge::may_follow() const noexcept {
  if (is_placed_otherwise()) return false;
  if (is_position_disputed()) return true;
  for (std::size_t s = 0; s < sensors_.size(); ++s) {
    const bool is_doubted = (findings_[s] & reason::rejected) != 0 || records_[s].failures > 0;
    if (!is_doubted && is_heard(s)) return false;
  }
  return true;
}

/// Slip that changes by less than what fails a gate at once turns the heading all the same, until a position is off by
/// what new slip alone does not explain. What has been measured since is then used anew, from before that. False if
/// this does not explain what is disputed either.
bool SensorJudge::consider_slip_before() noexcept {
  if (disputed_samples_ != 1 || !is_position_disputed() || memory_->offsets->probable() >= 0) return false;
  // After a gap there is little to be used anew.
  if (std::ranges::any_of(records_, [](const Record& each) { return each.after_gap; })) return false;
  for (const int positions : changed_before) {
    const int back = memory_->recent->with_positions(positions);
    if (back == 0) return false;
    if (replay_with_new_slip(back, nullptr) <= unlikely_slip && fits(slip_->filter, raw_.data())) return true;
  }
  return false;
}

/// The log likelihood of slip that has jumped just now; NaN if it has not.
double SensorJudge::consider_slip() noexcept {
  const bool is_new = !slip_->is_active;
  double& beyond = memory_->slip_beyond;
  if (is_new) beyond = 0.0;
  const auto note_beyond = [&] {
    beyond = std::max(beyond, Memory::slip_beyond_bounds(slip_->filter, memory_->before_slip, setup_.noise));
  };
  double new_likelihood = Memory::unknown;
  if (is_new) {
    memory_->jumps[0] = memory_->recent->keep_newest();
    start_slip();
    held_count_ = 0;
    memory_->jump_count = 1;
    const bool explains = disputed_nis(slip_->filter) <= left_unexplained * disputed_nis(own_->filter) &&
                          fits(slip_->filter, raw_.data());
    if (!explains) {
      beyond = 0.0;
      memory_->is_slip_near = false;
      if (!consider_slip_before()) {
        refute(*slip_);
        return new_likelihood;
      }
    }
    if (disputed_samples_ <= fresh && explains) new_likelihood = likelihood(slip_->filter, raw_.data());
  } else if (!fits(slip_->filter, raw_.data()) && goes_on()) {
    go_on_from(edge_->filter, slip_->filter);
    copy_numbers(slip_->filter.mean(), memory_->before_slip);
    slip_->filter.update(weighed(raw_.data()));
    note_beyond();
    memory_->jumps[1] = memory_->recent->keep_newest();
    memory_->jump_count = 2;
    edge_->is_active = false;
    return new_likelihood;
  }
  copy_numbers(slip_->filter.mean(), memory_->before_slip);
  confront(*slip_, raw_.data(), true);
  if (slip_->is_active) note_beyond();
  begin_edge(is_new);
  return new_likelihood;
}

void SensorJudge::consider_moved(double likelihood_of_new_slip, const double* outputs) noexcept {
  const bool is_new = !moved_->is_active;
  consider_double_fault();
  if (is_new) {
    note_jump();
    start_moved(*moved_);
  }
  // As probable before the sample as that slip has jumped.
  if (slip_->is_active && !std::isnan(likelihood_of_new_slip))
    slip_probability_ = 1.0 / (1.0 + std::exp(likelihood(moved_->filter, raw_.data()) - likelihood_of_new_slip));
  // Whether the other sensors agree better with a vehicle whose state is what the disputed one says: the position, if
  // there is one, for errors of a quick compass or gyro are the same from sample to sample.
  if (!is_new && !is_position_disputed() && memory_->is_counted)
    moved_->evidence += likelihood(moved_->filter, outputs) - likelihood(own_->filter, outputs);
  confront(*moved_, raw_.data(), true);
}

/// The estimate goes along with what is disputed, or of that with the position alone.
void SensorJudge::note_followed(bool alone) noexcept {
  for (std::size_t s = 0; s < sensors_.size(); ++s) {
    if (alone && !sees_position(sensors_[s].outputs)) continue;
    if (findings_[s] & reason::rejected) findings_[s] |= reason::moved;
    states_[s].reasons |= findings_[s] & reason::moved;
    records_[s] = {};
  }
}

/// Whether a move has explained enough to be followed, and slip that has jumped meanwhile is known again.
bool SensorJudge::has_proved(const Hypothesis& moved, bool after_gap) const noexcept {
  const bool is_slip_settled = moved.new_slips == 0 || moved.explained - moved.new_slip_since > setup_.slip_proof;
  return is_slip_settled && moved.explained >= (after_gap ? setup_.gap_proof : setup_.proof);
}

SensorJudge::Finding SensorJudge::settle(double time, const double* outputs) noexcept {
  if (!is_disputed_) memory_->was_calm = std::min(calm_samples_, memory_->undisputed_samples) >= setup_.calm;
  is_disputed_ = true;
  if (++disputed_samples_ == 1) memory_->disputed_from = memory_->recent->keep_newest();
  for (std::size_t s = 0; s < sensors_.size() && disputed_samples_ == 1; ++s)
    for (const int j : sensors_[s].outputs)
      memory_->first_errors[j] =
          (findings_[s] & reason::rejected) && sees_position(j) ? raw_[j] - own_->filter.expected(j) : Memory::unknown;
  if (consider_inputs()) return slip_is_new;
  if (disputed_samples_ == suspect_position && is_position_disputed() && memory_->offsets->has_recent()) {
    if (Finding finding; consider_other(outputs, finding)) return finding;
    // A position that jumps may have drifted before, and what seemed to be off was right.
    memory_->offsets->withdraw_recent(own_->filter);
    own_->filter.update(weighed(outputs));
    return accept(*own_);
  }
  // Of a compass or gyro the next sample tells: slip that has jumped goes on to turn the vehicle, one that has jumped
  // stays where it is. Both may pass their gates.
  const bool is_told = !is_position_disputed() && slip_->is_active && moved_->is_active;
  const double favours_moved =
      is_told ? likelihood(moved_->filter, raw_.data()) - likelihood(slip_->filter, raw_.data()) : 0.0;
  const double likelihood_of_new_slip = consider_slip();
  const bool retracts = retract_slip();
  if (Finding finding; !retracts && consider_other(outputs, finding)) return finding;
  consider_return(time);
  consider_moved(likelihood_of_new_slip, outputs);
  if (is_told && slip_probability_ > 0.0)
    slip_probability_ = 1.0 / (1.0 + (1.0 / slip_probability_ - 1.0) * std::exp(favours_moved));
  think_again();
  if (!is_blind_) {
    if (!blind_->is_active) start_blind();
    confront(*blind_, raw_.data(), true);
  }
  // Slip that has jumped shows from the first sample on. Later the filter without the sensor knows so little that new
  // slip explains nearly anything.
  const bool has_begun_with_it = disputed_samples_ - slip_->explained < fresh;
  // Slip that would have to leave its bounds for what a compass says explains nothing of it, nor does slip that is less
  // likely than an error, or jumps once the compass has been wrong already.
  const bool is_likely = slip_probability_ > even && is_within_bounds(slip_->filter.mean());
  const bool may_be_slip = is_position_disputed() || (has_begun_with_it && is_likely);
  if (has_come_back()) return come_back();
  if (may_be_slip && slip_->explained >= (has_begun_with_it ? setup_.slip_proof : setup_.proof)) {
    // What has explained much, or follows a gap, is not doubted for what comes next.
    const bool is_doubtful = slip_->explained < setup_.proof &&
                             std::ranges::none_of(records_, [](const Record& each) { return each.after_gap; });
    memory_->since_release = memory_->is_slip_near ? soon + 1 : is_doubtful ? 0 : soon;
    memory_->released = {memory_->jumps[0], memory_->disputed_from, memory_->retracted.data()};
    accept(*slip_);
    for (Record& record : records_) record = {};
    acquit(outputs);
    // A method that is linear about slip as it was before would be wrong over a long interval.
    return {.release = true, .rebase = memory_->is_slip_near};
  }
  if (slip_->is_active) hold_back(time, outputs);
  bool after_gap = true;
  for (std::size_t s = 0; s < sensors_.size(); ++s)
    if (findings_[s] & reason::rejected) after_gap = after_gap && records_[s].after_gap;
  const bool is_alone = is_double_fault();
  Hypothesis& moved = is_alone ? *memory_->double_fault : *moved_;
  if (has_proved(moved, after_gap) && (may_follow() || (!is_alone && moved.evidence > convincing))) {
    leave_place(time, after_gap);
    note_followed(is_alone);
    const int since = disputed_samples_;
    const Finding finding = accept(moved);
    // Slip that jumps now does not explain a sensor that has been wrong for some time.
    is_disputed_ = is_alone;
    disputed_samples_ = is_alone ? since : 0;
    if (is_alone) convict();
    return finding;
  }
  if (distrust_receiver()) return {.rebase = true};
  if (memory_->search && is_place_lost()) {
    // Nothing explains what is measured: the position counts, and all else is found anew.
    start_moved(*moved_);
    moved_->filter.update(weighed(raw_.data()));
    moved_->filter.restart_parameters(setup_.parameter_sigmas);
    search_from(moved_->filter, *memory_->search, raw_.data());
    memory_->places.clear();
    for (Record& record : records_) record = {};
    return accept(*moved_);
  }
  // Inputs of which nothing is known explain what any other sensor says. That it is they is to be seen in the motion.
  if (!is_blind_ && blind_->explained >= (is_motion_contradicted() ? setup_.gap_proof : setup_.proof) &&
      slip_->refuted > 0 && moved_->refuted > 0 && is_position_disputed()) {
    is_blind_ = true;
    trusted_samples_ = 0;
    for (Record& record : records_) record = {};
    return accept(*blind_);
  }
  return {.retract = retracts};
}

bool SensorJudge::is_within_bounds(const Eigen::VectorXd& mean) const noexcept {
  const Eigen::Index nx = own_->filter.model().state_count();
  bool is_within = true;
  for (std::size_t j = 0; j < setup_.walk.size(); ++j) {
    const double slip = mean[nx + static_cast<Eigen::Index>(j)];
    is_within = is_within && slip > setup_.noise.parameter_lower[j] && slip < setup_.noise.parameter_upper[j];
  }
  return is_within;
}

/// Whether what is disputed is rather slip that has jumped, which the next sample tells. Until then what is given out
/// has the covariance of both answers, so that it agrees with what the sensors say: nothing is wrong with it.
bool SensorJudge::is_probably_slip() const noexcept {
  return is_disputed_ && disputed_samples_ <= fresh && slip_->is_active && slip_probability_ > probable &&
         memory_->was_calm && memory_->slip_beyond < Memory::impossible_slip && is_within_bounds(own_->filter.mean()) &&
         ((input_findings_ | inputs_.reasons) & ~reason::off) == 0;
}

/// What was held back, and what was rejected last, is right after all.
void SensorJudge::acquit(const double* outputs) noexcept {
  // Slip at a bound that measurements ask to be beyond it may well be there, as that of wheels that spin on the spot.
  const bool is_beyond = memory_->slip_beyond > unlikely_slip && !is_within_bounds(own_->filter.mean());
  const bool is_doubtful = !memory_->was_calm || is_beyond;
  const auto take_back = [&](auto&& was_rejected) {
    for (std::size_t s = 0; s < sensors_.size(); ++s) {
      if (std::ranges::none_of(sensors_[s].outputs, was_rejected)) continue;
      --states_[s].rejected;
      ++states_[s].accepted;
      if (is_doubtful) states_[s].reasons |= reason::rejected, quiet_[s] = 0;
    }
  };
  for (int i = 0; i < held_count_; ++i) take_back([&](int j) { return !std::isnan(held_[i].outputs[j]); });
  take_back([&](int j) { return std::isnan(outputs[j]) && !std::isnan(raw_[j]); });
  for (std::uint32_t& each : findings_) each &= ~reason::rejected;
  if (is_doubtful) {
    calm_samples_ = 0;
    return;
  }
  for (std::size_t s = 0; s < sensors_.size(); ++s) {
    states_[s].reasons &= ~reason::rejected;
    quiet_[s] = setup_.calm;
  }
  calm_samples_ = setup_.calm;
}

SensorJudge::Finding SensorJudge::accept(Hypothesis& hypothesis) noexcept {
  go_on_from(hypothesis.filter, own_->filter);
  if (&hypothesis != slip_.get()) memory_->offsets->forget_onsets();
  end_dispute();
  return {.rebase = true};
}

/// Where a sensor that has moved does not explain what follows, the heading may be wrong, too, e.g. after a turn
/// without a position. One that is found goes on as if the sensor had moved.
void SensorJudge::think_again() noexcept {
  if (!memory_->second_thought || moved_->refuted == 0 || moved_->explained >= Memory::informed) return;
  HeadingSearch& search = *memory_->second_thought;
  if (search.is_active()) {
    const bool is_found = search.update(sensors_, weighed(raw_.data()));
    memory_->in_vain = search.explained() > 0 ? 0 : memory_->in_vain + 1;
    if (!is_found && memory_->in_vain < stale) return;
    if (is_found) {
      moved_->begin();
      moved_->explained = moved_->new_slip_since = search.explained();
      go_on_from(search.best(), moved_->filter);
      return;
    }
  }
  start_moved(*moved_);
  moved_->filter.update(weighed(raw_.data()));
  WalkingFilter& trial = *memory_->trial;
  go_on_from(moved_->filter, trial);
  search_from(trial, search, raw_.data());
  moved_->explained = 1;
  memory_->is_jump_known = false;
  memory_->in_vain = 0;
}

/// Keeps what was rejected, in case it is right.
void SensorJudge::hold_back(double time, const double* outputs) noexcept {
  if (held_count_ == static_cast<int>(held_.size())) return;
  Held& held = held_[held_count_++];
  held.time = time;
  held.outputs.assign(weighed(raw_.data()));
  held.outputs.remove(outputs);
}

void SensorJudge::end_dispute() noexcept {
  is_disputed_ = false;
  slip_probability_ = 0.0;
  disputed_samples_ = unplaced_samples_ = 0;
  if (memory_->second_thought) memory_->second_thought->cancel();
  for (Hypothesis* each :
       {slip_.get(), edge_.get(), moved_.get(), memory_->double_fault.get(), back_.get(), blind_.get()}) {
    each->is_active = each->is_informed = false;
    each->explained = each->refuted = 0;
  }
}

/// Whether the measured inputs explain the motion again, over some positions, of which only the first is used: over an
/// interval, or even since the sample before of a quick sensor, a vehicle hardly moves, whatever its inputs are.
/// Without positions, the last interval, again and again.
void SensorJudge::test_inputs(const double* outputs) noexcept {
  WalkingFilter& trial = *memory_->trial;
  const int back = memory_->is_counted ? memory_->recent->with_positions_known(trusted_again) : 0;
  if (back > 0) {
    bool has_begun = false;
    memory_->recent->go_back(back, trial);
    memory_->recent->replay(back, trial, [&](const RecentSamples::Entry& entry) {
      if (entry.has_position && std::exchange(has_begun, true)) return;
      trial.update(entry.outputs.measured());
    });
  } else {
    trial.mean() = memory_->before_mean;
    trial.covariance() = memory_->before_covariance;
  }
  trial.predict(input_.data(), memory_->duration);
  const int samples = back > 0 ? trusted_again : trusted_samples_ + memory_->is_counted;
  trusted_samples_ = fits(trial, outputs) ? samples : 0;
  if (trusted_samples_ >= trusted_again) is_blind_ = false;
}

}  // namespace rhec
