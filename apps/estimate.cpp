#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "commands.hpp"
#include "progress.hpp"
#include "rhec/core/error.hpp"
#include "rhec/plugins/host.hpp"
#include "rhec/plugins/yaml.hpp"
#include "rhec/sim/output_folder.hpp"
#include "rhec/sim/recorded_log.hpp"

namespace rhec::apps {
namespace {

struct EstimateArguments {
  std::string scenario, dead_reckoning, gps, out = "out";
  std::vector<std::string> assignments, variants;
  int hold_out = 0, phase = -1;
  std::vector<std::filesystem::path> plugin_path;
};

void print_table(const sim::LogScenario& scenario, const sim::RecordedLog& log, const std::vector<sim::Replay>& replays,
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
    fmt::print("{:<16} ", scenario.variants()[i].name);
    if (hold_out.every > 0)
      fmt::print("{:>8} {:>6.4f} m {:>7.4f} m   {:>10} {:>6.4f} m {:>7.4f} m   ", summary.all.count, summary.all.median,
                 summary.all.rmse_capped, summary.consistent.count, summary.consistent.median,
                 summary.consistent.rmse_capped);
    fmt::print("{:>8} {:>9} {:>6.2f} s\n", replays[i].counts.nodes, replays[i].counts.fallbacks, replays[i].seconds);
  }
  fmt::print("\npictures and numbers: {}\n", folder.string());
}

int estimate(const EstimateArguments& arguments) {
  Settings settings = load_yaml(arguments.scenario);
  for (const std::string& assignment : arguments.assignments) apply_assignment(settings, assignment);
  const sim::LogScenario scenario(Host(arguments.plugin_path), settings, arguments.variants);
  const int phase = arguments.phase >= 0 ? arguments.phase : arguments.hold_out - 1;
  if (arguments.hold_out > 0 && phase >= arguments.hold_out)
    throw Error(
        fmt::format("--hold-out-phase {} with --hold-out {}; expected a number below it", phase, arguments.hold_out));
  const sim::HoldOut hold_out{arguments.hold_out, phase};
  const sim::RecordedLog log = sim::read_recorded_log(arguments.dead_reckoning, arguments.gps, scenario);
  sim::OutputFolder folder(arguments.out);
  std::vector<sim::Replay> replays;
  bool all_usable = true;
  for (const sim::LogVariant& variant : scenario.variants()) {
    ProgressBar bar(variant.name);
    replays.push_back(
        sim::replay(variant.robot, log, scenario.log(), hold_out, [&](double share) { bar.show(share); }));
    all_usable = all_usable && replays.back().counts.fallbacks == 0;
  }
  folder.write("estimates.csv", sim::estimates_csv(replays, log, scenario));
  folder.write("summary.json", sim::summary_json(replays, log, scenario, hold_out));
  folder.write("run.svg", sim::replay_svg(replays.front(), log, scenario));
  folder.commit();
  print_table(scenario, log, replays, hold_out, folder.path());
  return all_usable ? exit_fine : exit_not_solved;
}

}  // namespace

void add_estimate(CLI::App& program, Action& chosen) {
  auto arguments = std::make_shared<EstimateArguments>();
  CLI::App* command = program.add_subcommand(
      "estimate", "Estimates state and slip from a recorded drive, and predicts what it withholds.");
  command->footer(
      "Files are comma-separated without a header: time, wheel speed, steering angle; and time, x, y. Writes\n"
      "estimates.csv, summary.json and run.svg to the output folder. The exit code is 3 where a solve failed.\n\n"
      "Examples:\n"
      "  rhec estimate scenarios/victoria_park.yaml --dead-reckoning DRS.txt --gps GPS.txt --out out/park\n"
      "  rhec estimate scenarios/victoria_park.yaml --dead-reckoning DRS.txt --gps GPS.txt --hold-out 5 --variant ekf");
  command->add_option("scenario", arguments->scenario, "a YAML file")->required();
  command
      ->add_option("--dead-reckoning", arguments->dead_reckoning, "time [s], wheel speed [m/s], steering angle [rad]")
      ->type_name("FILE")
      ->required();
  command->add_option("--gps", arguments->gps, "time [s], x [m], y [m]")->type_name("FILE")->required();
  command->add_option("--hold-out", arguments->hold_out, "withhold one of so many fixes and predict it; 0: none")
      ->check(CLI::Range(0, 1000000))
      ->capture_default_str();
  command
      ->add_option("--hold-out-phase", arguments->phase,
                   "place of the first one withheld, from 0; default: the last of them")
      ->check(CLI::Range(0, 1000000));
  command->add_option("--variant", arguments->variants, "run this variant alone; may be given several times")
      ->expected(1)
      ->allow_extra_args(false)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  command
      ->add_option("--set", arguments->assignments,
                   "KEY=VALUE over any key of the scenario; may be given several times")
      ->expected(1)
      ->allow_extra_args(false)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  command->add_option("--out", arguments->out, "folder of the results")->capture_default_str();
  add_plugin_path(*command, arguments->plugin_path);
  command->callback([&chosen, arguments] { chosen = [arguments] { return estimate(*arguments); }; });
}

}  // namespace rhec::apps
