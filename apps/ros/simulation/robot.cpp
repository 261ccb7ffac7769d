// `rhec ros --simulate`: a simulated robot, which publishes its sensors and obeys commands, in real time.
#include <fmt/format.h>

#include <chrono>
#include <cmath>
#include <cstdio>
#include <memory>
#include <thread>

#include "../../commands.hpp"
#include "../../stop_request.hpp"
#include "../live.hpp"
#include "../messages/command_message.hpp"
#include "../messages/type_hash.hpp"
#include "../node/live_topics.hpp"
#include "../wire/wire_options.hpp"
#include "rhec/core/base/error.hpp"
#include "rhec/sim/files/json.hpp"
#include "rhec/sim/loop/loop_world.hpp"
#include "rhec/sim/numbers/spread.hpp"
#include "rhec/sim/telemetry/robot_messages.hpp"
#include "sensor_messages.hpp"

namespace rhec::apps::ros {
namespace {

// A base that hears no command for so long stops by itself, as real ones do [s].
constexpr double patience = 0.5;
// At rest for so long at the end of its path, the robot has arrived [s]. Who steers it stops it where it takes it to be
// at the end, which may be that much before [m].
constexpr double longest_rest = 1.0, near_end = 0.5;

double seconds(Clock::duration duration) { return std::chrono::duration<double>(duration).count(); }

/// The world, on the clock of this computer.
class SimulatedRobot {
 public:
  SimulatedRobot(const sim::Scenario& scenario, const RosOptions& options, const WireOptions& wire,
                 const std::vector<std::string>& msg_paths)
      : scenario_(scenario),
        options_(options),
        model_(*scenario.robot().model()),
        world_(scenario, sim::noise_of(scenario.robot())),
        follower_(scenario.path()),
        topics_(scenario.options().signals, options.types, {msg_paths.begin(), msg_paths.end()}),
        sensors_(topics_, logs::SignalMap(scenario.options().signals, model_.description()), options.frames.vehicle),
        commands_(scenario.robot().model(), options.command, scenario.robot().step()),
        wire_(wire),
        inputs_(static_cast<std::size_t>(model_.input_count())) {
    for (int i = 0; i < static_cast<int>(topics_.topics().size()); ++i) {
      const logs::Topic& topic = topics_.topics()[static_cast<std::size_t>(i)];
      writers_.push_back(
          sensors_.is_made(i) ? wire_.add_writer({topic.name, topic.type, topics_.hash(i)}, Delivery::sure) : -1);
    }
    const auto add = [](const std::string& name, const char* type) {
      return WireTopic{name, type, type_hash(type, logs::builtin_definitions())};
    };
    wire_.add_reader(add(options.names.command, commands_.type()), Delivery::latest, 1);
    if (!options.names.truth.empty())
      truth_writer_ = wire_.add_writer(add(options.names.truth, "nav_msgs/msg/Odometry"), Delivery::sure);
    wire_.announce();
    place_on_path();
  }

  /// Until the end of the path, a request, or so long [s]; 0: without a limit.
  void run(double limit) {
    begin_ = Clock::now();
    stamp_at_begin_ =
        std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::system_clock::now().time_since_epoch())
            .count();
    const auto step = std::chrono::duration<double>(scenario_.robot().step());
    for (std::int64_t k = 0; !is_over(limit); ++k) {
      const auto due = begin_ + std::chrono::duration_cast<Clock::duration>(step * static_cast<double>(k));
      while (Clock::now() < due)
        if (wire_.wait(due)) obey();
      drive_to(seconds(due - begin_));
      sense();
    }
  }

  bool has_arrived() const noexcept {
    return follower_.finished() || follower_.arc_length() >= scenario_.path().length() - near_end;
  }

  void print_json() const {
    sim::Json json{{"seconds", time_},
                   {"commands", heard_},
                   {"refused", refused_},
                   {"driven_m", std::min(follower_.arc_length(), scenario_.path().length())},
                   {"path_m", scenario_.path().length()},
                   {"has_arrived", has_arrived()}};
    const auto add = [&](const char* name, const std::vector<double>& values, double factor) {
      if (values.empty()) return;
      const sim::Spread spread = sim::spread_of(values);
      json[name] = {{"median", factor * spread.median}, {"p99", factor * spread.p99}, {"max", factor * spread.max}};
    };
    add("distance_m", distances_, 1.0);
    add("answer_ms", answers_, 1e3);
    fmt::print("{}\n", json.dump(2));
  }

  void print() const {
    fmt::print("{:.1f} s, {} commands heard, {} refused; {:.1f} of {:.1f} m driven\n", time_, heard_, refused_,
               std::min(follower_.arc_length(), scenario_.path().length()), scenario_.path().length());
    if (!distances_.empty()) {
      const sim::Spread distance = sim::spread_of(distances_);
      fmt::print("distance from the path [m]: median {:.3f}, p99 {:.3f}, max {:.3f}\n", distance.median, distance.p99,
                 distance.max);
    }
    if (!answers_.empty()) {
      const sim::Spread answer = sim::spread_of(answers_);
      fmt::print("from a measurement to the command that answers it [ms]: median {:.3f}, p99 {:.3f}, max {:.3f}\n",
                 1e3 * answer.median, 1e3 * answer.p99, 1e3 * answer.max);
    }
    fmt::print("{}\n", has_arrived() ? "the end of the path was reached" : "the end of the path was not reached");
  }

