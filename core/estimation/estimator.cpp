#include "rhec/core/estimation/estimator.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include <fmt/format.h>

#include "rhec/core/base/error.hpp"
#include "rhec/core/base/infinity.hpp"
#include "rhec/core/estimation/measurement.hpp"

namespace rhec {
namespace {

constexpr int checked_interval = 16;  // of so many, the integration of one is checked
constexpr int most_parts = 1000;      // largest number of parts of one prediction
// Parts of the rest of a prediction whose time is up.
constexpr int hasty_parts = 2;
// A source is overdue this share of its usual interval, or of a step if that is longer, after its message was to come,
// and beyond so many standard deviations of how old messages get.
constexpr double overdue = 0.75, unusually_late = 4.0;
// The usual age of a source's newest message is a mean over so many, how much it varies over more. None counts as more
// than so many intervals.
constexpr double age_memory = 5.0, spread_memory = 20.0, most_late = 1.0, most_spread = 2.0;
constexpr int most_steps = 32;  // of such a part, times those of a usual one
// A sensor's next measurement is not before this share of its usual interval. After that share of it, and what it is
// usually late by, it is missed once it is later by so much [s], or so many standard deviations, or by as much again.
constexpr double soonest = 0.75, latest = 1.25, least_later = 0.5, deviations_later = 4.0;
constexpr double lag_memory = 5.0;     // that is a mean over so many measurements
constexpr double least_lag = 0.05;     // of an interval: less is jitter
constexpr double longest_wait = 0.75;  // of the time that nodes can be taken back for

NodeGrid::Setup grid_setup(const EstimationMethod& method, const Estimator::Timeline& timeline) {
  if (!(timeline.longest_interval > 0.0))
    throw Error(fmt::format("estimator: longest interval {} s; expected a positive number", timeline.longest_interval));
  if (!(timeline.tolerance >= 0.0 && timeline.tolerance < timeline.longest_interval))
    throw Error(fmt::format("estimator: tolerance {} s; expected a number from 0 to below the longest interval, {} s",
                            timeline.tolerance, timeline.longest_interval));
  if (!(timeline.grace >= 0.0 && timeline.grace <= 1.0))
    throw Error(fmt::format("estimator: grace {} s; expected a number from 0 to 1", timeline.grace));
  if (!(timeline.input_hold >= 0.0))
    throw Error(fmt::format("estimator: input_hold {} s; expected 0 or more", timeline.input_hold));
  if (!timeline.delays.empty() && std::ssize(timeline.delays) != method.model().output_count())
    throw Error(fmt::format("estimator: {} delays given; expected {}, one an output, or none", timeline.delays.size(),
                            method.model().output_count()));
  for (const double delay : timeline.delays)
    if (!std::isfinite(delay)) throw Error("estimator: a delay that is not finite");
  if (!timeline.output_sigmas.empty() && std::ssize(timeline.output_sigmas) != method.model().output_count())
    throw Error(fmt::format("estimator: {} standard deviations of outputs given; expected {}, one an output, or none",
                            timeline.output_sigmas.size(), method.model().output_count()));
  for (const double sigma : timeline.output_sigmas)
    if (!(sigma > 0.0 && std::isfinite(sigma)))
      throw Error(fmt::format("estimator: standard deviation {} of an output; expected a positive number", sigma));
  if (timeline.capacity < 1) throw Error("estimator: capacity 0; expected room for at least 1 row");
  const Model& model = method.model();
  return {.step = timeline.longest_interval,
          .tolerance = timeline.tolerance,
          .capacity = timeline.capacity,
          .outputs = model.output_count(),
          .inputs = model.input_count(),
          .noises = static_cast<int>(model.description().noisy_states.size()),
          .most_between = method.most_between(),
          .reach = method.most_reach()};
}

/// Number of equal parts of a duration, each at most `longest`.
int parts_of(double duration, double longest) noexcept {
  const double parts = std::ceil(duration / longest - 1e-6);
  return parts < most_parts ? std::max(1, static_cast<int>(parts)) : most_parts;
}

}  // namespace

Estimator::Estimator(std::unique_ptr<EstimationMethod> method, const Timeline& timeline)
    : method_(std::move(method)),
      timeline_(timeline),
      grid_(grid_setup(*method_, timeline)),
      step_error_(method_->model()) {
  const Model& m = method_->model();
  clear_estimates();
  input_.assign(m.input_count(), 0.0);
  measured_inputs_ = input_.size() - m.description().noisy_states.size();
  next_.assign(m.state_count(), 0.0);
  values_.assign(std::max(m.output_count(), m.input_count()), 0.0);
  delayed_.assign(m.output_count(), 0.0);
  sigmas_ = timeline_.output_sigmas;
  weights_.assign(m.output_count(), 1.0);
}

Estimator::Estimator(std::unique_ptr<EstimationMethod> method, const Timeline& timeline,
                     std::unique_ptr<SensorWatch> watch)
    : Estimator(std::move(method), timeline) {
  watch_ = std::move(watch);
  method_->listen(watch_->make_memo());
  const std::size_t sensors = watch_->sensors().size();
  constexpr double least_lateness = 1.0;  // [s]
  const double most_lateness = std::max(least_lateness, method_->most_reach() * timeline.longest_interval);
  clocks_ =
      std::make_unique<Clocks>(static_cast<int>(sensors) + 1,
                               Clocks::Setup{.usual_interval = timeline.longest_interval, .behind = most_lateness});
  watch_->remember_for(most_lateness);
  waiting_ = std::make_unique<MeasuredRows>(timeline.capacity, model().output_count());
  merged_ = MeasuredOutputs(model().output_count());
  for (std::size_t j = sigmas_.size(); j < merged_.size(); ++j)
    sigmas_.push_back(std::sqrt(watch_->setup().noise.output_variances[j]));
  presence_.assign(sensors, SensorWatch::Presence::present);
  deliveries_.resize(sensors);
  ages_.resize(sensors + 1);
  input_sigmas_.assign(input_.size(), 0.0);
  held_inputs_.resize(measured_inputs_);
  clear_deliveries();
  for (Estimate* e : {&estimate_, &predicted_}) assess(*e, 0.0);
}

void Estimator::clear_deliveries() noexcept {
  std::ranges::fill(deliveries_, Delivery{0.0, 0.0, missing_value});
  std::ranges::fill(held_inputs_, HeldInput{missing_value, missing_value});
  std::ranges::fill(ages_, Age{missing_value, 0.0, 0.0, 0.0});
  newest_row_ = ahead_ = missing_value;
  used_ = -infinity;
}

void Estimator::clear_estimates() noexcept {
  const Model& m = method_->model();
  const int n = m.state_count() + m.parameter_count();
  for (Estimate* e : {&estimate_, &predicted_}) {
    e->time = 0.0;
    e->state.setZero(m.state_count());
    e->parameters.setZero(m.parameter_count());
    e->covariance.setZero(n, n);
    e->report = {};
    e->fallback = e->predicted = false;
  }
}

void Estimator::reset() noexcept {
  method_->reset();
  grid_.clear();
  clear_estimates();
  stale_ = false;
  counts_ = {};
  worst_error_ = 0.0;
  watched_ = 0.0;
  if (!watch_) return;
  watch_->reset();
  clocks_->reset();
  waiting_->clear();
  clear_deliveries();
}

bool Estimator::reset(const Eigen::VectorXd& mean, const Eigen::MatrixXd& covariance) noexcept {
  const Eigen::Index n = model().state_count() + model().parameter_count();
  const bool fits = mean.size() == n && covariance.rows() == n && covariance.cols() == n;
  if (!has_started() || !fits || !mean.allFinite() || !covariance.allFinite()) return false;
  if (!method_->rebase(mean, covariance)) return false;
  grid_.settle(method_->reach());
  if (watch_) {
    watch_->restart(mean, covariance);
    watched_ = grid_.time();
    waiting_->drop_front(waiting_->first_after(watched_ + timeline_.tolerance));
    ahead_ = missing_value;
  }
  stale_ = true;
  return true;
}

double Estimator::place_on_timeline(double stamp, int source) noexcept {
  const double time = clocks_->take(source, stamp);
  counts_.clocks_set = clocks_->settings();
  return time;
}

/// The clock of a row is that of the first sensor in it.
double Estimator::place_on_timeline(double stamp, const double* outputs) noexcept {
  double time = stamp;
  bool is_placed = false;
  for (std::size_t s = 0; s < watch_->sensors().size(); ++s) {
    const std::vector<int>& all = watch_->sensors()[s].outputs;
    if (std::ranges::all_of(all, [&](int j) { return std::isnan(outputs[j]); })) continue;
    const int source = static_cast<int>(s);
    if (!is_placed) {
      time = place_on_timeline(stamp, source);
    } else if (std::isfinite(time)) {
      clocks_->also(source, time);
    }
    is_placed = true;
  }
  return time;
}

/// Weights of the outputs in `values_` by their standard deviations (Measured); null where all are 1.
const double* Estimator::weigh(const double* sigmas) noexcept {
  constexpr double least_sigma = 0.01;  // relative to the usual one
  if (!sigmas || sigmas_.empty()) return nullptr;
  bool is_usual = true;
  for (std::size_t j = 0; j < weights_.size(); ++j) {
    const double ratio = sigmas[j] > 0.0 ? std::max(sigmas[j] / sigmas_[j], least_sigma) : 1.0;
    weights_[j] = 1.0 / (ratio * ratio);
    // What is known so badly that its weight is 0 says nothing.
    if (!(weights_[j] > 0.0)) {
      values_[j] = missing_value;
      weights_[j] = 1.0;
    }
    is_usual = is_usual && weights_[j] == 1.0;
  }
  return is_usual ? nullptr : weights_.data();
}

void Estimator::push_measurement(double time, const double* outputs, const double* sigmas) noexcept {
  for (int j = 0; j < model().output_count(); ++j) values_[j] = cleaned(outputs[j]);
  const double* const weights = weigh(sigmas);
  for (int j = 0; j < model().output_count(); ++j) counts_.missing += std::isnan(values_[j]);
  if (watch_) time = place_on_timeline(time, values_.data());
  if (!std::isfinite(time)) {
    ++counts_.dropped;
    return;
  }
  // Where delays differ, single outputs go to times of their own.
  const std::vector<double>& delays = timeline_.delays;
  if (delays.empty() || std::ranges::all_of(delays, [&](double each) { return each == delays.front(); }))
    return push(time - (delays.empty() ? 0.0 : delays.front()), {values_.data(), weights});
  for (std::size_t first = 0; first < delays.size(); ++first) {
    if (std::find(delays.begin(), delays.begin() + first, delays[first]) != delays.begin() + first) continue;
    bool any = false;
    for (std::size_t j = 0; j < delays.size(); ++j) {
      delayed_[j] = delays[j] == delays[first] ? values_[j] : missing_value;
      any = any || !std::isnan(delayed_[j]);
    }
    if (any) push(time - delays[first], {delayed_.data(), weights});
  }
}

/// How late the sensors of a row are, by the newest measurement of all.
void Estimator::note_delivery(double time, Measured outputs) noexcept {
  const double lag = newest_row_ > time ? newest_row_ - time : 0.0;
  for (std::size_t s = 0; s < deliveries_.size(); ++s) {
    const std::vector<int>& all = watch_->sensors()[s].outputs;
    if (std::ranges::all_of(all, [&](int j) { return std::isnan(outputs[j]); })) continue;
    Delivery& each = deliveries_[s];
    const double off = lag - each.lag;
    each.variance += (off * off - each.variance) / lag_memory;
    each.lag += off / lag_memory;
    if (!(each.newest >= time)) each.newest = time;
  }
  if (!(newest_row_ >= time)) newest_row_ = time;
}

/// Up to when measurements are judged now, of what is stamped up to a time: those of a sensor that is usually late are
/// waited for, so that the judge gets all in the order of their stamps.
double Estimator::judged_until(double time) const noexcept {
  if (!watch_->is_active()) return time;
  double until = time;
  const double now = std::max(time, newest_row_);
  double quickest = infinity;
  for (std::size_t s = 0; s < deliveries_.size(); ++s)
    quickest = std::min(quickest, clocks_->usual_interval(static_cast<int>(s)));
  for (std::size_t s = 0; s < deliveries_.size(); ++s) {
    const double lag = deliveries_[s].lag, newest = deliveries_[s].newest;
    const double interval = clocks_->usual_interval(static_cast<int>(s));
    // What is late by less comes before the next one of any other sensor.
    if (!(lag > std::min(least_lag * interval, 0.5 * quickest)) || std::isnan(newest)) continue;
    const double next = newest + soonest * interval, missed = newest + latest * interval + longest_lag(s);
    if (is_worth_waiting_for(s) && now < missed) until = std::min(until, next);
  }
  return until;
}

/// What comes later than that behind the others is later than usual [s].
double Estimator::longest_lag(std::size_t sensor) const noexcept {
  const Delivery& each = deliveries_[sensor];
  // By how much more depends on when estimates are asked for, too: little is no reason not to wait.
  const double more = std::max(least_later, deviations_later * std::sqrt(each.variance));
  return each.lag + std::min(more, each.lag);
}

/// Whether a sensor's measurements come so soon that the judge can wait for them.
bool Estimator::is_worth_waiting_for(std::size_t sensor) const noexcept {
  const double interval = clocks_->usual_interval(static_cast<int>(sensor));
  const double wait = (latest - soonest) * interval + longest_lag(sensor);
  return wait < longest_wait * method_->most_reach() * timeline_.longest_interval;
}

/// Whether a late row may begin a search of the vehicle's heading: one that is told of by the rows behind it, too.
bool Estimator::may_begin_search(Measured outputs) const noexcept {
  if (!watch_->is_heading_unknown()) return false;
  for (std::size_t s = 0; s < deliveries_.size(); ++s) {
    const auto is_measured = [&](int j) { return !std::isnan(outputs[j]); };
    if (std::ranges::any_of(watch_->sensors()[s].outputs, is_measured) && !is_worth_waiting_for(s)) return false;
  }
  return true;
}

void Estimator::push(double time, Measured outputs) noexcept {
  if (!watch_) return push_judged(time, outputs);
  note_delivery(time, outputs);
  // What is late may say where the vehicle begins, or begin a search of its heading.
  const bool may_begin = !watch_->is_active() || may_begin_search(outputs);
  if (!has_started() || time > watched_ + timeline_.tolerance || may_begin) {
    counts_.dropped += waiting_->is_full();
    waiting_->insert(time, outputs);
    return;
  }
  merged_.assign(outputs);
  watch_->judge_late(time, merged_.values(), merged_.measured().weights, false);
  push_judged(time, merged_.measured());
}

/// `may_be_used`: it may have been used before it was judged, and perhaps in another way.
void Estimator::push_judged(double time, Measured outputs, bool may_be_used) noexcept {
  const std::int64_t dropped = grid_.dropped();
  const NodeGrid::Place place = may_be_used ? grid_.put_measurement(time, outputs, method_->reach())
                                            : grid_.push_measurement(time, outputs, method_->reach());
  if (place == NodeGrid::Place::late) ++counts_.late;
  counts_.dropped += grid_.dropped() - dropped;
}

void Estimator::push_input(double time, const double* inputs) noexcept {
  for (std::size_t j = 0; j < measured_inputs_; ++j) values_[j] = cleaned(inputs[j]);
  if (watch_) {
    watch_->clean_inputs(values_.data());
    const auto end = values_.begin() + static_cast<std::ptrdiff_t>(measured_inputs_);
    // A message that says nothing is none: what was said before holds, unless it was wrong.
    const bool is_empty = std::all_of(values_.begin(), end, [](double value) { return std::isnan(value); });
    if (is_empty && !watch_->doubts_any_input()) return;
    time = place_on_timeline(time, inputs_source());
  }
  if (!std::isfinite(time)) return;
  if (watch_) {
    hold_missing_inputs(time);
    grid_.hold_inputs(input_hold());
  }
  grid_.push_input(time, values_.data());
}

/// What is missing of a message of inputs holds for as long as it would if no message came, unless it was wrong.
void Estimator::hold_missing_inputs(double time) noexcept {
  const double longest = input_hold();
  for (std::size_t j = 0; j < measured_inputs_; ++j) {
    HeldInput& held = held_inputs_[j];
    const double age = time - held.time;
    if (!std::isnan(values_[j]))
      held = age < 0.0 ? held : HeldInput{values_[j], time};
    else if (age >= 0.0 && age <= longest && !watch_->doubts_input(j))
      values_[j] = held.value;
  }
}

/// Makes the nodes of all that is stamped up to a time, those anew that it has changed. False if the time was up
/// before.
bool Estimator::take_in(double until, Clock::time_point deadline) noexcept {
  const int outdated = grid_.outdated(until, method_->reach());
  if (outdated > 0) {
    method_->rewind(outdated);
    counts_.nodes -= outdated;
    stale_ = true;
  }
  grid_.take_back(outdated, until);
  const bool has_deadline = deadline != Clock::time_point::max();
  Clock::time_point last = has_deadline ? Clock::now() : Clock::time_point{};
  int made = 0;
  bool is_late = false;
  for (; !is_late && grid_.has_next(until); ++made) {
    grid_.make_next(until);
    add_node();
    if (!has_deadline) continue;
    // The next one probably takes as long.
    const Clock::time_point now = Clock::now();
    is_late = now + (now - last) > deadline;
    last = now;
  }
  if (made > 0) grid_.settle(method_->reach());
  return !is_late || !grid_.has_next(until);
}

void Estimator::add_node() noexcept {
  if (grid_.count() == 1) {
    method_->start(grid_.outputs());
  } else {
    method_->add(grid_.interval(), grid_.outputs());
  }
  ++counts_.nodes;
  stale_ = true;
}

/// Puts those measurements that wait from a row on with its stamp together, e.g. of two sensors. The row behind them.
std::size_t Estimator::merge_waiting(std::size_t row) noexcept {
  const double time = waiting_->time(row);
  merged_.clear();
  for (; row < waiting_->size() && waiting_->time(row) <= time + timeline_.tolerance; ++row)
    merged_.add(waiting_->measured(row));
  return row;
}

/// Whether something waits that is stamped up to a time.
bool Estimator::has_waiting(double until) const noexcept {
  return waiting_->size() > 0 && waiting_->time(0) <= until + timeline_.tolerance;
}

/// The judge goes on from an estimate at the newest node.
void Estimator::estimate_for_judge(Clock::time_point deadline) noexcept {
  method_->estimate(estimate_, deadline);
  clip(estimate_);
  watch_->follow(estimate_);
}

/// Judges what is stamped up to a time, in its order, and hands on what passes. False if the time was up before.
bool Estimator::judge_waiting(double until, Clock::time_point deadline) noexcept {
  const double last = judged_until(until);
  bool is_new = false;
  for (; has_waiting(last); is_new = true) {
    if (is_new && is_past(deadline)) return false;
    const double time = waiting_->time(0);
    waiting_->drop_front(merge_waiting(0));
    const bool is_late = has_started() && time < watched_ - timeline_.tolerance, was_active = watch_->is_active();
    const SensorWatch::Finding finding = is_late ? judge_late(time, merged_, deadline) : judge(time, merged_, deadline);
    if (is_late && was_active && !finding.rebase) {
      push_judged(time, merged_.measured());
      continue;
    }
    push_judged(time, merged_.measured(), time <= used_ + timeline_.tolerance);
    ahead_ = missing_value;
    if (finding.release) {
      for (int i = 0; i < watch_->held_count(); ++i)
        push_judged(watch_->held()[i].time, watch_->held()[i].outputs.measured());
      for (const double jump : watch_->jumps()) grid_.push_jump(jump, method_->reach());
    }
    if (finding.retract) {
      const SensorWatch::Retraction wrong = watch_->retraction();
      grid_.retract(wrong.jumps_from, wrong.outputs_from, wrong.outputs);
    }
    if (finding.rebase && goes_ahead()) grid_.outdate(time);
    if (finding.rebase) {
      // A search that begins at a late measurement goes through what was judged behind it.
      double now = is_late && was_active ? time : watched_;
      while (!std::isnan(now)) {
        // What was measured before counts no longer.
        if (!take_in(now, deadline)) grid_.skip_to(now);
        rebase(watch_->mean(), watch_->covariance());
        now = now < watched_ ? watch_->search_on(now, is_past(deadline)) : missing_value;
      }
    } else if (!watch_->is_active()) {
      take_in(watched_, deadline);
    }
    // There is nothing to judge the next one by yet.
    if (!watch_->is_active() && has_waiting(last)) estimate_for_judge(deadline);
  }
  if (is_new && has_waiting(until) && watch_->is_active()) {
    // The judge goes on from what the estimator says of the last sample that it has judged.
    if (goes_ahead()) grid_.outdate(watched_);
    const bool has_time = deadline == Clock::time_point::max() || Clock::now() + solving_ < deadline;
    if (has_time && take_in(watched_, deadline) && !is_past(deadline)) estimate_for_judge(deadline);
  }
  return judge_ahead(until, deadline);
}

/// Uses what waits for late measurements, up to a time, as far as it passes its gates. False if the time was up before.
bool Estimator::judge_ahead(double until, Clock::time_point deadline) noexcept {
  if (!has_waiting(until)) return true;
  if (std::isnan(ahead_)) {
    watch_->begin_ahead();
    ahead_ = watched_;
  }
  std::size_t row = waiting_->first_after(ahead_ + timeline_.tolerance);
  for (int count = 0; row < waiting_->size() && waiting_->time(row) <= until + timeline_.tolerance; ++count) {
    if (count > 0 && is_past(deadline)) return false;
    const double time = waiting_->time(row);
    row = merge_waiting(row);
    watch_->advance_ahead(time - ahead_, grid_.mean_input(ahead_, time));
    watch_->judge_ahead(merged_.values(), merged_.measured().weights);
    ahead_ = time;
    used_ = std::max(used_, time);
    push_judged(time, merged_.measured(), true);
  }
  return true;
}

void Estimator::rebase(const Eigen::VectorXd& mean, const Eigen::MatrixXd& covariance) noexcept {
  if (!method_->rebase(mean, covariance)) return;
  grid_.settle(method_->reach());
  ++counts_.rebased;
  stale_ = true;
}

/// Judges a row before it is used; what fails becomes NaN.
SensorWatch::Finding Estimator::judge(double time, MeasuredOutputs& outputs, Clock::time_point deadline) noexcept {
  const double last = watched_;
  watched_ = time;
  const double longest = std::max(longest_silence(inputs_source()), timeline_.input_hold);
  const bool is_unknown = time - last > longest && time - clocks_->newest(inputs_source()) > longest;
  if (has_started())
    through_motion(last, time, deadline, [&](double begin, double end) {
      if (is_unknown) {
        guess_input(last, begin, end);
        watch_->advance(end - begin, input_.data(), input_sigmas_.data());
      } else {
        watch_->advance(end - begin, grid_.mean_input(begin, end));
      }
    });
  const SensorWatch::Finding finding = watch_->judge(time, outputs.values(), outputs.measured().weights);
  counts_.rejected = 0;
  for (const SensorHealth& sensor : watch_->sensor_states()) counts_.rejected += sensor.rejected;
  return finding;
}

/// A row that comes late. Where a vehicle of which nothing was known begins by it, the judge goes on from there.
SensorWatch::Finding Estimator::judge_late(double time, MeasuredOutputs& outputs, Clock::time_point deadline) noexcept {
  const bool was_active = watch_->is_active();
  const bool may_search = may_begin_search(outputs.measured());
  const SensorWatch::Finding finding =
      watch_->judge_late(time, outputs.values(), outputs.measured().weights, may_search);
  if (finding.rebase && !was_active)
    through_motion(time, watched_, deadline,
                   [&](double begin, double end) { watch_->advance(end - begin, grid_.mean_input(begin, end)); });
  return finding;
}

/// After so long without a word a source is silent [s].
double Estimator::longest_silence(int source) const noexcept {
  constexpr double least_silence = 1.0, usual_intervals = 5.0, slow = 1.0;
  if (!clocks_->knows_interval(source)) return usual_intervals * slow;
  return std::max(least_silence, usual_intervals * clocks_->usual_interval(source));
}

/// Until the next one is missed: what an input does where nobody says so may be more than all sensors are believed.
double Estimator::input_hold() const noexcept {
  constexpr double late_inputs = 0.5;
  const int source = inputs_source();
  return std::max(timeline_.input_hold, clocks_->knows_interval(source)
                                            ? usual_age(source) + late_inputs * clocks_->usual_interval(source)
                                            : longest_silence(source));
}

/// How old a source's newest message usually is before the next one can be used [s].
double Estimator::usual_age(int source) const noexcept {
  return std::max(ages_[static_cast<std::size_t>(source)].usual, clocks_->usual_interval(source));
}

/// Goes through a time in equal parts. Once the deadline has passed, the rest has only few.
template <class Function>
void Estimator::through_motion(double from, double to, Clock::time_point deadline, const Function& advance) noexcept {
  int parts = parts_of(to - from, timeline_.longest_interval);
  bool is_hasty = false;
  for (int i = 0; i < parts; ++i) {
    if (!is_hasty && i > 0 && parts - i > hasty_parts && is_past(deadline)) {
      from += (to - from) * i / parts;
      parts = hasty_parts;
      i = 0;
      is_hasty = true;
    }
    advance(from + (to - from) * i / parts, i + 1 == parts ? to : from + (to - from) * (i + 1) / parts);
  }
}

/// The mean input over a part of a motion that began at a time, and how much it may be off besides its noise. An input
/// holds; the longer nobody has said so again, the less it is known: within a second it may change by its typical
/// magnitude, and stay there. One that is silent stays missing.
void Estimator::guess_input(double since, double begin, double end) noexcept {
  const std::vector<Variable>& inputs = model().description().inputs;
  std::copy_n(grid_.mean_input(begin, end), input_.size(), input_.begin());
  const double newest_input = clocks_->newest(inputs_source()),
               usual = std::max(clocks_->usual_interval(inputs_source()), timeline_.input_hold);
  const auto age_at = [&](double time) {
    return std::isnan(newest_input) ? time - since : std::max(0.0, time - newest_input - usual);
  };
  // An offset that stays adds up to t^2, not t: each part has what the square grows by.
  const double duration = end - begin, before = begin > since ? age_at(begin) / duration : 0.0,
               aged = age_at(end) / duration;
  for (std::size_t j = 0; j < measured_inputs_; ++j) {
    if (std::isnan(input_[j])) {
      input_sigmas_[j] = 0.0;
      continue;
    }
    const double sigma = inputs[j].scale * std::min(1.0, age_at(end));
    input_sigmas_[j] = sigma * std::sqrt(std::max(0.0, aged * aged - before * before));
  }
}

/// Learns how old messages are before the next one of their source can be used: by its interval, and by how late it is.
void Estimator::note_ages(double time) noexcept {
  for (std::size_t s = 0; s < ages_.size(); ++s) {
    const int source = static_cast<int>(s);
    Age& age = ages_[s];
    const double newest = clocks_->newest(source);
    if (std::isnan(newest)) continue;
    if (newest > age.newest) {
      const double late = age.last - age.usual, interval = clocks_->usual_interval(source);
      const double off = std::min(std::abs(late), most_spread * interval);
      age.variance += (off * off - age.variance) / spread_memory;
      age.usual += std::min(late, most_late * interval) / age_memory;
    }
    age.newest = newest;
    age.last = std::max(0.0, time - newest);
  }
}

/// Nobody knows when one is to come of which there was none yet: it is missed when it would be silent.
SensorWatch::Presence Estimator::presence(int source, double time) const noexcept {
  if (!has_started()) return SensorWatch::Presence::present;
  const double interval = clocks_->usual_interval(source), newest = clocks_->newest(source);
  if (std::isnan(newest)) {
    const bool is_missed = time - clocks_->first() > longest_silence(source);
    return is_missed ? SensorWatch::Presence::silent : SensorWatch::Presence::present;
  }
  const double held = source == inputs_source() ? timeline_.input_hold : 0.0,
               beyond = time - newest - std::max(usual_age(source), held);
  if (beyond > longest_silence(source) - interval) return SensorWatch::Presence::silent;
  const double tolerance = std::max(overdue * std::max(interval, timeline_.longest_interval),
                                    unusually_late * std::sqrt(ages_[static_cast<std::size_t>(source)].variance));
  return beyond > tolerance ? SensorWatch::Presence::overdue : SensorWatch::Presence::present;
}

void Estimator::assess(Estimate& estimate, double time) noexcept {
  if (!watch_) return;
  const bool is_estimated = estimate.covariance.size() > 0 && estimate.covariance.diagonal().maxCoeff() > 0.0;
  std::uint32_t reasons = !has_started() || (is_estimated && !watch_->is_active()) ? reason::starting : 0;
  for (std::size_t s = 0; s < presence_.size(); ++s) {
    presence_[s] = presence(static_cast<int>(s), time);
    if (clocks_->is_suspected(static_cast<int>(s))) reasons |= reason::clock;
  }
  if (clocks_->is_suspected(inputs_source())) reasons |= reason::clock;
  const auto of_inputs = measured_inputs_ > 0 ? presence(inputs_source(), time) : SensorWatch::Presence::present;
  watch_->assess(estimate, presence_, of_inputs, reasons, estimate.health);
}

/// What leads beyond a bound, as a steering angle beyond its stop, ends there.
void Estimator::clip(Estimate& estimate) const noexcept {
  const std::vector<Variable>& states = model().description().states;
  for (Eigen::Index j = 0; j < std::min<Eigen::Index>(std::ssize(states), estimate.state.size()); ++j)
    estimate.state[j] = std::min(std::max(estimate.state[j], states[j].lower), states[j].upper);
}

/// Goes on with what is given out, from the newest node.
void Estimator::predict_to(double time, Clock::time_point deadline) noexcept {
  predicted_.predicted = true;
  const double last = grid_.time();
  if (watch_ && watch_->is_active()) {
    watch_->begin_predicting();
    return through_motion(last, time, deadline, [&](double begin, double end) {
      guess_input(last, begin, end);
      watch_->predict(end - begin, input_.data(), input_sigmas_.data(), predicted_);
      clip(predicted_);
    });
  }
  through_motion(last, time, deadline, [&](double begin, double end) {
    std::copy_n(grid_.mean_input(begin, end), input_.size(), input_.begin());
    for (double& u : input_)
      if (std::isnan(u)) u = 0.0;
    const double duration = end - begin;
    Model::Intervals request;
    request.count = 1;
    request.states = predicted_.state.data();
    request.inputs = input_.data();
    request.parameters = predicted_.parameters.data();
    request.durations = &duration;
    request.substeps = method_->substeps() * std::min(most_steps, parts_of(duration, timeline_.longest_interval));
    request.next_states = next_.data();
    method_->model().integrate(request);
    if (std::all_of(next_.begin(), next_.end(), [](double value) { return std::isfinite(value); }))
      std::copy(next_.begin(), next_.end(), predicted_.state.data());
    clip(predicted_);
  });
}

/// Holds the newest interval's steps against twice as many, from the newest node on: what the vehicle does there can be
/// faster than what was foreseen at set-up.
void Estimator::check_integration() noexcept {
  if (grid_.count() < 2) return;
  const MeasuredInterval interval = grid_.interval();
  std::copy_n(interval.inputs, input_.size(), input_.begin());
  for (double& u : input_)
    if (std::isnan(u)) u = 0.0;
  int state = -1;
  const double error = step_error_(estimate_.state.data(), input_.data(), estimate_.parameters.data(),
                                   interval.duration, method_->substeps(), &state);
  ++counts_.integrated;
  if (!(error > coarse_error)) return;
  ++counts_.coarse;
  if (error <= worst_error_) return;
  worst_error_ = error;
  counts_.coarse_state = state;
}

void Estimator::prepare() noexcept {
  // A node that gives way to the next measurement is taken back first, and with it what was prepared.
  if (!grid_.ends_open()) method_->prepare();
}

const Estimate& Estimator::estimate(double time, Clock::time_point deadline) noexcept {
  double clock_offset = 0.0;
  bool is_all_judged = true, is_all_taken_in = true;
  // A call that is late goes on for a little, so that one that is always late keeps up, whatever a node costs.
  const bool has_deadline = deadline != Clock::time_point::max();
  const Clock::time_point begin = has_deadline ? Clock::now() : Clock::time_point{};
  const auto extended = [&](double share, Clock::time_point until) {
    if (!has_deadline) return deadline;
    return std::max(until, begin + std::chrono::duration_cast<Clock::duration>(
                                       std::chrono::duration<double>(share * timeline_.grace)));
  };
  // What follows the nodes takes its time, too.
  const Clock::duration left = has_deadline && deadline > begin ? deadline - begin : Clock::duration::zero();
  const Clock::time_point before_solving = deadline - std::min(solving_, left / 2);
  if (watch_) {
    watch_->begin_innovations();
    clock_offset = clocks_->offset_of(time);
    time -= clock_offset;
    is_all_judged = judge_waiting(time, extended(0.5, before_solving));
  }
  if (watch_ && std::isfinite(time)) note_ages(time);
  if (has_started() || !std::isnan(time))
    is_all_taken_in =
        take_in(has_started() && !(time > grid_.time()) ? grid_.time() : time, extended(1.0, before_solving));
  if (!has_started()) {
    assess(estimate_, time);
    return estimate_;
  }
  if (stale_) {
    const Clock::time_point solving = has_deadline ? Clock::now() : Clock::time_point{};
    method_->estimate(estimate_, deadline);
    if (has_deadline) solving_ = Clock::now() - solving;
    clip(estimate_);
    stale_ = false;
    // The judge is where the last sample is that it has judged.
    if (watch_ && is_all_taken_in && !goes_ahead()) watch_->follow(estimate_);
    if (!(is_all_judged && is_all_taken_in) && is_usable(estimate_.report.status))
      estimate_.report.status = Status::deadline;
    ++counts_.estimates;
    counts_.fallbacks += estimate_.fallback;
    if (counts_.estimates % checked_interval == 0) check_integration();
  }
  const double newest = grid_.time();
  estimate_.time = newest + clock_offset;
  if (watch_) estimate_.innovations = watch_->innovations();
  const bool is_ahead = std::isfinite(time) && time > newest + timeline_.tolerance;
  const bool is_in_doubt = watch_ && is_all_taken_in && watch_->is_in_doubt();
  const bool is_correlated = watch_ && watch_->is_correlated();
  if (!is_ahead && !is_in_doubt && !is_correlated) {
    assess(estimate_, std::isfinite(time) ? time : newest);
    return estimate_;
  }
  predicted_ = estimate_;
  // What is given out alone: everything goes on from what the method says.
  if (is_correlated) watch_->scale(predicted_);
  if (is_in_doubt) {
    watch_->widen(predicted_);
    clip(predicted_);
  }
  if (!is_ahead) {
    assess(predicted_, std::isfinite(time) ? time : newest);
    return predicted_;
  }
  predict_to(time, extended(1.0, deadline));
  predicted_.time = time + clock_offset;
  assess(predicted_, time);
  return predicted_;
}

}  // namespace rhec
