#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "command.hpp"
#include "log_arguments.hpp"
#include "rhec/core/control/path.hpp"
#include "rhec/core/estimation/smoother.hpp"
#include "rhec/logs/mapping/drive.hpp"
#include "rhec/logs/signals/log.hpp"
#include "rhec/sim/problems/recording_solver.hpp"
#include "rhec/sim/replay/replay_input.hpp"
#include "rhec/sim/telemetry/track_writer.hpp"

namespace rhec::apps {

/// Files of estimates in the forms of others' tools.
struct TrackArguments {
  std::string mcap, csv, tum;
};
/// `--mcap`, `--csv` and `--tum`.
void add_tracks(Command& command, TrackArguments& arguments);

/// Writes them while a command runs.
class Tracks {
 public:
  Tracks(const TrackArguments& arguments, const Robot& robot, const Path* reference = nullptr);
  bool is_empty() const noexcept { return writers_.empty(); }
  void write(const sim::TrackSample& sample);
  /// Of a sample of a loop or a replay, whose time 0 is `start`.
  void take(const sim::LoopSample& sample, logs::Stamp start);
  void commit();

 private:
  Robot robot_;
  std::vector<std::unique_ptr<sim::TrackWriter>> writers_;
};

/// Opens the log that arguments name.
std::unique_ptr<logs::Log> open_log(const std::string& file, const std::vector<std::string>& msg_paths);
/// `--msg-path`
void add_msg_paths(Command& command, std::vector<std::string>& paths);
/// Says on standard error where a log is damaged.
void tell_damage(const std::optional<logs::Damage>& damage);

/// A drive in a log, by the scenario that arguments name, and what is withheld of it; says where the log is damaged.
/// Throws Error for any mistake.
sim::ReplayInput read_replay_input(const LogArguments& arguments);

/// Whether the arguments name a log of either kind; otherwise says so as of a wrong command line.
bool names_log(const LogArguments& arguments, const char* command);

/// Prints how a smoother's problem was solved.
void print_solve(const std::string& name, const Report& report, int intervals, double seconds, bool has_sigmas,
                 const std::vector<SmoothedRun::Law>& laws);

int estimate_drive(const LogArguments& arguments, const TrackArguments& tracks);
int smooth_drive(const LogArguments& arguments, const TrackArguments& tracks);

}  // namespace rhec::apps
