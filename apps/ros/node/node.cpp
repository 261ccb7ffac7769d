// `rhec ros`: what supervises the loop of a live node.
#include <fmt/format.h>

#include <chrono>
#include <cstdio>
#include <memory>
#include <thread>
#include <utility>

#include "../../commands.hpp"
#include "../../stop_request.hpp"
#include "../live.hpp"
#include "../wire/wire_options.hpp"
#include "lever_arms.hpp"
#include "loop.hpp"
#include "rhec/core/base/error.hpp"
#include "rhec/plugins/robot/scenario_file.hpp"
#include "rhec/sim/files/json.hpp"
#include "rhec/sim/loop/scenario.hpp"
#include "rhec/sim/maps/map_keeper.hpp"
#include "rhec/sim/numbers/spread.hpp"
#include "rhec/sim/replay/replay_scenario.hpp"
#include "rhec/sim/world/paths.hpp"

namespace rhec::apps::ros {
namespace {

constexpr auto between_looks = std::chrono::milliseconds(20);

double seconds_since(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

/// The path that is known before the first one comes as a message; none: there is none.
std::unique_ptr<const Path> known_path(const Host& host, const Settings& settings, const LiveArguments& arguments,
                                       const RosOptions& options) {
  if (!arguments.path.empty())
    return std::make_unique<const Path>(sim::load_waypoints(arguments.path, {.speed = options.path_speed}));
  if (settings.find("path")) return std::make_unique<const Path>(sim::Scenario(host, settings).path());
  return nullptr;
}

void print_topics(const LiveTopics& topics, const Intake& intake, const RosOptions& options, const WireOptions& wire,
                  std::FILE* out) {
  fmt::print(out, "node {} in domain {} on {}\n", wire.node, wire.domain, wire.interface);
  for (std::size_t i = 0; i < topics.topics().size(); ++i)
    if (intake.is_wanted(static_cast<int>(i)))
      fmt::print(out, "  hears  {} ({})\n", topics.topics()[i].name, topics.topics()[i].type);
  if (options.command.steer)
    fmt::print(out, "  steers {} ({}); stopped by {}\n", options.names.command,
               CommandMessage::type_of(options.command.form),
               options.names.stop.empty() ? "nobody" : options.names.stop);
  else
    fmt::print(out, "  does not steer; ros.command.steer: true lets it\n");
  std::fflush(out);
}

/// Of one part of all latencies [ms].
sim::Spread spread_of_part(const LoopReport& report, double Latency::*part) {
  std::vector<double> values;
  values.reserve(report.latencies.size());
  for (const Latency& latency : report.latencies) values.push_back(1e3 * latency.*part);
  return sim::spread_of(values);
}

void print_report(const LoopReport& report) {
  fmt::print("\n{:<28} {:>8} {:>8}   {}\n", "TOPIC", "USED", "REFUSED", "WHY");
  const auto print = [](const TopicCount& count) {
    if (count.used == 0 && count.refusals() == 0) return;
    std::string why;
    for (std::size_t i = 0; i < refusal_count; ++i)
      if (count.refused[i] > 0)
        why += fmt::format("{}{} {}", why.empty() ? "" : ", ", count.refused[i], name_of(static_cast<Refusal>(i)));
    if (!count.last.empty()) why += "; last: " + count.last;
    fmt::print("{:<28} {:>8} {:>8}   {}\n", count.topic, count.used, count.refusals(), why);
  };
  for (const TopicCount& count : report.topics) print(count);
  print(report.other);
  if (report.origin)
    fmt::print("local plane: origin {:.8f}, {:.8f} degrees, {:.3f} m\n", report.origin->latitude,
               report.origin->longitude, report.origin->height);
  fmt::print("{} steps, {} of them steered; {} deadlines missed; {} messages not sent\n", report.cycles, report.driven,
             report.misses, report.unsent);
  if (report.jumps > 0) fmt::print("the time jumped back {} times: estimates began anew\n", report.jumps);
  fmt::print("health: degraded in {} steps, lost in {}; {} measurements rejected, {} of {} estimates fell back\n",
             report.degraded, report.lost, report.estimator.rejected, report.estimator.fallbacks,
             report.estimator.estimates);
  if (report.latencies.empty()) return;
  const sim::Spread latency = spread_of_part(report, &Latency::whole);
  fmt::print(
      "latency from the last measurement to the {} [ms]: median {:.3f}, p99 {:.3f}, max {:.3f}\n"
      "medians of its parts: {:.3f} until the loop has it, {:.3f} for the estimate, {:.3f} for the command\n",
      report.driven > 0 ? "command" : "estimate", latency.median, latency.p99, latency.max,
      spread_of_part(report, &Latency::hearing).median, spread_of_part(report, &Latency::estimate).median,
      spread_of_part(report, &Latency::control).median);
}

sim::Json json_of(const TopicCount& count) {
  sim::Json refused = sim::Json::object();
  for (std::size_t i = 0; i < refusal_count; ++i)
    if (count.refused[i] > 0) refused[name_of(static_cast<Refusal>(i))] = count.refused[i];
  return {{"topic", count.topic}, {"used", count.used}, {"refused", refused}};
}

void print_json_report(const LoopReport& report) {
  sim::Json json;
  json["topics"] = sim::Json::array();
  for (const TopicCount& count : report.topics) json["topics"].push_back(json_of(count));
  json["other"] = json_of(report.other);
  if (report.origin)
    json["origin"] = {{"latitude", report.origin->latitude},
                      {"longitude", report.origin->longitude},
                      {"height", report.origin->height}};
  json["steps"] = report.cycles;
  json["steered"] = report.driven;
  json["missed_deadlines"] = report.misses;
  json["not_sent"] = report.unsent;
  json["jumps_of_time"] = report.jumps;
  json["degraded"] = report.degraded;
  json["lost"] = report.lost;
  json["rejected"] = report.estimator.rejected;
  json["estimates"] = report.estimator.estimates;
  json["fallbacks"] = report.estimator.fallbacks;
  if (!report.latencies.empty()) {
    const auto json_of_part = [&](double Latency::*part) -> sim::Json {
      const sim::Spread spread = spread_of_part(report, part);
      return {{"median", spread.median}, {"p99", spread.p99}, {"max", spread.max}};
    };
    json["latency_ms"] = json_of_part(&Latency::whole);
    json["hearing_ms"] = json_of_part(&Latency::hearing);
    json["estimate_ms"] = json_of_part(&Latency::estimate);
    json["control_ms"] = json_of_part(&Latency::control);
  }
  fmt::print("{}\n", json.dump(2));
}

/// The path that is followed: handed to the loop with a controller, as often as that has to begin anew.
class Pursuit {
 public:
  Pursuit(const Robot& robot, const RosOptions& options, Loop& loop, std::unique_ptr<const Path> path)
      : robot_(robot), options_(options), loop_(loop), path_(std::move(path)) {
    if (path_ && !robot_.memory().is_given()) hand_over();
  }

  /// A controller that looks ahead on a map needs the estimator that keeps it; and when the time has jumped back,
  /// another one.
  void look() {
    if (const std::int64_t jumps = loop_.jumps(); jumps != jumps_) {
      jumps_ = jumps;
      is_handed_over_ = false;
    }
    if (path_ && !is_handed_over_ && (!robot_.memory().is_given() || loop_.slip_ahead())) hand_over();
  }

  /// Follows a path that has come; one that cannot be followed is told.
  void change(const std::vector<Position>& places, double time, std::FILE* out) {
    std::vector<Waypoint> waypoints;
    waypoints.reserve(places.size());
    for (const Position& place : places) waypoints.push_back({place.x, place.y, options_.path_speed});
    try {
      auto path = std::make_unique<const Path>(waypoints);
      loop_.follow(robot_.make_controller(*path, loop_.slip_ahead()));
      path_ = std::move(path);
      is_handed_over_ = true;
      fmt::print(out, "{:8.2f} s  a path of {:.1f} m has come\n", time, path_->length());
    } catch (const Error& mistake) {
      fmt::print(out, "{:8.2f} s  a path was refused: {}\n", time, mistake.what());
    }
  }

 private:
  void hand_over() {
    loop_.follow(robot_.make_controller(*path_, loop_.slip_ahead()));
    is_handed_over_ = true;
  }

  const Robot& robot_;
  const RosOptions& options_;
  Loop& loop_;
  std::unique_ptr<const Path> path_;
  bool is_handed_over_ = false;
  std::int64_t jumps_ = 0;
};

}  // namespace

int run_node(const Host& host, Settings settings, const LiveArguments& arguments) {
  refuse_what_is_no_scenario(settings);
  const RosOptions options =
      read_ros_options(settings.find("ros") ? *settings.find("ros") : Settings::map(settings.origin()));
  const WireOptions wire_setup = wire_options(options, arguments);
  Participant wire(wire_setup);
  const StopRequest stop_request;
  set_lever_arms(wire, options, settings);
  const auto replay_options = sim::ReplayOptions::table().parse(settings, "the file");
  Robot robot(host, replay_options);
  robot.make_estimator();  // tells mistakes before anything runs
  const auto keeper = std::make_shared<sim::MapKeeper>();
  robot.add_hooks(keeper);
  const LiveTopics topics(replay_options.signals, options.types,
                          {arguments.msg_paths.begin(), arguments.msg_paths.end()});
  Intake intake(topics, logs::SignalMap(replay_options.signals, robot.model()->description()),
                robot.bounded_description(), options.checks);
  std::unique_ptr<const Path> path = options.command.steer ? known_path(host, settings, arguments, options) : nullptr;
  if (path) robot.make_controller(*path);  // likewise
  Loop loop(wire, topics, intake, robot, options);
  std::FILE* const out = arguments.json ? stderr : stdout;
  print_topics(topics, intake, options, wire_setup, out);
  loop.start({arguments.priority, arguments.cpu >= 0 ? std::optional(arguments.cpu) : std::nullopt});
  Pursuit pursuit(robot, options, loop, std::move(path));
  const auto begin = Clock::now();
  while (!StopRequest::asked() && !(arguments.once && loop.is_finished()) &&
         (arguments.seconds <= 0.0 || seconds_since(begin) < arguments.seconds)) {
    std::this_thread::sleep_for(between_looks);
    loop.check();
    pursuit.look();
    if (const auto places = loop.take_wanted_path()) pursuit.change(*places, seconds_since(begin), out);
    for (const std::string& event : loop.take_events()) fmt::print(out, "{:8.2f} s  {}\n", seconds_since(begin), event);
    std::fflush(out);
  }
  loop.stop();
  loop.check();
  const LoopReport report = loop.report();
  if (arguments.json)
    print_json_report(report);
  else
    print_report(report);
  keeper->save();
  return arguments.once && !loop.is_finished() ? exit_not_solved : exit_fine;
}

}  // namespace rhec::apps::ros
