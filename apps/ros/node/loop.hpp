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
#include "../messages/obstacle_messages.hpp"
#include "../wire/participant.hpp"
#include "intake.hpp"
#include "node_time.hpp"
#include "rhec/core/term/term.hpp"
#include "rhec/plugins/robot/robot.hpp"
#include "rhec/sim/telemetry/track_messages.hpp"

namespace rhec::apps::ros {

/// Whether the robot is moved, and why not.
enum class Driving : std::uint8_t {
  clock,           ///< waits for the time on /clock, or it stands still
  waiting,         ///< for measurements
  heading,         ///< for a heading that is known, which takes motion by somebody else
  no_path,         ///< nobody has said where to go
  stopped,         ///< the stop topic says so
  silent,          ///< no measurement came for too long
  finished,        ///< the end of the path is reached
  estimating,      ///< this node does not steer
  facing_away,     ///< the path leads away behind the vehicle, and it stands
  turning_around,  ///< the same, and it drives a way back to the path
  standing,        ///< where the path goes on: something is in the way, or limits leave no other plan
  going_back,      ///< along the path, since limits keep the vehicle from going on
  driving
};
const char* in_words(Driving driving) noexcept;

/// Where the loop's thread runs.
struct ThreadOptions {
  int priority = 0;              ///< of SCHED_FIFO; 0: as any other
  std::optional<int> processor;  ///< the only one that it runs on
};

/// The way from the last message to the command, or to the estimate where nobody is steered [s].
struct Latency {
  double whole = 0.0;
  double hearing = 0.0;   ///< from the network to the loop, the messages of the set read
  double estimate = 0.0;  ///< of which
  double control = 0.0;   ///< of which
};

/// What a loop did.
struct LoopReport {
  std::int64_t cycles = 0, driven = 0;
  std::int64_t misses = 0;         ///< commands, or estimates, later than a step after they were due
  std::int64_t unsent = 0;         ///< messages that could not be sent at once
  std::int64_t jumps = 0;          ///< times that the time of /clock has jumped back: estimates begin anew
  std::vector<Latency> latencies;  ///< of the last cycles
  std::vector<TopicCount> topics;
  TopicCount other;                                        ///< paths, obstacles, stops, clocks and transforms
  std::size_t obstacles_seen = 0, obstacles_regarded = 0;  ///< of the last message, and what the terms have room for
  Estimator::Counts estimator;                             ///< since estimates have begun last
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
  /// How often the time has jumped back: who follows a path has to say so again.
  std::int64_t jumps() const noexcept { return jumps_; }
  /// What slip to expect ahead, once the loop estimates; else null.
  std::shared_ptr<const SlipAhead> slip_ahead() const;
  /// Once the loop has stopped.
  LoopReport report() const;

 private:
  void subscribe(const LiveTopics& topics);
  void publish();
  void run();
  void hear(const Arrival& arrival);
  void hear_special(int which, const Arrival& arrival);
  void hear_clock(logs::Stamp clock, Clock::time_point received);
  void hear_obstacles(SeenObstacles seen);
  void regard_obstacles();
  void begin_anew(double back);
  void watch_clock();
  void use(const logs::SignalRow& row, bool triggers, Clock::time_point received);
  void push(const logs::SignalRow& row);
  void forget_inputs_and_outputs();
  void note_place(const Estimate& estimate);
  void begin_if_possible();
  void cycle();
  Driving judge(const Estimate& estimate, Clock::time_point now) const;
  void send_command(const Estimate& estimate, logs::Stamp when, const Controller::Command* command);
  void note_rival_command();
  void look_for_rival(const std::vector<PlaceOfFrame>& transforms);
  void tell(const Estimate& estimate, logs::Stamp when, double time, const Controller::Command* command);
  void tell_health(const Estimate& estimate, logs::Stamp when);
  void tell_waiting();
  void stop_robot() noexcept;
  void say(std::string text);
  void change_controller();
  double time_of(logs::Stamp stamp) const { return logs::seconds_between(start_, stamp); }
  Clock::time_point next_look() const;
  Clock::time_point wait_until() const;
  Clock::time_point expected() const;
  bool may_rehearse() const;
  bool stays_awake() const;
  void rehearse();
  void set_due(Clock::time_point begin, bool was_triggered);

  static constexpr auto between_diagnostics = std::chrono::seconds(1);

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
  NodeTime time_;
  Clock::time_point gathering_since_, due_, last_measured_, last_received_;  ///< as `time_` has them
  Clock::time_point last_arrival_, told_health_;                             ///< on the computer's clock
  Clock::time_point rehearsed_;                                              ///< for the step that was due then
  Clock::duration rehearsal_{};                                              ///< how long one takes
  int long_rehearsals_ = 0;                                                  ///< in a row
  bool has_other_processor_;
  logs::Stamp start_ = 0;
  bool has_told_standstill_ = false, has_told_waiting_ = false;
  bool is_triggered_ = false, is_stopped_by_topic_ = false, has_driven_ = false, rests_ = true;
  std::vector<double> inputs_;              ///< known last
  std::vector<double> input_times_, held_;  ///< when, and a row
  std::vector<Obstacle> obstacles_;
  logs::Stamp obstacles_stamp_ = 0;
  bool has_told_crowd_ = false;
  double last_x_ = 0.0, last_y_ = 0.0;  ///< where the vehicle was estimated last [m]
  bool has_rival_command_ = false;      ///< the same of a command, while this node steers
  bool has_told_rival_command_ = false;
  bool has_rival_ = false;    ///< since health was told last, another node has sent this one's transform
  std::string rival_parent_;  ///< from which frame
  Driving driving_ = Driving::waiting;
  HealthLevel told_level_ = HealthLevel::ok;
  LoopReport report_;
  std::size_t latency_place_ = 0;
  logs::CdrWriter message_;

  std::thread thread_;
  std::atomic<bool> is_asked_to_stop_ = false, is_finished_ = false;
  std::atomic<std::int64_t> jumps_ = 0;
  mutable std::mutex mutex_;  ///< of what follows
  std::unique_ptr<Controller> next_controller_, last_controller_;
  std::optional<std::vector<Position>> wanted_path_;
  std::vector<std::string> events_;
  std::exception_ptr failure_;
  std::shared_ptr<const SlipAhead> slip_ahead_;
};

}  // namespace rhec::apps::ros
