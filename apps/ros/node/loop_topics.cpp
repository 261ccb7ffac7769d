// What the loop subscribes to and publishes, beside measurements and commands.
#include <fmt/format.h>

#include <optional>
#include <utility>

#include "../messages/type_hash.hpp"
#include "loop.hpp"
#include "rhec/core/base/error.hpp"

namespace rhec::apps::ros {
namespace {

/// Topics that are heard and are no measurements.
enum class Other : int { path, obstacles, stop, clock, transforms, commands };

WireTopic topic_of(const std::string& name, const std::string& type) {
  return {name, type, type_hash(type, logs::builtin_definitions())};
}

}  // namespace

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
    hear(Other::obstacles, options_.names.obstacles, type_of(options_.obstacles.form), Delivery::latest);
    // A stop is heard from everybody, reliable or not.
    hear(Other::stop, options_.names.stop, "std_msgs/msg/Bool", Delivery::latest);
    hear(Other::commands, options_.names.command, command_message_.type(), Delivery::latest);
  }
  if (options_.frames.publish)
    hear(Other::transforms, options_.names.transforms, "tf2_msgs/msg/TFMessage", Delivery::latest);
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

void Loop::hear_special(int which, const Arrival& arrival) {
  const std::span<const std::byte> message = arrival.cdr;
  TopicCount& count = report_.other;
  const auto refuse = [&](Refusal refusal, std::string text) {
    ++count.refused[static_cast<std::size_t>(refusal)];
    count.last = std::move(text);
  };
  const auto has_frame = [&](const MessageHeader& header) {
    if (header.frame == options_.frames.fixed) return true;
    refuse(Refusal::frame,
           fmt::format("its frame is {}, expected '{}'", logs::in_quotes(header.frame), options_.frames.fixed));
    return false;
  };
  const auto is_of_now = [&](const MessageHeader& header) {
    const std::optional<std::string> mistake = stamp_mistake(header.stamp, time_.now(), options_.checks);
    if (mistake) refuse(Refusal::stamp, *mistake);
    return !mistake;
  };
  if (message.empty()) return refuse(Refusal::too_large, "it was too large");
  try {
    switch (static_cast<Other>(which)) {
      case Other::path: {
        Positions path = read_path(message);
        if (!has_frame(path.header)) return;
        const std::lock_guard lock(mutex_);
        wanted_path_ = std::move(path.places);
        break;
      }
      case Other::obstacles: {
        if (!time_.is_known()) return;
        const auto read = options_.obstacles.form == ObstacleForm::poses ? read_obstacle_poses : read_obstacle_array;
        SeenObstacles seen = read(message, options_.obstacles.radius);
        if (!has_frame(seen.header) || !is_of_now(seen.header)) return;
        hear_obstacles(std::move(seen));
        break;
      }
      case Other::stop:
        is_stopped_by_topic_ = read_flag(message);
        break;
      case Other::clock:
        hear_clock(read_clock(message), arrival.received);
        break;
      case Other::transforms:
        look_for_rival(read_transforms(message));
        return;  // others' business, and much of it
      case Other::commands:
        note_rival_command();
        return;
    }
    ++count.used;
  } catch (const logs::RecordError& error) {
    refuse(Refusal::broken, error.what());
  }
}

/// A frame has one parent, and a transform one owner (REP 105).
void Loop::look_for_rival(const std::vector<PlaceOfFrame>& transforms) {
  for (const PlaceOfFrame& transform : transforms) {
    if (transform.child != options_.frames.vehicle) continue;
    if (rival_parent_ != transform.parent)
      say(
          fmt::format("another node sends the transform from {} to {}, too; one of both must not: ros.frames.publish: "
                      "false",
                      logs::in_quotes(transform.parent), options_.frames.vehicle));
    rival_parent_ = transform.parent;
    has_rival_ = true;
  }
}

/// Before this node's first command somebody else may drive the vehicle on the same topic.
void Loop::note_rival_command() {
  if (!has_driven_) return;
  if (!has_told_rival_command_)
    say(
        fmt::format("another node commands on {}, too, and the robot does what came last; one of both must not: "
                    "ros.command.steer: false",
                    options_.names.command));
  has_told_rival_command_ = has_rival_command_ = true;
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
    say(estimator_->watch() ? estimator_->watch()->in_words(estimate.health) : rhec::name_of(estimate.health.level));
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
  if (!options_.names.obstacles.empty() && options_.command.steer)
    values.push_back(
        {"obstacles", fmt::format("{} seen, {} regarded", report_.obstacles_seen, report_.obstacles_regarded)});
  if (time_.is_simulated()) values.push_back({"jumps of the time", std::to_string(jumps_)});
  const std::string findings = estimate.health.level != HealthLevel::ok && estimator_->watch()
                                   ? estimator_->watch()->in_words(estimate.health)
                                   : rhec::name_of(estimate.health.level);
  const bool has_rival = std::exchange(has_rival_, false);
  if (has_rival) values.push_back({"transform", "sent by another node, too, from " + rival_parent_});
  const bool has_rival_command = std::exchange(has_rival_command_, false);
  if (has_rival_command) values.push_back({"commands", "sent by another node, too"});
  const bool is_error =
      estimate.health.level == HealthLevel::lost || driving_ == Driving::silent || has_rival || has_rival_command;
  const std::uint8_t level = is_error ? 2 : estimate.health.level == HealthLevel::degraded ? 1 : 0;
  message_.clear();
  sim::write_diagnostics(when, level, options_.node + ": estimate", findings + "; " + in_words(driving_), values,
                         message_);
  if (!wire_.write(diagnostics_writer_, message_.bytes())) ++report_.unsent;
}

/// Before there is an estimate, too, a node says why.
void Loop::tell_waiting() {
  const Clock::time_point computer = Clock::now();
  if (computer - told_health_ < between_diagnostics) return;
  told_health_ = computer;
  const Driving driving = time_.is_known() && !has_told_standstill_ ? Driving::waiting : Driving::clock;
  if (std::exchange(driving_, driving) != driving || !has_told_waiting_) say(in_words(driving));
  has_told_waiting_ = true;
  if (diagnostics_writer_ < 0) return;
  constexpr std::uint8_t warning = 1;
  message_.clear();
  sim::write_diagnostics(time_.now(), warning, options_.node + ": estimate", in_words(driving), {}, message_);
  if (!wire_.write(diagnostics_writer_, message_.bytes())) ++report_.unsent;
}

}  // namespace rhec::apps::ros
