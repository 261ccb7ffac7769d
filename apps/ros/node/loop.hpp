#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <exception>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "../messages/command_message.hpp"
#include "../messages/heard_messages.hpp"
#include "../wire/participant.hpp"
#include "intake.hpp"
#include "rhec/core/term/term.hpp"
#include "rhec/plugins/robot/robot.hpp"
#include "rhec/sim/telemetry/track_messages.hpp"

namespace rhec::apps::ros {

/// Whether the robot is moved, and why not.
enum class Driving : std::uint8_t {
  waiting,     ///< for measurements
  heading,     ///< for a heading that is known, which takes motion by somebody else
  no_path,     ///< nobody has said where to go
  stopped,     ///< the stop topic says so
  silent,      ///< no measurement came for too long
  finished,    ///< the end of the path is reached
  estimating,  ///< this node does not steer
  driving
};
const char* in_words(Driving driving) noexcept;

/// Where the loop's thread runs.
struct ThreadOptions {
  int priority = 0;              ///< of SCHED_FIFO; 0: as any other
  std::optional<int> processor;  ///< the only one that it runs on
};

/// What a loop did.
struct LoopReport {
  std::int64_t cycles = 0, driven = 0;
  std::int64_t misses = 0;        ///< commands, or estimates, later than a step after they were due
  std::int64_t unsent = 0;        ///< messages that could not be sent at once
  std::vector<double> latencies;  ///< from the last message to the command or estimate [s], of the last cycles
  std::vector<TopicCount> topics;
  TopicCount other;  ///< paths, obstacles, stops, clocks and transforms
  Estimator::Counts estimator;
  HealthLevel health = HealthLevel::ok;
  std::int64_t degraded = 0, lost = 0;  ///< cycles
  std::optional<logs::GeodeticPoint> origin;
  Driving driving = Driving::waiting;
};

/// The loop of a live node, on a thread of its own: hears, estimates, steers, tells.
class Loop {
 public:
  /// Subscribes and publishes what the options name. All arguments must outlive the loop. Throws Error.
  Loop(Participant& wire, const LiveTopics& topics, Intake& intake, const Robot& robot, const RosOptions& options);
  /// As `stop`.
  ~Loop();
  Loop(const Loop&) = delete;
  Loop& operator=(const Loop&) = delete;

  /// Throws Error if the thread may not run as the options say.
  void start(const ThreadOptions& options);
  /// Stops the robot, then the loop.
  void stop() noexcept;
  /// Throws what ended the loop, if anything did.
  void check() const;

  /// Follows another path from now on.
  void follow(std::unique_ptr<Controller> controller);
  /// A path that has come since the last call.
  std::optional<std::vector<Position>> take_wanted_path();
  /// What has happened since the last call, in words.
  std::vector<std::string> take_events();
  bool is_finished() const noexcept { return is_finished_; }
  /// What slip to expect ahead, once the loop estimates; else null.
  std::shared_ptr<const SlipAhead> slip_ahead() const;
  /// Once the loop has stopped.
  LoopReport report() const;

 private:
  void subscribe(const LiveTopics& topics);
  void publish();
  void run();
  void hear(const Arrival& arrival);
  void hear_special(int which, std::span<const std::byte> message);
  void use(const logs::SignalRow& row, bool triggers, Clock::time_point received);
  void push(const logs::SignalRow& row);
  void begin_if_possible();
  void cycle();
  Driving judge(const Estimate& estimate, Clock::time_point now) const;
  void send_command(const Estimate& estimate, logs::Stamp when, const Controller::Command* command);
  void look_for_rival(const std::vector<PlaceOfFrame>& transforms);
  void tell(const Estimate& estimate, logs::Stamp when, double time, const Controller::Command* command);
  void tell_health(const Estimate& estimate, logs::Stamp when);
  void stop_robot() noexcept;
  void say(std::string text);
  void change_controller();
  logs::Stamp now() const;
  double time_of(logs::Stamp stamp) const { return logs::seconds_between(start_, stamp); }
  Clock::time_point next_look() const;
  void set_due(Clock::time_point begin, bool was_triggered);

  Participant& wire_;
  Intake& intake_;
  const Robot& robot_;
  const RosOptions& options_;
  CommandMessage command_message_;
  sim::TrackMessages track_messages_;
  Clock::duration step_;

  // Readers by index: a topic of measurements (>= 0), or one with a meaning of its own (-1 - its number).
  std::vector<int> meaning_of_reader_;
  std::vector<bool> triggers_;  ///< by topic
  int command_writer_ = -1, diagnostics_writer_ = -1;
  std::array<int, sim::track_topic_count> track_writers_{};

  // The loop's own.
  std::unique_ptr<Estimator> estimator_;
  std::unique_ptr<Controller> controller_;
  std::vector<logs::SignalRow> gathered_;
  std::vector<bool> seen_;  ///< by output, until the estimator is made
  Clock::time_point gathering_since_, due_, last_measured_, last_received_, told_health_;
  logs::Stamp start_ = 0, simulated_now_ = 0;
  bool is_triggered_ = false, is_stopped_by_topic_ = false, has_driven_ = false, rests_ = true;
  std::vector<double> inputs_;              ///< known last
  std::vector<double> input_times_, held_;  ///< when, and a row
  std::vector<Obstacle> obstacles_;
  double obstacles_time_ = 0.0;
  bool has_rival_ = false;    ///< since health was told last, another node has sent this one's transform
  std::string rival_parent_;  ///< from which frame
  Driving driving_ = Driving::waiting;
  HealthLevel told_level_ = HealthLevel::ok;
  LoopReport report_;
  std::size_t latency_place_ = 0;
  logs::CdrWriter message_;

  std::thread thread_;
  std::atomic<bool> is_asked_to_stop_ = false, is_finished_ = false;
  mutable std::mutex mutex_;  ///< of what follows
  std::unique_ptr<Controller> next_controller_, last_controller_;
  std::optional<std::vector<Position>> wanted_path_;
  std::vector<std::string> events_;
  std::exception_ptr failure_;
  std::shared_ptr<const SlipAhead> slip_ahead_;
};

}  // namespace rhec::apps::ros
