#include <fmt/format.h>

#include <filesystem>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "commands.hpp"
#include "drive_arguments.hpp"
#include "dump.hpp"
#include "integration_note.hpp"
#include "log_arguments.hpp"
#include "output.hpp"
#include "progress.hpp"
#include "rhec/core/base/error.hpp"
#include "rhec/sim/files/output_folder.hpp"
#include "rhec/sim/horizons/horizon_log.hpp"
#include "rhec/sim/logs/recorded_log.hpp"
#include "rhec/sim/maps/map_keeper.hpp"

namespace rhec::apps {
namespace {

struct EstimateArguments : LogArguments {
  DumpArguments dump;
  TrackArguments tracks;
};

void print_table(const sim::RecordedLog& log, const Robot& robot, const std::vector<sim::Replay>& replays,
                 const sim::HoldOut& hold_out, const std::filesystem::path& folder) {
  const double seconds = log.rows.back().time - log.rows.front().time;
  fmt::print("{} rows of dead reckoning, {} fixes, {:.1f} min\n", log.rows.size(), log.fixes.size(), seconds / 60.0);
  if (log.missing_speeds + log.missing_steerings + log.missing_coordinates > 0)
    fmt::print("masked, since missing: {} speeds, {} steering angles, {} coordinates of fixes\n", log.missing_speeds,
               log.missing_steerings, log.missing_coordinates);
  fmt::print("\n");
  if (hold_out.every > 0)
    fmt::print("{:<16} {:>8} {:>8} {:>9}   {:>10} {:>8} {:>9}   {:>8} {:>9} {:>8}\n", "VARIANT", "WITHHELD", "MEDIAN",
               "RMSE(5 m)", "CONSISTENT", "MEDIAN", "RMSE(5 m)", "NODES", "FALLBACKS", "TIME");
  else
    fmt::print("{:<16} {:>8} {:>9} {:>8}\n", "VARIANT", "NODES", "FALLBACKS", "TIME");
  for (std::size_t i = 0; i < replays.size(); ++i) {
    const sim::HeldOutSummary summary = sim::summarise(replays[i], log);
    fmt::print("{:<16} ", replays[i].name);
    if (hold_out.every > 0)
      fmt::print("{:>8} {:>6.4f} m {:>7.4f} m   {:>10} {:>6.4f} m {:>7.4f} m   ", summary.all.count, summary.all.median,
                 summary.all.rmse_capped, summary.consistent.count, summary.consistent.median,
                 summary.consistent.rmse_capped);
    fmt::print("{:>8} {:>9} {:>6.2f} s\n", replays[i].counts.nodes, replays[i].counts.fallbacks, replays[i].seconds);
  }
  for (const sim::Replay& replay : replays) print_integration(replay.counts, robot, replay.name + ": ");
  fmt::print("\npictures and numbers: {}\n", folder.string());
}

/// Variants replay the same drive: what one has found is no earlier visit for another.
void refuse_shared_maps(const sim::LogScenario& scenario) {
  std::set<std::string> files;
  for (const sim::LogVariant& variant : scenario.variants()) {
    const MemorySection& memory = variant.robot.memory();
    if (memory.is_given() && !memory.options().file.empty() && !files.insert(memory.options().file).second)
      throw memory.section().error(fmt::format(
          "the variant '{}' names the map '{}' of another variant; expected a file of its own, or '--variant'",
          variant.name, memory.options().file));
  }
}

int estimate_log(const EstimateArguments& arguments) {
  const LogInput input(arguments);
  const auto& [scenario, hold_out, log] = input;
  sim::OutputFolder folder(out_of(arguments.out, arguments.scenario, "_estimate"));
  Dump dump(arguments.dump, {"rhe"});
  std::vector<sim::Replay> replays;
  std::vector<sim::HorizonLog> horizons;
  tell_notes(scenario.variants().front().robot.notes());
  refuse_shared_maps(scenario);
  std::vector<std::shared_ptr<sim::MapKeeper>> keepers;
  // Limits the number of nodes: one per fix, and one per step between fixes.
  const double seconds = log.rows.back().time - log.rows.front().time;
  bool all_usable = true;
  Tracks tracks(arguments.tracks, scenario.variants().front().robot);
  for (const sim::LogVariant& variant : scenario.variants()) {
    const bool is_first = replays.empty();
    ProgressBar bar(variant.name);
    const std::string run =
        variant.name == scenario.name() ? variant.name : fmt::format("{}/{}", scenario.name(), variant.name);
    const auto nodes = static_cast<std::int64_t>(seconds / variant.robot.step()) + std::ssize(log.fixes);
    horizons.emplace_back(variant.robot, nodes, sim::most_windows_of_log / std::ssize(scenario.variants()));
    const auto keeper = std::make_shared<sim::MapKeeper>();
    replays.push_back(sim::replay(variant.robot, log, scenario.log(), hold_out,
                                  {.progress = [&](double share) { bar.show(share); },
                                   .solved = dump.watch(run, variant.robot),
                                   .sampled =
                                       [&](const sim::LoopSample& sample) {
                                         horizons.back().take(sample);
                                         if (is_first) tracks.take(sample, 0);
                                       },
                                   .robot = keeper}));
    keepers.push_back(keeper);
    replays.back().name = variant.name;
    all_usable = all_usable && replays.back().counts.fallbacks == 0;
  }
  folder.write("estimates.csv", sim::estimates_csv(replays, log, scenario));
  const std::string summary = sim::summary_json(replays, log, scenario, hold_out);
  folder.write("summary.json", summary);
  folder.write("times.csv", sim::times_csv(replays));
  folder.write("horizons.jsonl", sim::horizons_text(horizons, log, scenario, hold_out));
  folder.write("run.svg", sim::replay_svg(replays.front(), log, scenario));
  for (const auto& keeper : keepers) keeper->save();
  folder.commit();
  dump.commit();
  tracks.commit();
  if (arguments.json) {
    print_json(summary, folder.path());
  } else {
    print_table(log, scenario.variants().front().robot, replays, hold_out, folder.path());
    dump.tell(arguments.plugin_path);
  }
  return all_usable ? exit_fine : exit_not_solved;
}

int estimate(const EstimateArguments& arguments) {
  if (!names_log(arguments, "estimate")) return exit_usage;
  if (arguments.log.empty()) return estimate_log(arguments);
  if (arguments.dump.folder) throw Error("--dump: is for --dead-reckoning and --gps; leave it out");
  return estimate_drive(arguments, arguments.tracks);
}

}  // namespace

void add_estimate(Program& program) {
  auto arguments = std::make_shared<EstimateArguments>();
  Command command = program.add(
      "estimate", "Estimates state and slip from a recorded drive, and predicts what it withholds.",
      "A LOG is a table with a header, MCAP or a bag of rosbag2; the section `signals` of the scenario says which of "
      "its\n"
      "signals are the vehicle's outputs and inputs ('rhec log' proposes one). All measurements are used; a second "
      "replay\n"
      "withholds one in 5 of the position's, and says how well they are predicted. Writes estimates.csv, "
      "measurements.csv,\n"
      "innovations.csv, predictions.csv, times.csv, summary.json, horizons.jsonl and run.svg to the output folder;\n"
      "'rhec report' makes a page of them.\n\n"
      "Files of --dead-reckoning and --gps are comma-separated without a header: time, wheel speed, steering angle; "
      "and\n"
      "time, x, y. Writes estimates.csv, times.csv, summary.json, horizons.jsonl and run.svg; 'rhec report' makes a "
      "page\n"
      "of them. The exit code is 3 where a solve failed.\n\n"
      "Examples:\n"
      "  rhec estimate my_robot.yaml drive.mcap --out out/drive --mcap out/estimate.mcap\n"
      "  rhec estimate scenarios/figure8.yaml drive.csv --set estimator.name=ekf --hold-out 10\n"
      "  rhec estimate scenarios/victoria_park.yaml --dead-reckoning DRS.txt --gps GPS.txt --out out/park\n"
      "  rhec estimate scenarios/victoria_park.yaml --dead-reckoning DRS.txt --gps GPS.txt --hold-out 5 --variant ekf",
      [arguments] { return estimate(*arguments); });
  add_log_arguments(command, "estimate", *arguments);
  add_tracks(command, arguments->tracks);
  add_dump(command, arguments->dump);
}

}  // namespace rhec::apps
