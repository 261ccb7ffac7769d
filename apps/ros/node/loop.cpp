#include "loop.hpp"

#include <fmt/format.h>
#include <pthread.h>
#include <sched.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstring>
#include <limits>
#include <utility>

#include "rhec/core/base/error.hpp"
#include "rhec/logs/mapping/drive.hpp"
#include "rhec/sim/replay/drive_replay.hpp"

namespace rhec::apps::ros {
namespace {

constexpr double missing = std::numeric_limits<double>::quiet_NaN();
// For so long all outputs are waited for before an estimate begins [s].
constexpr double longest_gathering = 1.0;
constexpr std::size_t most_gathered = 100000;
// An input that nothing has said for so long is not known [s].
constexpr double longest_hold = 1.0;
// A sample begins a step if it comes a quarter of a step before that is due, or later; half a step later the loop goes
// on without it.
constexpr double early = 0.25, late = 0.5;
constexpr std::size_t most_latencies = 100000;
// A rehearsal ends so long before a step is due. There are no more of them once so many in a row have taken more than
// this share of the steps: one alone has been interrupted.
constexpr auto after_rehearsal = std::chrono::microseconds(200);
constexpr int most_long_rehearsals = 3;
constexpr double most_of_step = 0.1;
// Behind a rehearsal the loop does not sleep until the step begins, for a processor that sleeps takes a while to wake
// up: but not for longer than this after it was due, and for this share of a step.
constexpr auto awake_after_due = std::chrono::microseconds(300);
constexpr double most_awake_of_step = 0.1;
// Without a step that is due, the loop looks around so often.
constexpr auto between_looks = std::chrono::milliseconds(100);
constexpr std::size_t most_events = 1000;

double seconds(Clock::duration duration) { return std::chrono::duration<double>(duration).count(); }

Clock::duration of_step(Clock::duration step, double share) {
  return std::chrono::duration_cast<Clock::duration>(step * share);
}

/// Processors that this process may run on.
int processor_count() {
  cpu_set_t processors;
  CPU_ZERO(&processors);
  return sched_getaffinity(0, sizeof(processors), &processors) == 0 ? CPU_COUNT(&processors) : 1;
}

/// What does not steer needs no form that its model is made for.
CommandOptions command_options(const RosOptions& options) {
  CommandOptions command = options.command;
  if (!command.steer) command.form = CommandForm::inputs;
  return command;
}

}  // namespace

const char* in_words(Driving driving) noexcept {
  switch (driving) {
    case Driving::clock:
      return "waits for the time on /clock";
    case Driving::waiting:
      return "waits for measurements";
    case Driving::heading:
      return "waits for a heading that is known: move the vehicle";
    case Driving::no_path:
      return "waits for a path";
    case Driving::stopped:
      return "stopped by the stop topic";
    case Driving::silent:
      return "stopped: no measurements";
    case Driving::finished:
      return "at the end of the path";
    case Driving::estimating:
      return "estimates, does not steer";
    case Driving::facing_away:
      return "stands: the path leads away behind the vehicle; turn it, or begin the path with a turn";
    case Driving::turning_around:
      return "turns around: the path leads away behind the vehicle";
    case Driving::standing:
      return "stands where the path goes on: something is in its way, or a limit leaves no other plan";
    case Driving::going_back:
      return "goes back along the path: a limit keeps it from going on";
    case Driving::driving:
      break;
  }
  return "drives";
}

Loop::Loop(Participant& wire, const LiveTopics& topics, Intake& intake, const Robot& robot, const RosOptions& options)
    : wire_(wire),
      intake_(intake),
      robot_(robot),
      options_(options),
      command_message_(robot.model(), command_options(options), robot.step()),
      track_messages_(robot, {options.frames.fixed, options.frames.vehicle}),
      step_(std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(robot.step()))),
      time_(options.use_sim_time),
      has_other_processor_(processor_count() > 1) {
  forget_inputs_and_outputs();
  report_.latencies.reserve(most_latencies);
  report_.other.topic = "others";
  subscribe(topics);
  publish();
  wire_.announce();
}

Loop::~Loop() { stop(); }

