#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <thread>
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
#include "rhec/sim/tuning/controller_tuning.hpp"
#include "rhec/sim/tuning/drive_tuning.hpp"
#include "rhec/sim/tuning/innovations.hpp"
#include "rhec/sim/tuning/log_tuning.hpp"
#include "stop_request.hpp"

namespace rhec::apps {
namespace {

struct TuneArguments : LogArguments {
  std::vector<std::string> tune, keep;
  int threads = 0, most_seconds = 0;
  bool no_smoother = false;
  // of a controller
  bool controller = false;
  int seeds = 3, first_seed = 1, judges = 6, evaluations = 40;
  double effort = 1.0;
  std::vector<std::string> cases;
};

std::string tails_text(double degrees) {
  return degrees < sim::normal_degrees ? fmt::format("{:.1f} degrees of freedom", degrees) : "normal";
}

void print_numbers(const sim::LogTuning& tuning) {
  fmt::print("{:<36} {:>11} {:>11} {:>11}  {}\n", "NUMBER", "BEFORE", "AFTER", "STD. ERROR", "UNIT");
  for (const sim::TunedNumber& number : tuning.numbers) {
    const bool has_error = std::isfinite(number.error) && number.is_told && !number.is_at_bound;
    fmt::print("{:<36} {:>11.4g} {:>11.4g} {:>11}  {}{}{}\n", number.tunable.name, number.tunable.start, number.value,
               has_error ? fmt::format("{:.2g}", number.error) : "-", number.tunable.unit,
               number.is_told ? "" : "  (not told)", number.is_at_bound ? "  (at its bound)" : "");
  }
  for (std::size_t i = 0; i < tuning.laws.size(); ++i) {
    const sim::TriedLaw& law = tuning.laws[i];
    if (i == 0) fmt::print("\n{:<36} {:>11} {:>11}\n", "LAW TRIED", "GAIN", "STD. ERROR");
    fmt::print("{:<36} {:>11.1f} {:>11.1f}{}\n", fmt::format("{}: {}", law.key, law.law), law.gain, law.gain_error,
               law.is_taken ? "  taken" : "");
  }
  if (!tuning.estimators.empty())
    fmt::print("\n{:<36} {:>11} {:>11}\n", "ESTIMATOR, ON WHAT WAS TUNED ON", "MEDIAN",
               fmt::format("RMSE({:g} {})", sim::error_cap, tuning.unit));
  for (const sim::TriedEstimator& tried : tuning.estimators)
    fmt::print("{:<36} {:>9.4f} {} {:>9.4f} {}{}\n", tried.name, tried.median, tuning.unit, tried.rmse, tuning.unit,
               tried.is_taken ? "  taken" : "");
}

void print_judgement(const sim::LogTuning& tuning) {
  fmt::print("\nlog likelihood of {} {}: {:.1f} before, {:.1f} after; tails: {} before, {} after\n", tuning.fixes,
             tuning.entries_name, tuning.log_likelihood_before, tuning.log_likelihood_after,
             tails_text(tuning.degrees_before), tails_text(tuning.degrees_after));
  if (tuning.judged.empty()) {
    fmt::print("nothing judges the result, since no {} was withheld; --hold-out 5 withholds every fifth\n",
               tuning.entry_name);
  } else {
    for (const sim::TunedSensor& sensor : tuning.sensors) {
      if (&sensor == tuning.sensors.data())
        fmt::print("\n{:<36} {:>11} {:>11}\n", "INNOVATIONS: NIS / EXPECTED", "BEFORE", "AFTER");
      fmt::print("{:<36} {:>11.2f} {:>11.2f}\n", sensor.name, sensor.before / sensor.expected,
                 sensor.after / sensor.expected);
    }
    fmt::print("\n{:<36} {:>11} {:>11}  {:<22} {}\n", "NOT TUNED ON", "BEFORE", "AFTER", "AFTER, 95 %", "CHANGE, 95 %");
    for (const sim::Compared& figure : tuning.judged)
      fmt::print("{:<36} {:>11.4f} {:>11.4f}  {:<22} {} to {}\n", figure.name, figure.before, figure.after,
                 fmt::format("{:.4f} to {:.4f}", figure.after_interval.first, figure.after_interval.second),
                 fmt::format("{:+.4f}", figure.change_interval.first),
                 fmt::format("{:+.4f}", figure.change_interval.second));
  }
  if (!tuning.remarks.empty()) fmt::print("\nWhat this log does not tell:\n");
  for (const std::string& remark : tuning.remarks) fmt::print("  - {}\n", remark);
}

int threads_of(const TuneArguments& arguments) {
  return arguments.threads > 0 ? arguments.threads : std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
}

sim::LogTuningOptions log_options_of(const TuneArguments& arguments) {
  sim::LogTuningOptions options{.hold_out = read_hold_out(arguments), .wishes = {arguments.tune, arguments.keep}};
  options.threads = threads_of(arguments);
  options.smooths = !arguments.no_smoother;
  if (arguments.most_seconds > 0) options.most_seconds = arguments.most_seconds;
  return options;
}

using TunesLog = std::function<sim::LogTuning(const sim::LogTuningOptions&, const sim::TuningHooks&)>;

/// Tunes on a recorded drive of either kind; `origin` says on which, of which scenario.
int tune_on_log(const TuneArguments& arguments, const std::string& variant, const std::string& origin,
                const TunesLog& tunes) {
  sim::OutputFolder folder(out_of(arguments.out, arguments.scenario, "_tune"));
  sim::LogTuning tuning;
  {
    const StopRequest stop;
    StageLine line(variant);
    tuning = tunes(log_options_of(arguments),
                   {.progress =
                        [&](const sim::TuningProgress& now) {
                          line.show(fmt::format("{}, {} evaluations, log likelihood {:+.1f}, {:.0f} s", now.stage,
                                                now.evaluations, now.gain, now.seconds));
                        },
                    .stop = [] { return StopRequest::asked(); }});
  }
  folder.write("tuned.yaml", sim::tuned_yaml(tuning, origin));
  const std::string summary = sim::summary_json(tuning);
  folder.write("summary.json", summary);
  folder.write("tuning.svg", sim::tuning_svg(tuning));
  folder.commit();
  if (arguments.json) {
    print_json(summary, folder.path());
  } else {
    print_numbers(tuning);
    print_judgement(tuning);
    if (tuning.stopped) fmt::print("\nstopped: this is the best that was found until then\n");
    fmt::print("\n{} evaluations, {:.0f} s; the scenario to use: {}\n", tuning.evaluations, tuning.seconds,
               (folder.path() / "tuned.yaml").string());
  }
  const bool says_anything =
      std::any_of(tuning.numbers.begin(), tuning.numbers.end(), [](const auto& number) { return number.is_told; });
  return tuning.stopped || !says_anything ? exit_not_solved : exit_fine;
}

int tune_on_tables(const TuneArguments& arguments) {
  const sim::LogScenario scenario = read_log_scenario(arguments);
  const sim::LogVariant& variant = scenario.variants().front();
  const sim::LogTables tables = sim::read_log_tables(arguments.dead_reckoning, arguments.gps);
  const Host host = examined_host(arguments.plugin_path);
  return tune_on_log(arguments, variant.name, fmt::format("from {} ({})", arguments.scenario, variant.name),
                     [&](const sim::LogTuningOptions& options, const sim::TuningHooks& hooks) {
                       return sim::tune_on_log(host, variant.settings, tables, options, hooks);
                     });
}

/// "speed=2; path.laps=1" over the scenario.
sim::DrivingCase driving_case(const Settings& scenario, const std::string& text) {
  sim::DrivingCase result{text, scenario};
  for (std::size_t from = 0; from < text.size();) {
    const std::size_t end = std::min(text.find(';', from), text.size());
    const std::size_t first = text.find_first_not_of(' ', from);
    if (first < end) apply_assignment(result.settings, text.substr(first, end - first));
    from = end + 1;
  }
  return result;
}

void print_controller(const sim::ControllerTuning& tuning, const std::filesystem::path& folder) {
  const sim::TriedController& chosen = tuning.tried[static_cast<std::size_t>(tuning.chosen)];
  fmt::print("{:<36} {:>11} {:>11}\n", "NUMBER", "BEFORE", "AFTER");
  for (std::size_t i = 0; i < tuning.numbers.size(); ++i)
    fmt::print("{:<36} {:>11.4g} {:>11.4g}\n", tuning.numbers[i].name, tuning.numbers[i].start, chosen.values[i]);
  fmt::print("\non the seeds tuned on: tracking {:.3f}, effort {:.3f} of the scenario's\n", chosen.tracking,
             chosen.effort);
  if (tuning.chosen == 0) fmt::print("nothing that was tried tracks better within the effort that is allowed\n");
  if (!tuning.judged.empty())
    fmt::print("\n{:<34} {:>10} {:>10}  {}\n", "SEEDS NOT TUNED ON", "BEFORE", "AFTER", "RATIO, 95 %");
  for (const sim::Compared& figure : tuning.judged)
    fmt::print("{:<34} {:>10.4f} {:>10.4f}  {}\n", figure.name, figure.before, figure.after,
               figure.change_interval.second > 0.0
                   ? fmt::format("{:.3f} to {:.3f}", figure.change_interval.first, figure.change_interval.second)
                   : "");
  if (tuning.stopped) fmt::print("\nstopped: this is the best that was found until then\n");
  fmt::print("\n{} controllers in {} runs, {:.0f} s; figure: {}; the scenario to use: {}\n", tuning.tried.size(),
             tuning.runs, tuning.seconds, (folder / "pareto.svg").string(), (folder / "tuned.yaml").string());
}

int tune_controller(const TuneArguments& arguments) {
  Settings settings = load_scenario(arguments.scenario);
  apply_assignments(settings, arguments.assignments);
  std::vector<sim::DrivingCase> cases;
  for (const std::string& text : arguments.cases) cases.push_back(driving_case(settings, text));
  if (cases.empty()) cases.push_back({"as it is", settings});
  sim::ControllerTuningOptions options;
  options.first_seed = arguments.first_seed;
  options.seeds = arguments.seeds;
  options.judge_first_seed = arguments.first_seed + arguments.seeds;
  options.judges = arguments.judges;
  options.effort = arguments.effort;
  options.threads = threads_of(arguments);
  options.most_evaluations = arguments.evaluations;
  if (arguments.most_seconds > 0) options.most_seconds = arguments.most_seconds;
  sim::OutputFolder folder(out_of(arguments.out, arguments.scenario, "_tune"));
  const Host host = examined_host(arguments.plugin_path);
  sim::ControllerTuning tuning;
  {
    const StopRequest stop;
    StageLine line("controller");
    tuning = sim::tune_controller(
        host, settings, cases, options,
        {.progress =
             [&](const sim::TuningProgress& now) {
               line.show(fmt::format("{}, {} runs, {:.0f} s", now.stage, now.evaluations, now.seconds));
             },
         .stop = [] { return StopRequest::asked(); }});
  }
  folder.write("tuned.yaml", sim::tuned_yaml(tuning, "from " + arguments.scenario));
  const std::string summary = sim::summary_json(tuning);
  folder.write("summary.json", summary);
  folder.write("pareto.csv", sim::pareto_csv(tuning));
  folder.write("pareto.svg", sim::pareto_svg(tuning));
  folder.commit();
  if (arguments.json)
    print_json(summary, folder.path());
  else
    print_controller(tuning, folder.path());
  return tuning.stopped ? exit_not_solved : exit_fine;
}

int tune_on_drive(const TuneArguments& arguments) {
  Settings settings = load_scenario(arguments.scenario);
  apply_assignments(settings, arguments.assignments);
  const Host host = examined_host(arguments.plugin_path);
  const sim::ReplayScenario scenario(host, settings, arguments.variants);
  const sim::ReplayVariant& variant = scenario.variants().front();
  const logs::Drive drive = logs::read_drive(*open_log(arguments.log, arguments.msg_paths), variant.signals);
  tell_damage(drive.damage);
  return tune_on_log(arguments, variant.name,
                     fmt::format("on {}, from {} ({})", arguments.log, arguments.scenario, variant.name),
                     [&](const sim::LogTuningOptions& options, const sim::TuningHooks& hooks) {
                       return sim::tune_on_drive(host, variant.settings, drive, options, hooks);
                     });
}

int tune(const TuneArguments& arguments) {
  if (!arguments.log.empty()) {
    if (arguments.controller) throw Error("--controller is tuned in simulation; leave the log away");
    if (names_log(arguments, "tune")) return tune_on_drive(arguments);
  }
  if (arguments.controller) {
    if (!arguments.dead_reckoning.empty() || !arguments.gps.empty())
      throw Error("--controller is tuned in simulation; leave --dead-reckoning and --gps away");
    return tune_controller(arguments);
  }
  if (arguments.dead_reckoning.empty() || arguments.gps.empty())
    throw Error("expected a LOG, or --dead-reckoning FILE and --gps FILE, a recorded drive; or --controller");
  return tune_on_tables(arguments);
}

}  // namespace

void add_tune(Program& program) {
  auto arguments = std::make_shared<TuneArguments>();
  arguments->hold_out = 5;
  Command command = program.add(
      "tune", "Finds an estimator's numbers from a recorded drive, or a controller's weights in simulation.",
      "From a drive: the noise of sensors, priors, biases, lever arms and delays that make the fixes most likely, "
      "each\n"
      "given all before it. Fixes that --hold-out withholds are not tuned on, and judge the result. Writes tuned.yaml, "
      "a\n"
      "scenario for 'rhec estimate', summary.json and tuning.svg to the output folder.\n\n"
      "A LOG with the vehicle's own sensors is one as 'rhec estimate' reads it; measurements of all sensors count "
      "then.\n\n"
      "With --controller: weights and horizon by which the vehicle of the scenario tracks its path best without more\n"
      "effort, over several seeds; others judge the result. Writes tuned.yaml, a scenario for 'rhec run', "
      "summary.json,\n"
      "pareto.csv and pareto.svg.\n\n"
      "docs/tune.md says how to read the tables. Ctrl-C keeps the best so far and writes it; the exit code is 3 then, "
      "and\n"
      "where the log says nothing.\n\n"
      "Examples:\n"
      "  rhec tune my_robot.yaml drive.mcap --out out/tuned\n"
      "  rhec tune scenarios/victoria_park.yaml --dead-reckoning DRS.txt --gps GPS.txt --out out/tuned\n"
      "  rhec tune scenarios/victoria_park.yaml --dead-reckoning DRS.txt --gps GPS.txt --keep log --tune "
      "model.wheelbase\n"
      "  rhec tune scenarios/figure8.yaml --controller --case speed=2 --case speed=8 --out out/tuned",
      [arguments] { return tune(*arguments); });
  add_log_arguments(command, "tune", *arguments, "5");
  command.add_list("--tune", arguments->tune, "tune this number of the scenario, too; may be given several times")
      .value("KEY[=[LOWER, UPPER]]");
  command
      .add_list("--keep", arguments->keep,
                "do not tune what begins with this key, e.g. log, or noise.inputs; may be given several times")
      .value("KEY");
  command.add("--threads", arguments->threads, "evaluations at the same time; otherwise as many as there are cores")
      .value("N")
      .within(1, 4096);
  command.add("--most-seconds", arguments->most_seconds, "search no longer than this; otherwise to the end")
      .value("N")
      .within(1, 1000000);
  command.add_flag("--no-smoother", arguments->no_smoother, "do not judge by the smoother, which takes longest");
  command.add_flag("--controller", arguments->controller, "tune a controller in simulation");
  command.add("--seeds", arguments->seeds, "of a controller: drives to tune on, in every case")
      .within(1, 1000)
      .shows_default();
  command.add("--first-seed", arguments->first_seed, "of these; those that judge follow them")
      .within(0, 1000000)
      .shows_default();
  command.add("--judges", arguments->judges, "of a controller: drives that judge the result, in every case")
      .within(2, 1000)
      .shows_default();
  command
      .add("--effort", arguments->effort, "of a controller: at most so many times the inputs' changes of the scenario")
      .positive()
      .shows_default();
  command.add("--evaluations", arguments->evaluations, "of a controller: tried for each of four trade-offs, at most")
      .within(5, 100000)
      .shows_default();
  command
      .add_list("--case", arguments->cases,
                "of a controller: tune for these worlds; otherwise for the scenario as it is")
      .value("KEY=VALUE[; ...]");
}

}  // namespace rhec::apps