 private:
  bool is_over(double limit) {
    if (StopRequest::asked() || (limit > 0.0 && time_ >= limit)) return true;
    const bool rests = std::ranges::all_of(inputs_, [](double input) { return input == 0.0; });
    rest_since_ = has_arrived() && rests ? std::min(rest_since_, time_) : infinity;
    return time_ - rest_since_ >= longest_rest;
  }

  logs::Stamp stamp() const { return stamp_at_begin_ + sim::stamp_at(time_); }

  void place_on_path() {
    const Roles& roles = model_.description().roles;
    const Eigen::VectorXd& state = world_.truth().state();
    follower_.locate(state[roles.position_x], state[roles.position_y],
                     roles.heading >= 0 ? state[roles.heading] : std::numeric_limits<double>::quiet_NaN());
  }

  void drive_to(double time) {
    if (time - last_heard_ > patience && has_heard_) std::ranges::fill(inputs_, 0.0);
    if (time <= time_) return;
    world_.drive(inputs_, time_, time - time_);
    time_ = time;
  }

  void obey() {
    wire_.take([this](const Arrival& arrival) {
      const double time = seconds(arrival.received - begin_);
      drive_to(time);
      try {
        commands_.read(arrival.cdr, world_.truth().state().data(), inputs_.data());
      } catch (const logs::RecordError&) {
        ++refused_;  // a base that is given nonsense goes on, until its patience ends
        return;
      }
      ++heard_;
      last_heard_ = time;
      has_heard_ = true;
      if (is_unanswered_) answers_.push_back(seconds(arrival.received - sensed_));
      is_unanswered_ = false;
      tell_inputs();
    });
  }

  void tell_inputs() {
    const std::vector<double>& measured = world_.measured_inputs(inputs_);
    sensors_.write(false, stamp(), measured.data(), [this](int topic, std::span<const std::byte> message) {
      wire_.write(writers_[static_cast<std::size_t>(topic)], message);
    });
  }

  void sense() {
    tell_inputs();
    world_.measure(time_);
    world_.deliver(time_, [this](double time, const double* outputs) {
      if (!std::isfinite(time)) return;  // a fault has spoilt the stamp: a message cannot say so
      sensors_.write(true, stamp_at_begin_ + sim::stamp_at(time), outputs,
                     [this](int topic, std::span<const std::byte> message) {
                       wire_.write(writers_[static_cast<std::size_t>(topic)], message);
                     });
    });
    sensed_ = Clock::now();
    is_unanswered_ = true;
    const Roles& roles = model_.description().roles;
    const Eigen::VectorXd& state = world_.truth().state();
    follower_.advance(state[roles.position_x], state[roles.position_y]);
    if (has_heard_ && !has_arrived()) distances_.push_back(std::abs(follower_.lateral()));
    if (truth_writer_ < 0) return;
    truth_.clear();
    sim::write_odometry(
        stamp(), {options_.frames.fixed, options_.frames.vehicle},
        {state[roles.position_x], state[roles.position_y], roles.heading >= 0 ? state[roles.heading] : 0.0},
        Eigen::Matrix3d::Zero(), 0.0, 0.0, truth_);
    wire_.write(truth_writer_, truth_.bytes());
  }

  const sim::Scenario& scenario_;
  const RosOptions& options_;
  const Model& model_;
  sim::LoopWorld world_;
  PathFollower follower_;
  LiveTopics topics_;
  SensorMessages sensors_;
  CommandMessage commands_;
  Participant wire_;
  std::vector<int> writers_;  ///< by topic
  int truth_writer_ = -1;
  logs::CdrWriter truth_;

  Clock::time_point begin_, sensed_;
  logs::Stamp stamp_at_begin_ = 0;
  double time_ = 0.0, last_heard_ = 0.0, rest_since_ = infinity;  ///< [s]
  bool has_heard_ = false, is_unanswered_ = false;
  std::vector<double> inputs_;
  std::int64_t heard_ = 0, refused_ = 0;
  std::vector<double> distances_, answers_;  ///< [m], [s]
};

}  // namespace

int run_robot(const Host& host, Settings settings, const LiveArguments& arguments) {
  const RosOptions options =
      read_ros_options(settings.find("ros") ? *settings.find("ros") : Settings::map(settings.origin()));
  if (!settings.find("path"))
    throw settings.error("a simulated robot needs a world; expected the keys of a scenario, above all `path`");
  const sim::Scenario scenario(host, settings);
  WireOptions wire = wire_options(options, arguments);
  wire.node = options.node + "_robot";
  const StopRequest stop_request;
  SimulatedRobot robot(scenario, options, wire, arguments.msg_paths);
  std::FILE* const out = arguments.json ? stderr : stdout;
  fmt::print(out, "a simulated {} in domain {} on {}; obeys {}\n", scenario.robot().model()->description().name,
             wire.domain, wire.interface, options.names.command);
  std::fflush(out);
  robot.run(arguments.seconds);
  if (arguments.json)
    robot.print_json();
  else
    robot.print();
  return robot.has_arrived() ? exit_fine : exit_not_solved;
}

}  // namespace rhec::apps::ros