void Loop::start(const ThreadOptions& options) {
  thread_ = std::thread([this] {
    try {
      run();
    } catch (...) {  // handed to the thread that supervises this one: `check`
      const std::lock_guard lock(mutex_);
      failure_ = std::current_exception();
    }
    stop_robot();
  });
  const auto refuse = [this](const std::string& what, int reason) {
    stop();
    return Error(fmt::format("{}: {}", what, std::strerror(reason)));
  };
  if (options.priority > 0) {
    const sched_param parameters{.sched_priority = options.priority};
    if (const int reason = pthread_setschedparam(thread_.native_handle(), SCHED_FIFO, &parameters))
      throw refuse(fmt::format("--priority {}: expected the right to real-time priorities, by `ulimit -r` or "
                               "CAP_SYS_NICE",
                               options.priority),
                   reason);
  }
  if (options.processor) {
    cpu_set_t processors;
    CPU_ZERO(&processors);
    CPU_SET(static_cast<std::size_t>(*options.processor), &processors);
    if (const int reason = pthread_setaffinity_np(thread_.native_handle(), sizeof(processors), &processors))
      throw refuse(fmt::format("--cpu {}: expected a processor of this machine, counted from 0", *options.processor),
                   reason);
  }
}

void Loop::stop() noexcept {
  is_asked_to_stop_ = true;
  wire_.wake();
  if (thread_.joinable()) thread_.join();
}

void Loop::check() const {
  const std::lock_guard lock(mutex_);
  if (failure_) std::rethrow_exception(failure_);
}

void Loop::follow(std::unique_ptr<Controller> controller) {
  const std::lock_guard lock(mutex_);
  last_controller_.reset();
  next_controller_ = std::move(controller);
}

std::optional<std::vector<Position>> Loop::take_wanted_path() {
  const std::lock_guard lock(mutex_);
  return std::exchange(wanted_path_, std::nullopt);
}

std::vector<std::string> Loop::take_events() {
  const std::lock_guard lock(mutex_);
  return std::exchange(events_, {});
}

std::shared_ptr<const SlipAhead> Loop::slip_ahead() const {
  const std::lock_guard lock(mutex_);
  return slip_ahead_;
}

LoopReport Loop::report() const {
  LoopReport report = report_;
  report.topics = intake_.counts();
  report.origin = intake_.origin();
  report.driving = driving_;
  if (estimator_) report.estimator = estimator_->counts();
  report.jumps = jumps_;
  return report;
}

void Loop::forget_inputs_and_outputs() {
  const ModelDescription& about = robot_.model()->description();
  seen_.clear();
  for (const bool is_measured : intake_.measured()) seen_.push_back(!is_measured);
  inputs_.assign(about.inputs.size(), missing);
  input_times_.assign(about.inputs.size(), -std::numeric_limits<double>::infinity());
  held_ = inputs_;
  gathered_.clear();
}

void Loop::say(std::string text) {
  const std::lock_guard lock(mutex_);
  if (events_.size() < most_events) events_.push_back(std::move(text));
}

Clock::time_point Loop::next_look() const {
  if (!is_triggered_) return due_ + of_step(step_, late);
  return last_received_ >= due_ - of_step(step_, early) ? last_received_ : due_;
}

/// The computer's time. A time that others tell goes on with their messages, which end any wait.
Clock::time_point Loop::wait_until() const {
  const bool is_due = estimator_ && !time_.is_simulated();
  if (!is_due) return Clock::now() + between_looks;
  if (stays_awake()) return Clock::now();
  return may_rehearse() ? std::min(next_look(), expected() - after_rehearsal - rehearsal_) : next_look();
}

/// When the next step probably begins: a step after the last sample, even where that came early.
Clock::time_point Loop::expected() const { return std::min(due_, last_received_ + step_); }

/// Between two steps other programs use the processor's caches. What comes just before a step brings code and data
/// back.
bool Loop::may_rehearse() const {
  return !is_triggered_ && rehearsed_ != expected() && long_rehearsals_ < most_long_rehearsals;
}

/// Whether it looks for messages without sleeping, having rehearsed for a step that is expected now. Whatever receives
/// messages needs another processor for that.
bool Loop::stays_awake() const {
  if (!has_other_processor_ || is_triggered_ || rehearsed_ != expected() || long_rehearsals_ > 0) return false;
  const Clock::duration most =
      std::min<Clock::duration>(of_step(step_, most_awake_of_step), after_rehearsal + awake_after_due);
  return Clock::now() < expected() - after_rehearsal + most;
}

void Loop::rehearse() {
  const Clock::time_point begin = Clock::now();
  if (begin < expected() - after_rehearsal - rehearsal_) return;
  rehearsed_ = expected();
  if (begin > expected() - rehearsal_) return;
  estimator_->rehearse();
  const Clock::duration taken = Clock::now() - begin;
  if (taken > of_step(step_, most_of_step)) {
    ++long_rehearsals_;
    return;
  }
  rehearsal_ = taken;
  long_rehearsals_ = 0;
}

