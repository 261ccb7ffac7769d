#include <algorithm>

#include "innovation.hpp"
#include "sensor_judge_parts.hpp"

// A position that has moved, while another sensor is wrong.

namespace rhec {

/// What others have measured than those who are accused.
const double* SensorJudge::not_accused() noexcept {
  std::vector<double>& outputs = memory_->not_accused;
  std::copy(raw_.begin(), raw_.end(), outputs.begin());
  for (std::size_t s = 0; s < sensors_.size(); ++s)
    for (const int j : sensors_[s].outputs)
      if (memory_->accused[s]) outputs[static_cast<std::size_t>(j)] = Memory::unknown;
  return outputs.data();
}

/// Where a position and another sensor fail, a vehicle that was carried away explains both, and so do two sensors that
/// are wrong at once: the position has moved, and the other one says nothing. What is measured of the way since tells,
/// by the likelihood of each.
void SensorJudge::consider_double_fault() noexcept {
  Memory& memory = *memory_;
  Hypothesis& both = *memory.double_fault;
  const bool is_first = disputed_samples_ == 1 && is_position_disputed();
  for (std::size_t s = 0; s < sensors_.size(); ++s) {
    if (!both.is_active) memory.accused[s] = 0;
    if (sees_position(sensors_[s].outputs)) continue;
    // One that has jumped by what is just within its gate is looked at as well.
    const bool is_strange = is_first && own_->filter.innovation(sensors_[s], weighed(raw_.data()), scratch_) &&
                            scratch_.nis > close_limits_[static_cast<std::size_t>(scratch_.value.size())];
    if (is_strange || (findings_[s] & reason::rejected)) memory.accused[s] = 1;
  }
  const double* const outputs = not_accused();
  if (both.is_active) {
    if (moved_->is_active) both.evidence += likelihood(both.filter, outputs) - likelihood(moved_->filter, outputs);
  } else {
    // Behind a gap it is rather the estimate that is wrong.
    bool is_any = false;
    for (std::size_t s = 0; s < sensors_.size(); ++s) is_any = is_any || (memory.accused[s] && !records_[s].after_gap);
    const bool is_refuted = both.refuted > 0 && moved_->explained >= Memory::informed;
    if (!is_any || is_refuted || !is_position_disputed()) return;
    start_moved(both);
  }
  confront(both, outputs, true);
}

/// Whether two that are wrong explain a position that passes its gate better than the estimate does, which goes on with
/// one of them: it may be led to where the position is by chance.
bool SensorJudge::passes_by_chance(std::size_t sensor) noexcept {
  Hypothesis& both = *memory_->double_fault;
  if (!both.is_active || both.explained < Memory::informed || !(both.evidence > convincing) ||
      records_[sensor].failures == 0 || !sees_position(sensors_[sensor].outputs))
    return false;
  const double* const outputs = not_accused();
  return likelihood(both.filter, outputs) > likelihood(own_->filter, outputs);
}

/// Whether it is rather that than that all of what is disputed is right.
bool SensorJudge::is_double_fault() const noexcept {
  const Hypothesis& both = *memory_->double_fault;
  if (!both.is_active || !is_position_disputed()) return false;
  bool has_passed = false;  // one that is accused
  for (std::size_t s = 0; s < sensors_.size(); ++s)
    has_passed = has_passed || (memory_->accused[s] && !(findings_[s] & reason::rejected));
  // That a sensor is wrong which has passed its gate has to be likelier by far.
  return both.evidence > (has_passed ? convincing : 0.0);
}

/// Who was accused is wrong, and has been since the position has moved, also if it has passed its gate.
void SensorJudge::convict() noexcept {
  for (std::size_t s = 0; s < sensors_.size(); ++s) {
    if (!memory_->accused[s] || (findings_[s] & reason::rejected) ||
        !own_->filter.innovation(sensors_[s], weighed(raw_.data()), scratch_))
      continue;
    records_[s] = {};
    records_[s].begin(scratch_);
    records_[s].failures = suspect_after;
    records_[s].since = memory_->now;
    findings_[s] |= reason::rejected;
    --states_[s].accepted;
    ++states_[s].rejected;
  }
}

}  // namespace rhec
