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

#include "../messages/type_hash.hpp"
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
// A sample may come a quarter of a step before it is due; half a step later the loop goes on without it.
constexpr double early = 0.25, late = 0.5;
constexpr std::size_t most_latencies = 100000;
constexpr auto between_diagnostics = std::chrono::seconds(1);
constexpr std::size_t most_events = 1000;

/// Topics that are heard and are no measurements.
enum class Other : int { path, obstacles, stop, clock };

double seconds(Clock::duration duration) { return std::chrono::duration<double>(duration).count(); }

Clock::duration of_step(Clock::duration step, double share) {
  return std::chrono::duration_cast<Clock::duration>(step * share);
}

WireTopic topic_of(const std::string& name, const std::string& type) {
  return {name, type, type_hash(type, logs::builtin_definitions())};
}

}  // namespace

const char* in_words(Driving driving) noexcept {
  switch (driving) {
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
      command_message_(robot.model(), options.command, robot.step()),
      track_messages_(robot, {options.frames.fixed, options.frames.vehicle}),
      step_(std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(robot.step()))) {
  const ModelDescription& about = robot.model()->description();
  for (const bool is_measured : intake.measured()) seen_.push_back(!is_measured);
  inputs_.assign(about.inputs.size(), missing);
  input_times_.assign(about.inputs.size(), -std::numeric_limits<double>::infinity());
  held_ = inputs_;
  report_.latencies.reserve(most_latencies);
  report_.other.topic = "others";
  subscribe(topics);
  publish();
  wire_.announce();
}

Loop::~Loop() { stop(); }

void Loop::subscribe(const LiveTopics& topics) {
  const int count = static_cast<int>(topics.topics().size());
  triggers_.assign(static_cast<std::size_t>(count), false);
  bool has_trigger = options_.trigger.empty();
  for (int i = 0; i < count; ++i) {
    const logs::Topic& topic = topics.topics()[static_cast<std::size_t>(i)];
    if (!intake_.is_wanted(i)) continue;
    wire_.add_reader({topic.name, topic.type, topics.hash(i)}, Delivery::latest, 100);
    meaning_of_reader_.push_back(i);
    triggers_[static_cast<std::size_t>(i)] = options_.trigger.empty() || options_.trigger == topic.name;
    has_trigger = has_trigger || options_.trigger == topic.name;
  }
  if (!has_trigger)
    throw Error(fmt::format("ros.trigger: found '{}', expected a topic of the section `signals`", options_.trigger));
  const auto hear = [&](Other other, const std::string& name, const char* type, Delivery delivery) {
    if (name.empty()) return;
    wire_.add_reader(topic_of(name, type), delivery);
    meaning_of_reader_.push_back(-1 - static_cast<int>(other));
  };
  if (options_.command.steer) {
    // Whoever publishes a path, does so reliably; it is large, and comes once.
    hear(Other::path, options_.names.wanted_path, "nav_msgs/msg/Path", Delivery::sure);
    hear(Other::obstacles, options_.names.obstacles, "geometry_msgs/msg/PoseArray", Delivery::latest);
    // A stop is heard from everybody, reliable or not.
    hear(Other::stop, options_.names.stop, "std_msgs/msg/Bool", Delivery::latest);
  }
  if (options_.use_sim_time) hear(Other::clock, options_.names.clock, "rosgraph_msgs/msg/Clock", Delivery::latest);
}

void Loop::publish() {
  const NameOptions& names = options_.names;
  const auto add = [&](sim::TrackTopic which, const std::string& name, Delivery delivery) {
    track_writers_[static_cast<std::size_t>(which)] =
        name.empty() ? -1 : wire_.add_writer(topic_of(name, sim::TrackMessages::topic(which).type), delivery);
  };
  const bool steers = options_.command.steer;
  add(sim::TrackTopic::odometry, names.odometry, Delivery::sure);
  add(sim::TrackTopic::transforms, options_.frames.publish ? names.transforms : "", Delivery::sure);
  add(sim::TrackTopic::plan, steers ? names.plan : "", Delivery::sure);
  add(sim::TrackTopic::slip, names.slip, Delivery::sure);
  add(sim::TrackTopic::state, names.state, Delivery::sure);
  add(sim::TrackTopic::inputs, steers ? names.inputs : "", Delivery::sure);
  add(sim::TrackTopic::diagnostics, "", Delivery::sure);  // told more rarely, with more in it
  add(sim::TrackTopic::path, steers ? names.path : "", Delivery::kept);
  if (!names.diagnostics.empty())
    diagnostics_writer_ =
        wire_.add_writer(topic_of(names.diagnostics, "diagnostic_msgs/msg/DiagnosticArray"), Delivery::sure);
  if (steers) command_writer_ = wire_.add_writer(topic_of(names.command, command_message_.type()), Delivery::sure);
}

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
  return report;
}