/// Steps lie on a grid, so that quick sensors do not hasten them, which follows sensors that are as quick as the steps:
/// a sample that had to wait says when the next one is to be expected.
void Loop::set_due(Clock::time_point begin, bool was_triggered) {
  if (was_triggered && begin - last_received_ > of_step(step_, early))
    due_ = last_received_ + step_;
  else if (begin - due_ <= of_step(step_, late + early))
    due_ += step_;
  else
    due_ = begin + step_;
}

void Loop::run() {
  while (!is_asked_to_stop_) {
    wire_.wait(wait_until());
    wire_.take([this](const Arrival& arrival) { hear(arrival); });
    watch_clock();
    if (!estimator_) {
      begin_if_possible();
      tell_waiting();
      continue;
    }
    if (time_.instant() >= next_look()) {
      cycle();
    } else if (may_rehearse() && !time_.is_simulated()) {
      rehearse();
    }
  }
  if (controller_) controller_->finish();
  if (estimator_) estimator_->end_drive();
}

void Loop::hear(const Arrival& arrival) {
  const int meaning = meaning_of_reader_[static_cast<std::size_t>(arrival.reader)];
  if (meaning < 0) return hear_special(-1 - meaning, arrival);
  if (!time_.is_known()) return;  // what a stamp means is not known
  for (const logs::SignalRow& row : intake_.take(meaning, arrival.cdr, time_.now()))
    use(row, triggers_[static_cast<std::size_t>(meaning)], arrival.received);
}

void Loop::use(const logs::SignalRow& row, bool triggers, Clock::time_point received) {
  if (row.is_output) {
    last_measured_ = time_.instant_of(received);
    if (triggers) {
      is_triggered_ = true;
      last_received_ = last_measured_;
      last_arrival_ = received;
    }
  }
  if (estimator_) return push(row);
  if (gathered_.empty()) gathering_since_ = time_.instant();
  if (gathered_.size() < most_gathered) gathered_.push_back(row);
  if (!row.is_output) return;
  for (std::size_t j = 0; j < row.values.size(); ++j)
    if (!std::isnan(row.values[j])) seen_[j] = true;
}

void Loop::push(const logs::SignalRow& row) {
  const double time = time_of(row.stamp);
  if (row.is_output)
    return estimator_->push_measurement(time, row.values.data(), row.sigmas.empty() ? nullptr : row.sigmas.data());
  // Inputs may come in several messages: what another one has said holds on.
  for (std::size_t j = 0; j < inputs_.size(); ++j) {
    if (!std::isnan(row.values[j]) && time >= input_times_[j]) {
      inputs_[j] = row.values[j];
      input_times_[j] = time;
    }
    const bool holds = std::isnan(row.values[j]) && std::abs(time - input_times_[j]) <= longest_hold;
    held_[j] = holds ? inputs_[j] : row.values[j];
  }
  estimator_->push_input(time, held_.data());
}

void Loop::begin_if_possible() {
  const bool has_output = std::ranges::any_of(gathered_, [](const logs::SignalRow& row) { return row.is_output; });
  const bool has_all = std::ranges::all_of(seen_, [](bool seen) { return seen; });
  if (!has_output || (!has_all && seconds(time_.instant() - gathering_since_) < longest_gathering)) return;
  logs::Drive drive;
  drive.outputs = static_cast<int>(seen_.size());
  drive.inputs = static_cast<int>(inputs_.size());
  drive.start = start_ = gathered_.front().stamp;
  for (const logs::SignalRow& row : gathered_) {
    const double time = time_of(row.stamp);
    drive.events.push_back({time, time, row.is_output, drive.values.size()});
    drive.values.insert(drive.values.end(), row.values.begin(), row.values.end());
  }
  estimator_ = robot_.make_estimator(sim::start_of(robot_, drive));
  for (const logs::SignalRow& row : gathered_) push(row);
  gathered_.clear();
  due_ = time_.instant();
  long_rehearsals_ = 0;
  {
    const std::lock_guard lock(mutex_);
    slip_ahead_ = estimator_->slip_ahead();
  }
  say("estimates begin");
}

void Loop::change_controller() {
  std::unique_lock lock(mutex_, std::try_to_lock);
  if (!lock.owns_lock() || !next_controller_ || last_controller_) return;
  last_controller_ = std::exchange(controller_, std::move(next_controller_));  // freed by the other thread
  lock.unlock();
  has_told_crowd_ = false;
  regard_obstacles();
  is_finished_ = false;
  const int writer = track_writers_[static_cast<std::size_t>(sim::TrackTopic::path)];
  track_messages_.write_path(controller_->path(), time_.now(),
                             [&](sim::TrackTopic, logs::Stamp, std::span<const std::byte> message) {
                               if (writer >= 0 && !wire_.write(writer, message)) ++report_.unsent;
                             });
}

