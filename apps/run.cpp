#include <unistd.h>

#include <fmt/format.h>

#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "commands.hpp"
#include "crash_report.hpp"
#include "drive_arguments.hpp"
#include "dump.hpp"
#include "integration_note.hpp"
#include "output.hpp"
#include "progress.hpp"
#include "rhec/core/base/error.hpp"
#include "rhec/plugins/host/host.hpp"
#include "rhec/plugins/robot/scenario_file.hpp"
#include "rhec/plugins/yaml/yaml.hpp"
#include "rhec/sim/files/output_folder.hpp"
#include "rhec/sim/horizons/horizon_log.hpp"
#include "rhec/sim/loop/closed_loop.hpp"
#include "rhec/sim/loop/run_files.hpp"
#include "rhec/sim/maps/map_keeper.hpp"
#include "rhec/sim/telemetry/measurement_log.hpp"

namespace rhec::apps {
namespace {

struct RunArguments {
  std::string scenario, out;
  std::vector<std::string> assignments;
  std::vector<std::filesystem::path> plugin_path;
  DumpArguments dump;
  TrackArguments tracks;
  std::string log;
  bool json = false;
};

/// How sure the estimator is, and whether that is right.
void print_certainty(const sim::RunSummary& summary) {
  std::string words;
  switch (summary.certainty) {
    case sim::Certainty::unknown:
      return;
    case sim::Certainty::too_certain:
      words = "errors are larger than the covariance says; do not rely on it";
      if (summary.nees <= sim::most_nees * summary.nees_expected) {
        words = "too certain of";
        for (const auto& [name, share] : summary.within_two_sigma)
          if (share < sim::least_share) words += " " + name;
      }
      break;
    case sim::Certainty::right:
      words = "the covariance is about right";
      break;
    case sim::Certainty::too_cautious:
      words = "errors are much smaller than the covariance says";
      break;
  }
  fmt::print("{:<12} {:>12} {:>12}\n", "CERTAINTY", "WITHIN 2 SD", "EXPECTED");
  for (const auto& [name, unused] : summary.mae.parameters)
    if (const auto share = summary.within_two_sigma.find(name); share != summary.within_two_sigma.end())
      fmt::print("{:<12} {:>10.0f} % {:>10} %\n", name, 100.0 * share->second, 95);
  fmt::print("{:<12} {:>12.1f} {:>12}   {}\n\n", "NEES", summary.nees, summary.nees_expected, words);
}

/// What an estimator has learnt of the noise of its sensors.
void print_noise(const sim::RunSummary& summary, const sim::Scenario& scenario) {
  if (summary.noise.empty()) return;
  fmt::print("{:<12} {:>12} {:>12}\n", "NOISE", "LEARNT", "STATED");
  const std::vector<Variable>& outputs = scenario.robot().model()->description().outputs;
  for (std::size_t j = 0; j < outputs.size(); ++j) {
    const auto learnt = summary.noise.find(outputs[j].name);
    if (learnt == summary.noise.end()) continue;
    const double stated = scenario.robot().output_sigmas()[j];
    if (learnt->second.is_identified)
      fmt::print("{:<12} {:>12.3g} {:>12.3g}\n", outputs[j].name, learnt->second.sigma, stated);
    else
      fmt::print("{:<12} {:>12} {:>12.3g}   held: the measurements do not tell it from slip and inputs\n",
                 outputs[j].name, "-", stated);
  }
  fmt::print("\n");
}

/// How often the estimator doubted itself, where it did.
void print_health(const sim::RunSummary& summary) {
  const auto samples_of = [&](HealthLevel level) {
    const auto found = summary.health.find(name_of(level));
    return found == summary.health.end() ? 0 : found->second;
  };
  const std::int64_t degraded = samples_of(HealthLevel::degraded), lost = samples_of(HealthLevel::lost);
  if (degraded + lost == 0 && summary.counts.rejected == 0) return;
  fmt::print(
      "health: ok in {} of {} samples, degraded in {}, lost in {}; {} measurements rejected, {} jumps followed, {} "
      "clocks "
      "set; 'findings' in steps.csv say why\n",
      samples_of(HealthLevel::ok), summary.steps, degraded, lost, summary.counts.rejected, summary.counts.rebased,
      summary.counts.clocks_set);
}

/// Which limits of the controller were not kept, where any was not.
void print_limits(const sim::RunSummary& summary) {
  bool is_first = true;
  for (const auto& [name, record] : summary.limits) {
    if (record.violated == 0) continue;
    if (is_first) fmt::print("{:<44} {:>12} {:>12}\n", "LIMIT VIOLATED", "IN SAMPLES", "AT MOST BY");
    is_first = false;
    fmt::print("{:<44} {:>12} {:>12.3g}\n", name, fmt::format("{} of {}", record.violated, summary.steps), record.most);
  }
  if (!is_first) fmt::print("\n");
}

void print_table(const sim::RunSummary& summary, const sim::Scenario& scenario, const std::filesystem::path& folder) {
  fmt::print("{:<12} {:>12} {:>12}\n", "ERROR", "MEAN ABS", "RMS");
  for (const auto& [name, value] : summary.mae.parameters)
    fmt::print("{:<12} {:>12.4f} {:>12.4f}\n", name, value, summary.rmse.parameters.at(name));
  fmt::print("{:<12} {:>10.3f} m {:>10.3f} m\n", "position", summary.mae.position, summary.rmse.position);
  fmt::print("{:<12} {:>8.4f} rad {:>8.4f} rad\n", "heading", summary.mae.heading, summary.rmse.heading);
  fmt::print("{:<12} {:>10.3f} m {:>10.3f} m\n\n", "tracking", summary.mae.tracking, summary.rmse.tracking);
  print_certainty(summary);
  print_noise(summary, scenario);
  print_limits(summary);
  fmt::print("{:<12} {:>12} {:>12} {:>12}\n", "SOLVE [us]", "MEDIAN", "P99", "MAX");
  const auto times = [](const char* name, const sim::Spread& t) {
    fmt::print("{:<12} {:>12.1f} {:>12.1f} {:>12.1f}\n", name, t.median, t.p99, t.max);
  };
  if (!summary.estimator_statuses.empty()) times("rhe", summary.estimator_us);
  times("rhc", summary.controller_us);
  fmt::print("\n{} steps: {}; {} of {} solves fell back\n", summary.steps, summary.ended, summary.fallbacks,
             summary.solves);
  print_health(summary);
  print_integration(summary.counts, scenario.robot());
  fmt::print("pictures and numbers: {}\n", folder.string());
}

/// What is remembered of places now.
void print_map(const sim::MapKeeper& keeper) {
  if (keeper.cells() == 0) return;
  fmt::print("map: {} cells{}\n", keeper.cells(),
             keeper.file().empty() ? ", kept in no file" : " in " + keeper.file().string());
  if (keeper.dropped() > 0)
    fmt::print("{} values found no room on the map; give estimator.memory.cells a larger number\n", keeper.dropped());
}

int run(const RunArguments& arguments) {
  Settings settings = load_scenario(arguments.scenario);
  apply_assignments(settings, arguments.assignments);
  const sim::Scenario scenario(examined_host(arguments.plugin_path), settings);
  if (scenario.robot().memory().is_given() && arguments.dump.folder)
    throw Error(
        "--dump: problems of a controller that knows the slip ahead cannot be saved yet; give estimator.memory=none");
  tell_notes(scenario.notes());
  sim::OutputFolder folder(out_of(arguments.out, arguments.scenario, ""));
  Dump dump(arguments.dump, {"rhe", "rhc"});
  ProgressBar bar(scenario.options().name);
  const double samples = scenario.path().length() / (scenario.options().speed * scenario.robot().step());
  sim::HorizonLog horizons(scenario.robot(), static_cast<std::int64_t>(samples) + 1);
  const auto keeper = std::make_shared<sim::MapKeeper>();
  Tracks tracks(arguments.tracks, scenario.robot(), &scenario.path());
  std::optional<sim::MeasurementLog> measured;
  if (!arguments.log.empty()) measured.emplace(arguments.log, scenario.robot().model()->description());
  sim::LoopHooks hooks{.progress = [&](double share) { bar.show(share); },
                       .solved = dump.watch(scenario.options().name, scenario.robot()),
                       .sampled =
                           [&](const sim::LoopSample& sample) {
                             horizons.take(sample);
                             tracks.take(sample, 0);
                           },
                       .robot = keeper};
  if (measured) measured->listen(hooks);
  const sim::RunLog log = sim::run_closed_loop(scenario, hooks);
  bar.finish();
  const sim::RunSummary summary = sim::summarise(log, scenario);
  folder.write("steps.csv", sim::steps_csv(log, scenario));
  folder.write("times.csv", sim::times_csv(log));
  folder.write("summary.json", sim::summary_json(summary));
  folder.write("horizons.jsonl", sim::horizons_text(horizons, log, scenario));
  folder.write("run.svg", sim::run_svg(log, scenario));
  keeper->save();
  folder.commit();
  dump.commit();
  tracks.commit();
  if (measured) measured->close();
  if (arguments.json) {
    print_json(sim::summary_json(summary), folder.path());
  } else {
    print_table(summary, scenario, folder.path());
    print_map(*keeper);
    dump.tell(arguments.plugin_path);
  }
  return log.completed ? exit_fine : exit_not_solved;
}

}  // namespace

void add_run(Program& program) {
  auto arguments = std::make_shared<RunArguments>();
  Command command = program.add(
      "run", "Runs a scenario: a robot on simulated ground learns its slip and holds its path.",
      "Writes steps.csv, times.csv, summary.json, horizons.jsonl and run.svg to the output folder; 'rhec report' makes "
      "a\n"
      "page of them. The exit code is 3 where the robot did not reach the end of its path.\n\n"
      "Examples:\n"
      "  rhec run scenarios/figure8.yaml          results go to out/figure8\n"
      "  rhec run scenarios/figure8.yaml --set speed=4 --set 'blocking.kappa={name: full_horizon}' --out out/fhb\n"
      "  rhec run scenarios/zigzag.yaml --set estimator.name=ekf --set seed=3 --out out/ekf\n"
      "  rhec run scenarios/figure8.yaml --log drive.mcap --mcap estimate.mcap\n"
      "  rhec run scenarios/zigzag.yaml --dump out/problems --dump-every 10",
      [arguments] { return run(*arguments); });
  command.add("scenario", arguments->scenario, "a YAML file").required();
  add_assignments(command, arguments->assignments, "a key of the scenario");
  add_out(command, arguments->out, "DIR", "folder of the results; otherwise out/ and the scenario's name");
  add_json(command, arguments->json);
  command
      .add("--log", arguments->log,
           "write what the sensors measured, as 'rhec estimate SCENARIO LOG' reads it; .csv or .mcap")
      .value("FILE");
  add_tracks(command, arguments->tracks);
  add_dump(command, arguments->dump);
  add_plugin_path(command, arguments->plugin_path);
}

}  // namespace rhec::apps
