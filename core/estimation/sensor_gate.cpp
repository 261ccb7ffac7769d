#include <algorithm>
#include <cmath>

#include "innovation.hpp"
#include "sensor_judge_parts.hpp"

// Which measurements are used, each by itself.

namespace rhec {

namespace {

// A suspect sensor has to pass so many times in a row.
constexpr int passes_of_suspects = 2;
// The same of one that is not followed when it moves.
constexpr int passes_of_kept_out = 5;
// By so much less nu' S^-1 nu is a measurement much nearer to no error than to that one.
constexpr double much_nearer = 9.0;
// A real receiver's errors may be far larger than its noise says, and not Gaussian at all: its gate is as much wider as
// its squared innovations have been over some five hundred samples, of which none counts more than this many times what
// was expected, and those of one that is suspect not at all.
constexpr double most_excess = 100.0, excess_memory = 500.0;

/// Whether an output is the heading. What it is, positions say whatever slips; of a steering angle slip says otherwise.
bool is_heading(const WalkingFilter& filter, int output) noexcept {
  const int heading = filter.model().description().roles.heading;
  for (int i = 0; i < filter.model().state_count(); ++i)
    if (filter.derivative(output, i) != (i == heading ? 1.0 : 0.0)) return false;
  return heading >= 0;
}

}  // namespace

/// Whether a sensor's measurement may be used. One that has failed for some time must agree well, and twice: the filter
/// without it knows less and less, so that a gate opens by itself. For the same reason a sensor that is not followed
/// when it moves must agree better with no error than with the one that it has had.
bool SensorJudge::admits(std::size_t sensor, const Innovation& innovation) noexcept {
  Record& record = records_[sensor];
  // What it was before a gap, as while it was stuck, says nothing of it afterwards.
  const bool comes_back = !std::isnan(heard_[sensor]) && !is_heard(sensor);
  if (comes_back) record = {};
  const bool is_suspect = record.failures >= suspect_after;
  const auto degrees = static_cast<double>(innovation.value.size());
  const bool is_kept_out = record.failures > 0 && !record.after_gap && !sees_position(sensors_[sensor].outputs);
  const bool is_off = is_kept_out && is_still_off(sensor, innovation);
  const bool passes = innovation.nis <= limit(sensor, innovation.value.size()) && !is_off && !passes_by_chance(sensor);
  double& excess = excesses_[sensor];
  if (record.failures < suspect_after)
    excess += (std::min(innovation.nis / degrees, most_excess) - excess) / excess_memory;
  if (!passes) {
    if (record.failures == 0) {
      record.after_gap = comes_back;
      record.since = memory_->now;
      record.place = position_of(own_->filter);
    }
    const auto size = static_cast<std::size_t>(innovation.value.size());
    record.note_failure(innovation, limits_[size], close_limits_[size]);
    const bool is_right_again = memory_->offsets->is_right_again(sensors_[sensor].outputs, innovation);
    record.right_again = is_right_again ? record.right_again + 1 : 0;
    return false;
  }
  ++record.passes;
  if (is_suspect && record.passes < (is_kept_out ? passes_of_kept_out : passes_of_suspects)) return false;
  record = {};
  return true;
}

/// A sensor that was off and is right again shows what slip that jumps might show, too; but that would have to lead
/// just there where it agrees as it was measured.
bool SensorJudge::end_offset() noexcept {
  bool is_any = false;
  for (std::size_t s = 0; s < sensors_.size(); ++s) {
    if (records_[s].right_again < passes_of_suspects) continue;
    memory_->offsets->end(sensors_[s].outputs, own_->filter);
    records_[s] = {};
    is_any = true;
  }
  return is_any;
}

/// A sensor that is off for good, and has a state for its bias: nothing distinguishes them, so that the state is what
/// it is off by. So is the error of one that fails by the same one again and again, where nothing else is wrong; one
/// without such a state is off by that.
bool SensorJudge::follow_biases(WalkingFilter& filter) noexcept {
  if (const int output = is_disputed_ ? -1 : memory_->offsets->hand_over(filter); output >= 0) {
    findings_[static_cast<std::size_t>(sensor_of(output, sensors_))] |= reason::moved;
    return true;
  }
  for (Record& record : records_)
    if (memory_->is_counted && record.failures > 0) record.note_time(close_limits_[1]);
  const auto is_wrong = [](std::uint32_t finding) { return finding != 0; };
  if (input_findings_ != 0 || std::ranges::count_if(findings_, is_wrong) != 1) return false;
  if (is_position_disputed()) return follow_receiver();
  for (std::size_t s = 0; s < sensors_.size(); ++s) {
    Record& record = records_[s];
    if (!record.has_lasted() || record.error.size() != 1 || sensors_[s].outputs.size() != 1) continue;
    const int output = sensors_[s].outputs.front();
    const double error = record.error[0];
    if (memory_->offsets->move_bias(output, error, record.covariance(0, 0), filter))
      findings_[s] |= reason::moved;
    else if (is_heading(filter, output) &&
             memory_->offsets->can_be_off(output, record.mean[0], record.variance_of_mean(0)))
      memory_->offsets->adopt_mean(output, record.mean[0], record.variance_of_mean(0));
    else
      continue;
    record = {};
    return true;
  }
  return false;
}

/// Whether a measurement is nearer to the error that the sensor has had than to none, or farther from none than it
/// could have been when it failed first; but not if it is much nearer to none. An error that has lasted ends at once:
/// where the estimate comes to it, which knows little without the sensor, it has not; unless it stays there.
bool SensorJudge::is_still_off(std::size_t sensor, const Innovation& innovation) const noexcept {
  const Record& record = records_[sensor];
  const Innovation::OfSensor<1>& value = innovation.value;
  if (record.error.size() != value.size()) return false;
  if (value.size() == 1 && record.steady >= OffsetWatch::for_good && record.agrees < OffsetWatch::for_good) {
    const double noise = setup_.noise.output_variances[static_cast<std::size_t>(sensors_[sensor].outputs.front())];
    const double jump = std::abs(value[0] - record.error[0]);
    if (jump * jump < close_gate * close_gate * noise || jump < 0.5 * std::abs(record.mean[0])) return true;
  }
  const Innovation::OfSensor<1> rest = value - record.error;
  const double of_error = squared_size(rest, innovation.covariance);
  if (of_error > innovation.nis + much_nearer) return false;
  return of_error < innovation.nis ||
         squared_size(value, record.covariance) > close_limits_[static_cast<std::size_t>(value.size())];
}

/// Largest nu' S^-1 nu of a sensor.
double SensorJudge::limit(std::size_t sensor, Eigen::Index degrees) const noexcept {
  const bool is_suspect = records_[sensor].failures >= suspect_after;
  const double usual = std::max(1.0, excesses_[sensor]) * limits_[static_cast<std::size_t>(degrees)];
  return is_suspect ? close_limits_[static_cast<std::size_t>(degrees)] : usual;
}

/// Takes out sensors that give the same values again and again.
void SensorJudge::find_stuck(double* outputs) noexcept {
  for (std::size_t j = 0; j < raw_.size(); ++j)
    memory_->stuck.take(j, outputs[j], own_->filter.expected(static_cast<int>(j)));
  for (std::size_t s = 0; s < sensors_.size(); ++s) {
    const std::vector<int>& all = sensors_[s].outputs;
    if (std::none_of(all.begin(), all.end(), [&](int j) { return memory_->stuck.is_stuck(j); })) continue;
    findings_[s] |= reason::stuck;
    memory_->offsets->forget_onsets();
    ++states_[s].rejected;
    for (const int j : all) outputs[j] = Memory::unknown;
  }
}

}  // namespace rhec