void Loop::say(std::string text) {
  const std::lock_guard lock(mutex_);
  if (events_.size() < most_events) events_.push_back(std::move(text));
}

logs::Stamp Loop::now() const {
  if (options_.use_sim_time) return simulated_now_;
  return std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::system_clock::now().time_since_epoch())
      .count();
}

Clock::time_point Loop::next_look() const {
  if (!estimator_) return Clock::now() + std::chrono::milliseconds(100);
  return is_triggered_ ? due_ - of_step(step_, early) : due_ + of_step(step_, late);
}

void Loop::run() {
  while (!is_asked_to_stop_) {
    wire_.wait(next_look());
    wire_.take([this](const Arrival& arrival) { hear(arrival); });
    if (!estimator_) {
      begin_if_possible();
      continue;
    }
    if (Clock::now() >= next_look()) cycle();
  }
  if (controller_) controller_->finish();
  if (estimator_) estimator_->end_drive();
}

void Loop::hear(const Arrival& arrival) {
  const int meaning = meaning_of_reader_[static_cast<std::size_t>(arrival.reader)];
  if (meaning < 0) return hear_special(-1 - meaning, arrival.cdr);
  for (const logs::SignalRow& row : intake_.take(meaning, arrival.cdr, now()))
    use(row, triggers_[static_cast<std::size_t>(meaning)], arrival.received);
}

void Loop::hear_special(int which, std::span<const std::byte> message) {
  TopicCount& count = report_.other;
  const auto refuse = [&](Refusal refusal, std::string text) {
    ++count.refused[static_cast<std::size_t>(refusal)];
    count.last = std::move(text);
  };
  const auto has_frame = [&](const Positions& positions) {
    if (positions.header.frame == options_.frames.fixed) return true;
    refuse(Refusal::frame, fmt::format("its frame is {}, expected '{}'", logs::in_quotes(positions.header.frame),
                                       options_.frames.fixed));
    return false;
  };
  if (message.empty()) return refuse(Refusal::too_large, "it was too large");
  try {
    switch (static_cast<Other>(which)) {
      case Other::path: {
        Positions path = read_path(message);
        if (!has_frame(path)) return;
        const std::lock_guard lock(mutex_);
        wanted_path_ = std::move(path.places);
        break;
      }
      case Other::obstacles: {
        const Positions poses = read_pose_array(message);
        if (!has_frame(poses)) return;
        obstacles_.clear();
        for (const Position& place : poses.places)
          obstacles_.push_back({.x = place.x,
                                .y = place.y,
                                .semi_axis_along = options_.obstacle_radius,
                                .semi_axis_across = options_.obstacle_radius});
        obstacles_time_ = time_of(poses.header.stamp);
        if (controller_) controller_->set_obstacles(obstacles_, obstacles_time_);
        break;
      }
      case Other::stop:
        is_stopped_by_topic_ = read_flag(message);
        break;
      case Other::clock:
        simulated_now_ = read_clock(message);
        break;
    }
    ++count.used;
  } catch (const logs::RecordError& error) {
    refuse(Refusal::broken, error.what());
  }
}

void Loop::use(const logs::SignalRow& row, bool triggers, Clock::time_point received) {
  if (row.is_output) {
    last_measured_ = received;
    if (triggers) {
      is_triggered_ = true;
      last_received_ = received;
    }
  }
  if (estimator_) return push(row);
  if (gathered_.empty()) gathering_since_ = Clock::now();
  if (gathered_.size() < most_gathered) gathered_.push_back(row);
  if (!row.is_output) return;
  for (std::size_t j = 0; j < row.values.size(); ++j)
    if (!std::isnan(row.values[j])) seen_[j] = true;
}

