// `rhec estimate` and `rhec smooth` of a log with the vehicle's own sensors.
#include <fmt/format.h>

#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "commands.hpp"
#include "drive_arguments.hpp"
#include "integration_note.hpp"
#include "output.hpp"
#include "progress.hpp"
#include "rhec/sim/files/output_folder.hpp"
#include "rhec/sim/horizons/horizon_log.hpp"
#include "rhec/sim/logs/smoothing.hpp"
#include "rhec/sim/maps/map_keeper.hpp"
#include "rhec/sim/replay/drive_smoothing.hpp"
#include "rhec/sim/replay/replay_summary.hpp"

namespace rhec::apps {
namespace {

void print_signals(const logs::Drive& drive) {
  fmt::print("{:<18} {:>8} {:>8} {:>8}   {}\n", "SIGNAL", "VALUES", "MISSING", "LEFT OUT", "FROM");
  for (const logs::SignalCount& each : drive.signals)
    fmt::print("{:<18} {:>8} {:>8} {:>8}   {}{}\n", each.variable, each.values, each.missing, each.left_out,
               each.source,
               each.stated == 0 ? ""
                                : fmt::format("; {} state how accurate they are, {:.3g} to {:.3g}", each.stated,
                                              each.least_sigma, each.most_sigma));
  if (drive.origin)
    fmt::print("local plane: origin {:.8f}, {:.8f} degrees, {:.3f} m\n", drive.origin->latitude,
               drive.origin->longitude, drive.origin->height);
}

/// A statistic, or a dash where there was nothing to make it of.
std::string told(double value, const char* format) {
  return std::isnan(value) ? "-" : fmt::format(fmt::runtime(format), value);
}

void print_innovations(const sim::DriveReplay& replay, const Robot& robot) {
  fmt::print("\n{}: {} estimates, {} fallbacks, {:.2f} s\n", replay.name, replay.estimates.size(),
             replay.counts.fallbacks, replay.seconds);
  if (replay.innovations.empty()) {
    fmt::print("no innovations: nobody judges the measurements; set estimator.health.watch=true\n");
    return;
  }
  fmt::print("{:<24} {:>8} {:>8} {:>8} {:>8}   {}\n", "INNOVATIONS", "USED", "REJECTED", "NIS", "EXPECTED",
             "RMS / STATED, CORRELATION WITH THE NEXT");
  for (const sim::SensorSummary& sensor : sim::summarise_innovations(replay, robot)) {
    std::string outputs;
    for (const sim::SensorSummary::Output& output : sensor.outputs)
      outputs += fmt::format("{}{} / {} {}, {}", outputs.empty() ? "" : "; ", told(output.rms, "{:.3g}"),
                             told(output.expected, "{:.3g}"), output.unit, told(output.correlation, "{:.2f}"));
    fmt::print("{:<24} {:>8} {:>8} {:>8} {:>8.2f}   {}\n", sensor.name, sensor.used, sensor.rejected,
               told(sensor.nis, "{:.2f}"), sensor.expected, outputs);
  }
}

void print_accuracy(const sim::DriveReplay& replay, const Robot& robot, const sim::HoldOut& hold_out,
                    const char* what = "predicted") {
  const sim::AccuracySummary accuracy = sim::summarise_predictions(replay, robot);
  if (accuracy.count == 0) {
    fmt::print("nothing was withheld, or nothing could be predicted: no accuracy is known; see --hold-out\n");
    return;
  }
  std::string outputs;
  for (const sim::SensorSummary::Output& output : accuracy.outputs)
    outputs += fmt::format("{}{} {:.3g} {}", outputs.empty() ? "" : ", ", output.name, output.rms, output.unit);
  fmt::print(
      "withheld, 1 of {}: {} measurements of {} {}: distance {:.4g} in the median, RMS {:.4g}, largest {:.4g}; {}\n",
      hold_out.every, accuracy.count, accuracy.sensor, what, accuracy.median, accuracy.rms, accuracy.most, outputs);
}

/// What is said at the end: all results as JSON, or where they are.
void tell_results(const LogArguments& arguments, const std::string& summary, const std::filesystem::path& folder) {
  if (arguments.json)
    print_json(summary, folder);
  else
    fmt::print("\npictures and numbers: {}\n", folder.string());
}

/// The name of a variant's track: the first one's is as given.
TrackArguments only_first(const TrackArguments& tracks, std::size_t variant) {
  return variant == 0 ? tracks : TrackArguments{};
}

}  // namespace

int estimate_drive(const LogArguments& arguments, const TrackArguments& track_arguments) {
  const sim::ReplayInput input = read_replay_input(arguments);
  tell_notes(input.scenario.variants().front().robot.notes());
  sim::OutputFolder folder(out_of(arguments.out, arguments.scenario, "_estimate"));
  std::vector<sim::DriveResult> results;
  std::vector<sim::HorizonLog> horizons;
  if (!arguments.json) print_signals(input.drives.front());
  bool all_usable = true;
  for (std::size_t v = 0; v < input.drives.size(); ++v) {
    const sim::ReplayVariant& variant = input.scenario.variants()[v];
    ProgressBar bar(variant.name);
    Tracks tracks(only_first(track_arguments, v), variant.robot);
    horizons.emplace_back(variant.robot, input.estimates(v), sim::most_windows_of_log / std::ssize(input.drives));
    const auto keeper = std::make_shared<sim::MapKeeper>();
    sim::DriveResult result = sim::estimate_variant(input, v,
                                                    {.progress = [&](double share) { bar.show(share); },
                                                     .sampled =
                                                         [&](const sim::LoopSample& sample) {
                                                           horizons.back().take(sample);
                                                           tracks.take(sample, input.drives[v].start);
                                                         },
                                                     .robot = keeper},
                                                    std::make_shared<sim::MapKeeper>());
    bar.finish();
    tracks.commit();
    keeper->save();
    if (!arguments.json) {
      print_innovations(result.all, variant.robot);
      print_accuracy(result.withheld, variant.robot, input.hold_out);
      print_integration(result.all.counts, variant.robot, variant.name + ": ");
    }
    all_usable = all_usable && result.all.counts.fallbacks == 0;
    results.push_back(std::move(result));
  }
  const std::string summary = sim::write_drive_files(folder, input, results);
  folder.write("horizons.jsonl", sim::horizons_text(horizons, input));
  folder.commit();
  tell_results(arguments, summary, folder.path());
  return all_usable ? exit_fine : exit_not_solved;
}

int smooth_drive(const LogArguments& arguments, const TrackArguments& track_arguments) {
  const sim::ReplayInput input = read_replay_input(arguments);
  tell_notes(input.scenario.variants().front().robot.notes());
  sim::OutputFolder folder(out_of(arguments.out, arguments.scenario, "_smooth"));
  std::vector<sim::DriveResult> results;
  std::vector<sim::HorizonLog> none;
  if (!arguments.json) print_signals(input.drives.front());
  bool all_solved = true;
  for (std::size_t v = 0; v < input.drives.size(); ++v) {
    const sim::ReplayVariant& variant = input.scenario.variants()[v];
    ProgressBar bar(variant.name);
    auto [smoothed, withheld] = sim::smooth_variant(input, v, {.progress = [&](double share) { bar.show(share); }});
    bar.finish();
    if (!arguments.json) {
      print_solve(variant.name, smoothed.report, smoothed.intervals, smoothed.solve_seconds, smoothed.has_sigmas,
                  smoothed.laws);
      print_innovations(smoothed.causal, variant.robot);
      print_accuracy(withheld, variant.robot, input.hold_out, "interpolated");
    }
    Tracks tracks(only_first(track_arguments, v), variant.robot);
    for (const sim::DriveEstimate& estimate : smoothed.smoothed.estimates)
      tracks.write(sim::track_sample(estimate, variant.robot, input.drives[v].start));
    tracks.commit();
    all_solved = all_solved && smoothed.report.status == Status::solved;
    // A smoother has no windows, but a report reads the description of the model from their file.
    for (int i = 0; i < 2; ++i) none.emplace_back(variant.robot, 1);
    results.push_back({std::move(smoothed.smoothed), std::move(withheld)});
    results.push_back({std::move(smoothed.causal), {}});
  }
  const std::string summary = sim::write_drive_files(folder, input, results, &results[1].all);
  folder.write("horizons.jsonl", sim::horizons_text(none, input, {"", sim::causal_suffix}));
  folder.commit();
  tell_results(arguments, summary, folder.path());
  return all_solved ? exit_fine : exit_not_solved;
}

}  // namespace rhec::apps