Driving Loop::judge(const Estimate& estimate, Clock::time_point now) const {
  if (!options_.command.steer) return Driving::estimating;
  if (is_stopped_by_topic_) return Driving::stopped;
  if (seconds(now - last_measured_) > options_.command.timeout) return Driving::silent;
  const int heading = robot_.model()->description().roles.heading;
  const bool is_known =
      heading < 0 || estimate.covariance.size() == 0 ||
      std::sqrt(std::max(0.0, estimate.covariance(heading, heading))) <= options_.command.heading_sigma;
  if (!is_known || (estimate.health.reasons & reason::starting) != 0) return Driving::heading;
  if (!controller_) return Driving::no_path;
  return controller_->finished() ? Driving::finished : Driving::driving;
}

void Loop::cycle() {
  const Clock::time_point begin = time_.instant();
  const Clock::time_point woken = Clock::now();
  const Clock::time_point deadline = woken + step_;
  const bool was_triggered = std::exchange(is_triggered_, false);
  set_due(begin, was_triggered);
  change_controller();
  const logs::Stamp when = time_.now();
  const double time = time_of(when);
  const Estimate& estimate = estimator_->estimate(time, deadline);
  const Clock::time_point estimated = Clock::now();
  note_place(estimate);
  Driving driving = judge(estimate, begin);
  const Controller::Command* command = nullptr;
  if (driving == Driving::driving) {
    if (rests_ && has_driven_) {  // it stood, and may have been moved
      const std::vector<double> zeros(inputs_.size(), 0.0);
      controller_->applied(zeros.data());
      controller_->locate();
    }
    command = &controller_->control(estimate, deadline);
    if (controller_->finished()) {
      driving = Driving::finished;
      command = nullptr;
    } else if (command->faces_away) {
      driving = Driving::facing_away;
    } else if (command->turns_around) {
      driving = Driving::turning_around;
    } else if (command->goes_back) {
      driving = Driving::going_back;
    } else if (command->stands) {
      driving = Driving::standing;
    }
  }
  const Clock::time_point controlled = Clock::now();
  rests_ = command == nullptr;
  has_driven_ = has_driven_ || command;
  send_command(estimate, when, command);
  const Clock::time_point sent = Clock::now();
  ++report_.cycles;
  report_.driven += command ? 1 : 0;
  report_.misses += sent > deadline ? 1 : 0;
  report_.degraded += estimate.health.level == HealthLevel::degraded ? 1 : 0;
  report_.lost += estimate.health.level == HealthLevel::lost ? 1 : 0;
  report_.health = estimate.health.level;
  if (was_triggered) {
    if (report_.latencies.size() < most_latencies) report_.latencies.emplace_back();
    report_.latencies[latency_place_] = {.whole = seconds(sent - last_arrival_),
                                         .hearing = seconds(woken - last_arrival_),
                                         .estimate = seconds(estimated - woken),
                                         .control = seconds(controlled - estimated)};
    latency_place_ = (latency_place_ + 1) % most_latencies;
  }
  const bool has_changed = driving != driving_;
  driving_ = driving;
  if (has_changed) say(in_words(driving));
  if (driving == Driving::finished) is_finished_ = true;
  tell(estimate, when, time, command);
  if (has_changed || estimate.health.level != told_level_ || sent - told_health_ >= between_diagnostics)
    tell_health(estimate, when);
  if (controller_ && command) controller_->prepare();
  estimator_->prepare();
}

void Loop::send_command(const Estimate& estimate, logs::Stamp when, const Controller::Command* command) {
  // Before it has driven, the vehicle may be somebody else's to move.
  if (command_writer_ < 0 || !has_driven_) return;
  const std::span<const std::byte> message =
      command ? command_message_.write(when, options_.frames.vehicle, estimate.state.data(), command->inputs.data())
              : command_message_.stop(when, options_.frames.vehicle);
  if (!wire_.write(command_writer_, message)) ++report_.unsent;
}

void Loop::stop_robot() noexcept {
  if (command_writer_ < 0 || !has_driven_) return;
  try {
    if (!wire_.write(command_writer_, command_message_.stop(time_.now(), options_.frames.vehicle))) ++report_.unsent;
    wire_.flush(command_writer_, std::chrono::milliseconds(200));
  } catch (const std::bad_alloc&) {  // the base stops by its own time-out
    ++report_.unsent;
  }
}

}  // namespace rhec::apps::ros