void Loop::push(const logs::SignalRow& row) {
  const double time = time_of(row.stamp);
  if (row.is_output) return estimator_->push_measurement(time, row.values.data());
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
  if (!has_output || (!has_all && seconds(Clock::now() - gathering_since_) < longest_gathering)) return;
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
  due_ = Clock::now();
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
  controller_->set_obstacles(obstacles_, obstacles_time_);
  is_finished_ = false;
  const int writer = track_writers_[static_cast<std::size_t>(sim::TrackTopic::path)];
  track_messages_.write_path(controller_->path(), now(),
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
  const Clock::time_point begin = Clock::now();
  const Clock::time_point deadline = begin + step_;
  const bool was_triggered = std::exchange(is_triggered_, false);
  due_ = std::max(due_ + step_, begin + of_step(step_, 1.0 - early));
  change_controller();
  const logs::Stamp when = now();
  const double time = time_of(when);
  const Estimate& estimate = estimator_->estimate(time, deadline);
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
    }
  }
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
    if (report_.latencies.size() < most_latencies) report_.latencies.push_back(0.0);
    report_.latencies[latency_place_] = seconds(sent - last_received_);
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

void Loop::tell(const Estimate& estimate, logs::Stamp when, double time, const Controller::Command* command) {
  sim::TrackSample sample = sim::track_sample({.step = report_.cycles,
                                               .time = time,
                                               .estimator = estimator_.get(),
                                               .estimate = &estimate,
                                               .controller = command ? controller_.get() : nullptr,
                                               .command = command},
                                              robot_, start_);
  sample.stamp = when;
  track_messages_.write(sample, [this](sim::TrackTopic topic, logs::Stamp, std::span<const std::byte> message) {
    const int writer = track_writers_[static_cast<std::size_t>(topic)];
    if (writer >= 0 && !wire_.write(writer, message)) ++report_.unsent;
  });
}

void Loop::tell_health(const Estimate& estimate, logs::Stamp when) {
  told_health_ = Clock::now();
  if (estimate.health.level != told_level_)
    say(estimator_->watch() ? rhec::in_words(estimate.health, estimator_->watch()->sensors())
                            : rhec::name_of(estimate.health.level));
  told_level_ = estimate.health.level;
  if (diagnostics_writer_ < 0) return;
  std::vector<sim::DiagnosticValue> values{{"driving", in_words(driving_)},
                                           {"health", rhec::name_of(estimate.health.level)},
                                           {"steps", std::to_string(report_.cycles)},
                                           {"deadlines missed", std::to_string(report_.misses)}};
  std::int64_t refused = report_.other.refusals();
  for (const TopicCount& count : intake_.counts()) {
    refused += count.refusals();
    if (count.refusals() > 0)
      values.push_back({"refused of " + count.topic, fmt::format("{}: {}", count.refusals(), count.last)});
  }
  values.push_back({"messages refused", std::to_string(refused)});
  const std::string findings = estimate.health.level != HealthLevel::ok && estimator_->watch()
                                   ? rhec::in_words(estimate.health, estimator_->watch()->sensors())
                                   : rhec::name_of(estimate.health.level);
  const bool is_error = estimate.health.level == HealthLevel::lost || driving_ == Driving::silent;
  const std::uint8_t level = is_error ? 2 : estimate.health.level == HealthLevel::degraded ? 1 : 0;
  message_.clear();
  sim::write_diagnostics(when, level, options_.node + ": estimate", findings + "; " + in_words(driving_), values,
                         message_);
  if (!wire_.write(diagnostics_writer_, message_.bytes())) ++report_.unsent;
}

void Loop::stop_robot() noexcept {
  if (command_writer_ < 0 || !has_driven_) return;
  try {
    if (!wire_.write(command_writer_, command_message_.stop(now(), options_.frames.vehicle))) ++report_.unsent;
    wire_.flush(command_writer_, std::chrono::milliseconds(200));
  } catch (const std::bad_alloc&) {  // the base stops by its own time-out
    ++report_.unsent;
  }
}

}  // namespace rhec::apps::ros
