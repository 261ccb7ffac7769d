#include <cmath>

#include "innovation.hpp"
#include "sensor_judge_parts.hpp"

// A position that has moved, was followed, and comes back.

namespace rhec {

namespace {

// Samples in a row that a return must explain: two alone are a transient.
constexpr int return_proof = 3;
// Samples that a position that has moved must explain before slip may jump, too; one that has come back has proved more
// with its first.
constexpr int before_new_slip = 2;
// The logarithm of the odds, against another displacement, at which a return is considered: 20.
constexpr double considerable = 3.0;

}  // namespace

/// The first disputed sensor that sees the position; -1: none. Several that fail together have moved alike, as
/// receivers do whose base station has.
int SensorJudge::disputed_position() const noexcept {
  for (std::size_t s = 0; s < sensors_.size(); ++s)
    if ((findings_[s] & reason::rejected) && sees_position(sensors_[s].outputs)) return static_cast<int>(s);
  return -1;
}

/// Before what has moved is made anew: by how much it has, from where the estimate expects it or, if it has jumped
/// again, from where it was.
void SensorJudge::note_jump() noexcept {
  Memory& memory = *memory_;
  const bool goes_on = moved_->is_informed && memory.is_jump_known;
  memory.is_jump_known = false;
  const int sensor = disputed_position();
  WalkingFilter& from = goes_on ? moved_->filter : own_->filter;
  const Roles& roles = from.model().description().roles;
  if (sensor < 0 || roles.position_x < 0 || roles.position_y < 0) return;
  const Sensor& about = sensors_[static_cast<std::size_t>(sensor)];
  from.expect();
  if (!from.innovation(about, weighed(raw_.data()), scratch_)) return;
  PositionDerivatives derivatives(scratch_.value.size(), 2);
  Eigen::Index row = 0;
  for (const int j : about.outputs) {
    if (std::isnan(raw_[static_cast<std::size_t>(j)])) continue;
    derivatives(row, 0) = from.derivative(j, roles.position_x);
    derivatives(row, 1) = from.derivative(j, roles.position_y);
    ++row;
  }
  Displacement step;
  memory.is_jump_known = displacement_of(scratch_.value, scratch_.covariance, derivatives, step);
  if (!goes_on) memory.jump = {};
  memory.jump.mean += step.mean;
  memory.jump.covariance += step.covariance;
}

/// The estimate follows a position that has moved: where it was before is remembered.
void SensorJudge::leave_place(double time, bool after_gap) noexcept {
  memory_->was_return = false;
  if (!is_position_disputed()) return;
  const int sensor = disputed_position();
  if (memory_->is_jump_known && sensor >= 0 && !after_gap)
    memory_->places.leave(sensor, memory_->jump, time);
  else
    memory_->places.clear();
}

/// Whether it has come back to where it was before, which is a displacement that is known. Tried at every disputed
/// sample, from where the estimate expects the position; or, if it had moved and jumps again, from there: it may then
/// have come back to where it was when the dispute began, too.
void SensorJudge::consider_return(double time) noexcept {
  Memory& memory = *memory_;
  Hypothesis& back = *back_;
  if (back.is_active) {
    confront(back, raw_.data(), true);
    return;
  }
  memory.places.forget_before(time);
  const int sensor = disputed_position();
  if (sensor < 0) return;
  const bool is_followed = moved_->is_active ? moved_->explained >= Memory::informed : moved_->is_informed;
  const bool has_moved = is_followed && memory.is_jump_known;
  const std::size_t places = sensor == memory.places.sensor() ? memory.places.count() : 0;
  if ((places == 0 && !has_moved) || (has_moved && fits(moved_->filter, raw_.data()))) return;
  WalkingFilter& from = has_moved ? moved_->filter : own_->filter;
  const Sensor& about = sensors_[static_cast<std::size_t>(sensor)];
  from.expect();
  if (!from.innovation(about, weighed(raw_.data()), scratch_)) return;
  const Innovation::OfSensor<1> jump = scratch_.value;
  const Roles& roles = from.model().description().roles;
  const int position[] = {roles.position_x, roles.position_y};
  double best = considerable;
  WalkingFilter& trial = *memory.trial;
  // The last one is where the estimate is, as after a transient.
  for (std::size_t place = memory.places.count() - places; place < memory.places.count() + has_moved; ++place) {
    Displacement shift = memory.places.to(place);
    if (has_moved) {
      shift.mean -= memory.jump.mean;
      shift.covariance += memory.jump.covariance;
    }
    trial.mean() = from.mean();
    trial.covariance() = from.covariance();
    for (Eigen::Index c = 0; c < 2; ++c) {
      trial.mean()[position[c]] += shift.mean[c];
      for (Eigen::Index r = 0; r < 2; ++r) trial.covariance()(position[r], position[c]) += shift.covariance(r, c);
    }
    if (!fits(trial, raw_.data())) continue;
    trial.innovation(about, weighed(raw_.data()), scratch_);
    const double odds = log_odds_of_return(scratch_.value, scratch_.covariance, jump);
    if (!(odds > best)) continue;
    best = odds;
    memory.place = place;
    back.filter.mean() = trial.mean();
    back.filter.covariance() = trial.covariance();
    back.begin();
  }
  if (back.is_active) confront(back, raw_.data(), true);
}

/// Slip may jump while a sensor has moved: whether slip that is made anew on the last interval explains what the
/// hypothesis does not, within its bounds. Once it has explained some samples; and on the next interval once more, as
/// of slip that has jumped within one.
bool SensorJudge::changes_slip(Hypothesis& each) noexcept {
  const int since = each.explained - each.new_slip_since;
  const int enough = &each == back_.get() && each.new_slips == 0 ? 1 : before_new_slip;
  const bool goes_on = each.new_slips == 1 && since == 1;
  if (since < enough && !goes_on) return false;
  WalkingFilter& trial = *memory_->trial;
  trial.mean() = each.before_mean;
  trial.covariance() = each.before_covariance;
  trial.restart_parameters(setup_.parameter_sigmas);
  trial.predict(input_.data(), memory_->duration);
  if (!fits(trial, raw_.data())) return false;
  copy_numbers(trial.mean(), memory_->before_slip);
  trial.update_as_expected(weighed(raw_.data()));
  if (Memory::slip_beyond_bounds(trial, memory_->before_slip, setup_.noise) >= Memory::impossible_slip) return false;
  each.filter.mean() = trial.mean();
  each.filter.covariance() = trial.covariance();
  each.new_slips = goes_on ? 2 : 1;
  each.new_slip_since = each.explained;
  return true;
}

/// The estimate goes on with what has come back. It has moved only if the estimate had followed it.
SensorJudge::Finding SensorJudge::come_back() noexcept {
  Memory& memory = *memory_;
  if (memory.place < memory.places.count()) {
    note_followed(false);
    memory.was_return = true;
    memory.places.come_back(memory.place);
  }
  for (Record& record : records_) record = {};
  return accept(*back_);
}

bool SensorJudge::has_come_back() const noexcept {
  const bool is_slip_settled = back_->new_slips == 0 || back_->explained - back_->new_slip_since >= setup_.slip_proof;
  return back_->is_active && is_slip_settled && back_->explained >= return_proof && !is_placed_otherwise();
}

}  // namespace rhec
