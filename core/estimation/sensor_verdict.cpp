#include <algorithm>
#include <cmath>

#include "numbers.hpp"
#include "rhec/core/base/angle.hpp"
#include "sensor_judge_parts.hpp"

// What is said of an estimate, and of late measurements.

namespace rhec {

namespace {

constexpr double volume_memory = 10.0;  // that the usual volume is a mean over so many estimates before
constexpr double a_while = 1.0;         // by which a position is late, so that a heading is to be half as certain [s]

}  // namespace

SensorJudge::Finding SensorJudge::judge_late(double time, double* outputs, const double* weights,
                                             bool may_search) noexcept {
  if (!is_active_) return place_start(outputs, weights);
  bool has_position = false;
  for (int j = 0; j < static_cast<int>(raw_.size()); ++j)
    has_position = has_position || (!std::isnan(outputs[j]) && sees_position(j));
  memory_->loss->note_late(time, outputs, has_position);
  memory_->offsets->correct(outputs);
  WalkingFilter& filter = *memory_->trial;
  const int ago = memory_->recent->behind(time);
  if (ago >= 0) {
    const RecentSamples::Entry& last = memory_->recent->entry(ago);
    memory_->recent->go_back(ago, filter);
    filter.predict(last.inputs.data(), time - last.time);
  } else if (!memory_->past->go_to(time, filter)) {
    return {};
  }
  filter.expect();
  // A search takes as much longer as the position is late. Meanwhile one heading is better than none for the longer.
  const double longer = std::max(0.0, memory_->now - time) / a_while;
  if (ago >= 0 && may_search && !is_searching() && memory_->is_heading_unknown(filter, 1.0 + longer) &&
      is_heading_open(filter, {outputs, weights})) {
    raw_weights_.assign(weights, weights ? weights + raw_.size() : nullptr);
    copy_numbers(filter.mean(), memory_->before_mean);
    copy_numbers(filter.covariance(), memory_->before_covariance);
    const Finding finding = open_heading(time, outputs);
    is_unobserved_ = false;
    begin_anew(outputs);
    return finding;
  }
  for (std::size_t s = 0; s < sensors_.size(); ++s) {
    if (!filter.innovation(sensors_[s], {outputs, weights}, scratch_)) continue;
    if (scratch_.nis <= limit(s, scratch_.value.size())) {
      ++states_[s].accepted;
      memory_->offsets->forget_onsets();  // they do not know what it changes
      continue;
    }
    ++states_[s].rejected;
    states_[s].reasons |= reason::rejected;
    quiet_[s] = 0;
    for (const int j : sensors_[s].outputs) outputs[j] = Memory::unknown;
  }
  return {};
}

double SensorJudge::search_on(double time, bool is_hasty) noexcept {
  Memory& memory = *memory_;
  const int ago = memory.recent->behind(time);
  if (ago <= 0) return Memory::unknown;
  const RecentSamples::Entry &from = memory.recent->entry(ago), &next = memory.recent->entry(is_hasty ? 0 : ago - 1);
  memory.search->predict(from.inputs.data(), next.time - std::max(from.time, time));
  memory.search->update(sensors_, next.outputs.measured());
  memory.search->moments(own_->filter.mean(), own_->filter.covariance());
  return next.time;
}

void SensorJudge::remember_for(double time) noexcept { memory_->past->cover(time); }

void SensorJudge::begin_ahead() noexcept {
  copy_numbers(own_->filter.mean(), memory_->ahead->mean());
  copy_numbers(own_->filter.covariance(), memory_->ahead->covariance());
}

void SensorJudge::advance_ahead(double duration, const double* inputs) noexcept {
  memory_->ahead->predict(is_blind_ ? believed_input_.data() : inputs, duration);
}

void SensorJudge::judge_ahead(double* outputs, const double* weights) noexcept {
  memory_->offsets->correct(outputs);
  if (!is_active_ || is_searching() || is_blind_) return;
  WalkingFilter& filter = *memory_->ahead;
  filter.expect();
  for (std::size_t s = 0; s < sensors_.size(); ++s) {
    if (!filter.innovation(sensors_[s], {outputs, weights}, scratch_)) continue;
    const bool is_doubted = records_[s].failures > 0 || (states_[s].reasons & reason::stuck) != 0;
    if (!is_doubted && scratch_.nis <= limit(s, scratch_.value.size())) continue;
    for (const int j : sensors_[s].outputs) outputs[j] = Memory::unknown;
  }
  filter.update_as_expected({outputs, weights});
}

void SensorJudge::follow(const Estimate& estimate) noexcept {
  const Model& model = own_->filter.model();
  const Eigen::Index nx = model.state_count(), np = model.parameter_count(), n = nx + np;
  if (estimate.state.size() != nx || estimate.parameters.size() != np || estimate.covariance.rows() != n) return;
  if (!are_finite(estimate.state) || !are_finite(estimate.parameters) || !are_finite(estimate.covariance)) return;
  const int heading = model.description().roles.heading;
  if (!is_active_) {
    if (!(estimate.covariance.diagonal().maxCoeff() > 0.0)) return;  // of one that is not estimated
    is_active_ =
        heading < 0 || !(estimate.covariance(heading, heading) > Memory::known_heading * Memory::known_heading);
  }
  if (is_active_) note_volume(estimate);
  if (is_blind_ || is_searching()) return;
  own_->filter.mean().head(nx) = estimate.state;
  own_->filter.mean().tail(np) = estimate.parameters;
  copy_numbers(estimate.covariance, own_->filter.covariance());
}

bool SensorJudge::is_correlated() const noexcept { return memory_->correlated->are_any(); }

void SensorJudge::scale(Estimate& estimate) const noexcept {
  memory_->correlated->scale(estimate.state, estimate.covariance);
}

bool SensorJudge::is_in_doubt() const noexcept { return slip_probability_ > 0.0 || memory_->offsets->is_in_doubt(); }

void SensorJudge::widen(Estimate& estimate) noexcept {
  memory_->offsets->refine(estimate);
  const Model& model = own_->filter.model();
  const Eigen::Index nx = model.state_count(), n = nx + model.parameter_count();
  const Eigen::VectorXd& mean = slip_->filter.mean();
  const Eigen::MatrixXd& covariance = slip_->filter.covariance();
  if (!(slip_probability_ > 0.0) || estimate.covariance.rows() != n || !mean.allFinite() || !covariance.allFinite())
    return;
  // The judge is where the estimate is, or before it, while late measurements are waited for.
  Eigen::VectorXd& away = memory_->away;
  away = mean - own_->filter.mean();
  for (Eigen::Index j = 0; j < nx; ++j)
    if (model.description().states[static_cast<std::size_t>(j)].is_angle)
      away[j] = angle_difference(mean[j], own_->filter.mean()[j]);
  const bool is_of_position = std::ranges::any_of(memory_->first_errors, [](double each) { return !std::isnan(each); });
  // Who goes along with what a compass says of slip for a sample does not leave its place.
  const double share = memory_->was_open && !is_of_position ? slip_probability_ : 0.0;
  const double spread = slip_probability_ - share * share;
  for (Eigen::Index c = 0; c < n; ++c)
    for (Eigen::Index r = 0; r < n; ++r)
      estimate.covariance(r, c) +=
          slip_probability_ * (covariance(r, c) - estimate.covariance(r, c)) + spread * away[r] * away[c];
  estimate.state += share * away.head(nx);
  estimate.parameters += share * away.tail(n - nx);
}

/// What volume is usual is learnt where nothing is lacking.
void SensorJudge::note_volume(const Estimate& estimate) noexcept {
  const double volume = log_volume(estimate.covariance, memory_->factor);
  memory_->correlated->note(volume, estimate.covariance.rows());
  if (memory_->loss->is_active()) return;
  if (std::isnan(usual_volume_))
    usual_volume_ = volume;
  else if (!std::isnan(volume))
    usual_volume_ += (volume - usual_volume_) / volume_memory;
}

/// Whether something says where the vehicle is: a sensor of the position that is not silent.
bool SensorJudge::is_place_measured(std::span<const Presence> presence) const noexcept {
  for (std::size_t s = 0; s < sensors_.size(); ++s)
    if (presence[s] != Presence::silent && sees_position(sensors_[s].outputs)) return true;
  return false;
}

void SensorJudge::assess(const Estimate& estimate, std::span<const Presence> presence, Presence inputs,
                         std::uint32_t reasons, Health& health) noexcept {
  health.reasons = reasons;
  health.sensors.assign(states_.begin(), states_.end());
  health.inputs = inputs_;
  health.off_input = off_input_;
  health.doubted_input = doubted_input_;
  health.covariance_factor = memory_->correlated->mean(estimate.covariance.rows());
  if (inputs == Presence::silent) health.inputs.reasons |= reason::silent;
  bool has_finding = reasons != 0 || calm_samples_ < setup_.calm || (health.inputs.reasons & ~reason::off) != 0;
  bool is_overdue = inputs != Presence::present;
  for (std::size_t s = 0; s < sensors_.size(); ++s) {
    if (presence[s] == Presence::silent) health.sensors[s].reasons |= reason::silent;
    is_overdue = is_overdue || presence[s] != Presence::present;
    const std::uint32_t minor = memory_->was_minor[s] != 0 ? reason::off : 0u;
    has_finding = has_finding || (health.sensors[s].reasons & ~minor) != 0;
  }
  const Roles& roles = own_->filter.model().description().roles;
  const Eigen::MatrixXd& P = estimate.covariance;
  if (is_searching()) health.reasons |= memory_->is_starting ? reason::starting : reason::uncertain;
  bool is_lost = (reasons & reason::starting) != 0, is_place_known = false, is_heading_known = false;
  if (P.rows() > 0) {
    // What is no variance says that nothing is known. What correlated innovations add to it is no reason to stop.
    const auto is_known = [&](int i, double limit) {
      if (i < 0) return true;
      const double added = (memory_->correlated->largest() - 1.0) * std::max(0.0, own_->filter.covariance()(i, i));
      return P(i, i) >= 0.0 && P(i, i) - added <= limit * limit;
    };
    is_place_known =
        is_known(roles.position_x, setup_.lost_position) && is_known(roles.position_y, setup_.lost_position);
    is_heading_known = is_known(roles.heading, setup_.lost_heading);
    if (!is_place_known || !is_heading_known) {
      health.reasons |= reason::uncertain;
      is_lost = true;
    }
    const InformationLoss& loss = *memory_->loss;
    const double in_volume = memory_->correlated->in_volume(P.rows());
    // Where a sensor has a finding, all is said; a single sample that does not come is not worth a word.
    const bool has_lost = loss.samples_above() > 1 && loss.samples_since() <= setup_.calm && !memory_->was_open;
    if ((has_lost && !has_finding) ||
        (is_overdue && P.rows() == own_->filter.mean().size() &&
         log_volume(P, memory_->factor) - in_volume > usual_volume_ + std::log(InformationLoss::most_volume))) {
      health.reasons |= reason::uncertain;
      has_finding = true;
    }
  }
  is_lost = is_lost || is_searching() || is_place_lost();
  const bool is_heading_sought = is_place_known && !is_place_lost() && (is_searching() || !is_heading_known);
  if (is_heading_sought && (health.reasons & reason::starting) == 0 && is_place_measured(presence))
    health.reasons |= reason::heading;
  health.level = is_lost ? HealthLevel::lost : has_finding ? HealthLevel::degraded : HealthLevel::ok;
}

void SensorJudge::begin_predicting() noexcept { memory_->trial->inputs() = own_->filter.inputs(); }

void SensorJudge::predict(double duration, const double* inputs, const double* input_sigmas,
                          Estimate& estimate) noexcept {
  WalkingFilter& filter = *memory_->trial;
  const Eigen::Index nx = filter.model().state_count(), np = filter.model().parameter_count();
  if (estimate.state.size() != nx || estimate.parameters.size() != np || estimate.covariance.rows() != nx + np) return;
  filter.mean().head(nx) = estimate.state;
  filter.mean().tail(np) = estimate.parameters;
  filter.covariance() = estimate.covariance;
  filter.predict(inputs, duration, input_sigmas);
  estimate.state = filter.mean().head(nx);
  estimate.covariance = filter.covariance();
}

}  // namespace rhec
