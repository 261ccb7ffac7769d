#include <fmt/format.h>

#include <cmath>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "commands.hpp"
#include "crash_report.hpp"
#include "drive_arguments.hpp"
#include "log_arguments.hpp"
#include "output.hpp"
#include "progress.hpp"
#include "rhec/core/base/error.hpp"
#include "rhec/plugins/host/host.hpp"
#include "rhec/plugins/robot/scenario_file.hpp"
#include "rhec/plugins/yaml/yaml.hpp"
#include "rhec/sim/files/output_folder.hpp"
#include "rhec/sim/horizons/horizon_log.hpp"
#include "rhec/sim/logs/smoothing.hpp"
#include "rhec/sim/loop/run_files.hpp"
#include "rhec/sim/loop/smoothed_drive.hpp"

namespace rhec::apps {
void print_solve(const std::string& name, const Report& report, int intervals, double seconds, bool has_sigmas,
                 const std::vector<SmoothedRun::Law>& laws) {
  fmt::print("{}: {} intervals at once: {} after {} iterations and {} factorisations, {:.2f} s; KKT residual {:.1e}\n",
             name, intervals, name_of(report.status), report.iterations, report.factorisations, seconds,
             report.kkt.largest());
  if (report.status != Status::solved) fmt::print("  {}\n", advice_for(report.status));
  if (!has_sigmas)
    fmt::print(
        "  this solver gives no covariances: standard deviations are left empty; sparse_sqp and gn_rti give them\n");
  if (laws.size() > 1) fmt::print("  a mixture of {} laws of variation\n", laws.size());
}

namespace {

struct SmoothArguments : LogArguments {
  TrackArguments tracks;
};

/// An estimate in the form that all kinds of drives share.
void write_track(double time, const Eigen::VectorXd& values, const Eigen::VectorXd& sigmas, const Robot& robot,
                 Tracks& tracks) {
  sim::DriveEstimate estimate;
  estimate.time = time;
  estimate.values = values;
  estimate.sigmas = sigmas.size() > 0 ? sigmas : Eigen::VectorXd::Constant(values.size(), std::nan(""));
  tracks.write(sim::track_sample(estimate, robot, 0));
}

void print_table(const std::vector<sim::SmoothedReplay>& results, const sim::RecordedLog& log,
                 const sim::HoldOut& hold_out, const std::filesystem::path& folder) {
  for (const sim::SmoothedReplay& result : results)
    print_solve(result.smoothed.name, result.report, result.intervals, result.solve_seconds, result.has_sigmas,
                result.laws);
  if (hold_out.every > 0) {
    fmt::print("\n{:<24} {:>8} {:>8} {:>9}   {:>10} {:>8} {:>9}\n", "ESTIMATE", "WITHHELD", "MEDIAN", "RMSE(5 m)",
               "CONSISTENT", "MEDIAN", "RMSE(5 m)");
    for (const sim::SmoothedReplay& result : results) {
      for (const sim::Replay* replay : {&result.smoothed, &result.causal}) {
        const sim::HeldOutSummary summary = sim::summarise(*replay, log);
        fmt::print("{:<24} {:>8} {:>6.4f} m {:>7.4f} m   {:>10} {:>6.4f} m {:>7.4f} m\n", replay->name,
                   summary.all.count, summary.all.median, summary.all.rmse_capped, summary.consistent.count,
                   summary.consistent.median, summary.consistent.rmse_capped);
      }
    }
  }
  fmt::print("\npictures and numbers: {}\n", folder.string());
}

int smooth_log(const SmoothArguments& arguments) {
  const LogInput input(arguments);
  tell_notes(input.scenario.variants().front().robot.notes());
  sim::OutputFolder folder(out_of(arguments.out, arguments.scenario, "_smooth"));
  std::vector<sim::SmoothedReplay> results;
  bool all_solved = true;
  for (const sim::LogVariant& variant : input.scenario.variants()) {
    ProgressBar bar(variant.name);
    results.push_back(sim::smooth(variant.name, variant.robot, input.log, input.scenario.log(), input.hold_out,
                                  {.progress = [&](double share) { bar.show(share); }, .solved = {}}));
    all_solved = all_solved && results.back().report.status == Status::solved;
  }
  const sim::SmoothedReplay& first = results.front();
  const Robot& robot = input.scenario.variants().front().robot;
  Tracks tracks(arguments.tracks, robot);
  for (const sim::LoggedEstimate& entry : first.smoothed.estimates)
    write_track(entry.time, entry.values, entry.sigmas, robot, tracks);
  tracks.commit();
  folder.write("run.svg", sim::replay_svg(first.smoothed, input.log, input.scenario, &first.causal));
  std::vector<sim::Replay> replays;
  for (const sim::SmoothedReplay& result : results) {
    replays.push_back(result.smoothed);
    replays.push_back(result.causal);
  }
  folder.write("estimates.csv", sim::estimates_csv(replays, input.log, input.scenario));
  const std::string summary = sim::summary_json(replays, input.log, input.scenario, input.hold_out);
  folder.write("summary.json", summary);
  folder.write("times.csv", sim::times_csv(replays));
  // A smoother has no windows, but a report reads the description of the model from this file.
  std::vector<sim::HorizonLog> none;
  for (const sim::LogVariant& variant : input.scenario.variants())
    for (int i = 0; i < 2; ++i) none.emplace_back(variant.robot, 1);
  folder.write("horizons.jsonl",
               sim::horizons_text(none, input.log, input.scenario, input.hold_out, {"", sim::causal_suffix}));
  folder.commit();
  if (arguments.json)
    print_json(summary, folder.path());
  else
    print_table(results, input.log, input.hold_out, folder.path());
  return all_solved ? exit_fine : exit_not_solved;
}

/// Errors and certainty of a simulated drive, with hindsight and without.
void print_table(const sim::SmoothedDrive& drive, const sim::Scenario& scenario, const std::filesystem::path& folder) {
  const sim::RunSummary smoothed = sim::summarise(drive.smoothed, scenario),
                        causal = sim::summarise(drive.causal, scenario);
  fmt::print("\n{:<12} {:>14} {:>14}\n", "MEAN ERROR", "WITH HINDSIGHT", "WHILE DRIVING");
  for (const auto& [name, value] : smoothed.mae.parameters)
    fmt::print("{:<12} {:>14.4f} {:>14.4f}\n", name, value, causal.mae.parameters.at(name));
  fmt::print("{:<12} {:>12.3f} m {:>12.3f} m\n", "position", smoothed.mae.position, causal.mae.position);
  fmt::print("{:<12} {:>10.4f} rad {:>10.4f} rad\n", "heading", smoothed.mae.heading, causal.mae.heading);
  if (drive.has_sigmas) {
    fmt::print("\n{:<12} {:>14} {:>14}   {} % expected\n", "WITHIN 2 SD", "WITH HINDSIGHT", "WHILE DRIVING", 95);
    const auto share = [](const sim::RunSummary& summary, const std::string& name) {
      const auto found = summary.within_two_sigma.find(name);
      return found == summary.within_two_sigma.end() ? std::string("-")
                                                     : fmt::format("{:.0f} %", 100.0 * found->second);
    };
    for (const auto& [name, unused] : smoothed.mae.parameters)
      fmt::print("{:<12} {:>14} {:>14}\n", name, share(smoothed, name), share(causal, name));
    fmt::print("{:<12} {:>14.1f} {:>14.1f}   {} expected: {}\n", "NEES", smoothed.nees, causal.nees,
               smoothed.nees_expected, sim::name_of(smoothed.certainty));
  }
  fmt::print("\npictures and numbers: {}\n", folder.string());
}

int smooth_simulation(const SmoothArguments& arguments) {
  Settings settings = load_scenario(arguments.scenario);
  apply_assignments(settings, arguments.assignments);
  constexpr const char* give_files = "give its files by --dead-reckoning and --gps";
  for (const char* key : {"log", "variants"})
    if (const Settings* section = settings.find(key))
      throw section->error(fmt::format("a section '{}' is that of a recorded drive; {}", key, give_files));
  if (arguments.hold_out > 0 || arguments.phase >= 0 || !arguments.variants.empty())
    throw Error(fmt::format(
        "--hold-out, --hold-out-phase and --variant are for a recorded drive; {}, or leave them out", give_files));
  const sim::Scenario scenario(examined_host(arguments.plugin_path), settings);
  tell_notes(scenario.notes());
  sim::OutputFolder folder(out_of(arguments.out, arguments.scenario, "_smooth"));
  ProgressBar bar(scenario.options().name);
  const sim::SmoothedDrive drive =
      sim::smooth_closed_loop(scenario, {.progress = [&](double share) { bar.show(share); }});
  bar.finish();
  Tracks tracks(arguments.tracks, scenario.robot(), &scenario.path());
  for (const sim::Sample& sample : drive.smoothed.samples) {
    Eigen::VectorXd values(sample.state.size() + sample.parameters.size());
    values << sample.state, sample.parameters;
    write_track(sample.time, values, sample.sigma, scenario.robot(), tracks);
  }
  tracks.commit();
  folder.write("steps.csv", sim::steps_csv(drive.smoothed, scenario));
  folder.write("times.csv", sim::times_csv(drive.smoothed));
  const std::string summary = sim::summary_json(drive, scenario);
  folder.write("summary.json", summary);
  // A smoother has no windows, but a report reads the description of the model from this file.
  folder.write("horizons.jsonl", sim::horizons_text(sim::HorizonLog(scenario.robot(), 1), drive.smoothed, scenario));
  folder.write("run.svg", sim::run_svg(drive.smoothed, scenario, &drive.causal));
  folder.commit();
  if (arguments.json) {
    print_json(summary, folder.path());
  } else {
    print_solve(scenario.options().name, drive.report, drive.intervals, drive.solve_seconds, drive.has_sigmas,
                drive.laws);
    print_table(drive, scenario, folder.path());
  }
  return drive.report.status == Status::solved ? exit_fine : exit_not_solved;
}

int smooth(const SmoothArguments& arguments) {
  if (!arguments.log.empty() && names_log(arguments, "smooth")) return smooth_drive(arguments, arguments.tracks);
  return arguments.gps.empty() ? smooth_simulation(arguments) : smooth_log(arguments);
}

}  // namespace

void add_smooth(Program& program) {
  auto arguments = std::make_shared<SmoothArguments>();
  Command command = program.add(
      "smooth", "Estimates a whole drive at once: every moment from what was measured before and after it.",
      "A drive that was recorded, by its LOG (see 'rhec estimate') or the files of --dead-reckoning and --gps, or, "
      "without\n"
      "them, the one that the scenario simulates. The\n"
      "scenario's estimator goes through it first; its estimates are the start. The section `smoother` says how\n"
      "parameters vary over the drive, by blocks or by priors, and which solver is used. Of a recorded drive, writes\n"
      "estimates.csv, times.csv, summary.json, horizons.jsonl and run.svg to the output folder; of a simulated one,\n"
      "steps.csv in place of estimates.csv. The exit code is 3 where the problem was not solved.\n\n"
      "Examples:\n"
      "  rhec smooth scenarios/figure8.yaml --set seed=3 --out out/hindsight\n"
      "  rhec smooth scenarios/victoria_park.yaml --dead-reckoning DRS.txt --gps GPS.txt --out out/park\n"
      "  rhec smooth scenarios/victoria_park.yaml --dead-reckoning DRS.txt --gps GPS.txt --hold-out 5 \\\n"
      "    --set 'smoother.blocking.kappa={name: structured, size: 50, neighbour_sigma: 0.004}'",
      [arguments] { return smooth(*arguments); });
  add_log_arguments(command, "smooth", *arguments);
  add_tracks(command, arguments->tracks);
}

}  // namespace rhec::apps
