#include <fmt/format.h>

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "commands.hpp"
#include "log_arguments.hpp"
#include "progress.hpp"
#include "rhec/core/base/error.hpp"
#include "rhec/plugins/host/host.hpp"
#include "rhec/plugins/yaml/yaml.hpp"
#include "rhec/sim/files/output_folder.hpp"
#include "rhec/sim/horizons/horizon_log.hpp"
#include "rhec/sim/logs/smoothing.hpp"

namespace rhec::apps {
namespace {

void print_table(const std::vector<sim::SmoothedReplay>& results, const sim::RecordedLog& log,
                 const sim::HoldOut& hold_out, const std::filesystem::path& folder) {
  for (const sim::SmoothedReplay& result : results) {
    fmt::print(
        "{}: {} intervals at once: {} after {} iterations and {} factorisations, {:.2f} s; KKT residual {:.1e}\n",
        result.smoothed.name, result.intervals, name_of(result.report.status), result.report.iterations,
        result.report.factorisations, result.solve_seconds, result.report.kkt.largest());
    if (result.report.status != Status::solved) fmt::print("  {}\n", advice_for(result.report.status));
    if (!result.has_sigmas)
      fmt::print(
          "  this solver gives no covariances: standard deviations are left empty; sparse_sqp and gn_rti give them\n");
  }
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

int smooth(const LogArguments& arguments) {
  const LogInput input(arguments);
  sim::OutputFolder folder(arguments.out);
  std::vector<sim::SmoothedReplay> results;
  bool all_solved = true;
  for (const sim::LogVariant& variant : input.scenario.variants()) {
    ProgressBar bar(variant.name);
    results.push_back(sim::smooth(variant.name, variant.robot, input.log, input.scenario.log(), input.hold_out,
                                  {.progress = [&](double share) { bar.show(share); }, .solved = {}}));
    all_solved = all_solved && results.back().report.status == Status::solved;
  }
  const sim::SmoothedReplay& first = results.front();
  folder.write("run.svg", sim::replay_svg(first.smoothed, input.log, input.scenario, &first.causal));
  std::vector<sim::Replay> replays;
  for (const sim::SmoothedReplay& result : results) {
    replays.push_back(result.smoothed);
    replays.push_back(result.causal);
  }
  folder.write("estimates.csv", sim::estimates_csv(replays, input.log, input.scenario));
  folder.write("summary.json", sim::summary_json(replays, input.log, input.scenario, input.hold_out));
  folder.write("times.csv", sim::times_csv(replays));
  // A smoother has no windows, but a report reads the description of the model from this file.
  std::vector<sim::HorizonLog> none;
  for (const sim::LogVariant& variant : input.scenario.variants())
    for (int i = 0; i < 2; ++i) none.emplace_back(variant.robot, 1);
  folder.write("horizons.jsonl",
               sim::horizons_text(none, input.log, input.scenario, input.hold_out, {"", sim::causal_suffix}));
  folder.commit();
  print_table(results, input.log, input.hold_out, folder.path());
  return all_solved ? exit_fine : exit_not_solved;
}

}  // namespace

void add_smooth(Program& program) {
  auto arguments = std::make_shared<LogArguments>();
  Command command = program.add(
      "smooth", "Estimates a whole recorded drive at once: every moment from what was measured before and after it.",
      "The scenario's estimator goes through the log first; its estimates are the start. The section `smoother` says\n"
      "which blocks the whole log has and which solver is used. Writes estimates.csv, times.csv, summary.json,\n"
      "horizons.jsonl and run.svg to the output folder. The exit code is 3 where the problem was not solved.\n\n"
      "Examples:\n"
      "  rhec smooth scenarios/victoria_park.yaml --dead-reckoning DRS.txt --gps GPS.txt --out out/park\n"
      "  rhec smooth scenarios/victoria_park.yaml --dead-reckoning DRS.txt --gps GPS.txt --hold-out 5 \\\n"
      "    --set 'smoother.blocking.kappa={name: structured, size: 50, neighbour_sigma: 0.004}'",
      [arguments] { return smooth(*arguments); });
  add_log_arguments(command, *arguments);
}

}  // namespace rhec::apps
