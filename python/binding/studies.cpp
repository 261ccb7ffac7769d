#include <fmt/format.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <algorithm>
#include <filesystem>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "binding.hpp"
#include "columns.hpp"
#include "drives.hpp"
#include "hosts.hpp"
#include "jobs.hpp"
#include "rhec/core/base/error.hpp"
#include "rhec/logs/files/open_log.hpp"
#include "rhec/sim/replay/replay_scenario.hpp"
#include "rhec/sim/store/sweep_store.hpp"
#include "rhec/sim/study/sweep.hpp"
#include "rhec/sim/study/sweep_runner.hpp"
#include "rhec/sim/tuning/controller_tuning.hpp"
#include "rhec/sim/tuning/drive_tuning.hpp"
#include "rhec/sim/tuning/log_tuning.hpp"

namespace rhec::python {
namespace {

int threads_of(int given) {
  return given > 0 ? given : std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
}

/// The rows of a sweep's runs, in the order of the grid; texts are JSON.
py::list rows_of(const sim::Sweep& sweep, const std::vector<sim::RunIdentity>& runs,
                 const std::vector<sim::SweepRow>& rows) {
  std::map<sim::RunIdentity, const sim::SweepRow*> by_identity;
  for (const sim::SweepRow& row : rows) by_identity[row.identity] = &row;
  py::list made;
  for (std::size_t i = 0; i < runs.size(); ++i) {
    const auto found = by_identity.find(runs[i]);
    if (found == by_identity.end()) continue;
    const sim::SweepRow& row = *found->second;
    py::dict each;
    each["run"] = i;
    each["identity"] = row.identity.text();
    each["assignments"] = sweep.assignments(static_cast<std::int64_t>(i));
    each["configuration"] = row.configuration;
    each["status"] = std::string(sim::name_of(row.status));
    each["reason"] = row.reason;
    each["steps"] = row.steps;
    each["solves"] = row.solves;
    each["fallbacks"] = row.fallbacks;
    each["nees"] = row.nees;
    each["mae"] = row.mae;
    each["rmse"] = row.rmse;
    each["mae_after_start"] = row.mae_after_start;
    each["solve_time_us"] = row.solve_time_us;
    each["seconds"] = row.seconds;
    made.append(each);
  }
  return made;
}

py::dict sweep(const std::vector<std::string>& plugin_path, const Settings& settings, const std::string& file,
               const std::string& program, int threads, const py::object& progress) {
  const sim::Sweep grid(settings);
  std::vector<sim::RunIdentity> runs;
  std::vector<sim::SweepRow> rows;
  sim::SweepProgress done;
  do_watched(progress, [&](Job& job) {
    const Host host = examined_host(plugin_path);
    grid.check_values(host, [&] { job.show(0.0, "looking at values"); });
    runs = grid.identities();
    sim::SweepStore store(file, program);
    sim::ThreadWorkers workers(host, grid, threads_of(threads));
    done = sim::run_sweep(grid, store, workers,
                          {.progress =
                               [&](const sim::SweepProgress& now) {
                                 if (job.is_stopped()) return;
                                 const auto there = static_cast<double>(now.there + now.made);
                                 job.show(now.total > 0 ? there / static_cast<double>(now.total) : 1.0,
                                          fmt::format("{} of {} runs", now.there + now.made, now.total));
                               },
                           .stop = [&] { return job.is_stopped(); }});
    rows = store.rows();
  });
  py::dict made;
  made["name"] = grid.name();
  made["made"] = done.made;
  made["rows"] = rows_of(grid, runs, rows);
  return made;
}

sim::TuningHooks hooks_of(Job& job, double most_seconds) {
  return {.progress =
              [&job, most_seconds](const sim::TuningProgress& now) {
                if (job.is_stopped()) return;
                job.show(std::isfinite(most_seconds) ? std::min(1.0, now.seconds / most_seconds) : NAN,
                         fmt::format("{}, {} evaluations", now.stage, now.evaluations));
              },
          .stop = [&job] { return job.is_stopped(); }};
}

py::dict compared(const std::vector<sim::Compared>& figures) {
  Columns columns(figures);
  using sim::Compared;
  columns.objects("name", [](const Compared& c) { return c.name; });
  columns.numbers("before", [](const Compared& c) { return c.before; });
  columns.numbers("after", [](const Compared& c) { return c.after; });
  columns.numbers("change_lower", [](const Compared& c) { return c.change_interval.first; });
  columns.numbers("change_upper", [](const Compared& c) { return c.change_interval.second; });
  return columns.take();
}

/// What is wished of the tuning of a log.
sim::LogTuningOptions log_options_of(const py::dict& wishes) {
  sim::LogTuningOptions options;
  options.hold_out = hold_out_of(wishes["hold_out"].cast<int>(), -1);
  options.wishes = {wishes["tune"].cast<std::vector<std::string>>(), wishes["keep"].cast<std::vector<std::string>>()};
  options.threads = threads_of(wishes["threads"].cast<int>());
  options.smooths = wishes["smoother"].cast<bool>();
  options.most_seconds = wishes["most_seconds"].cast<double>();
  return options;
}

py::dict dict_of(const sim::LogTuning& tuning) {
  Columns numbers(tuning.numbers);
  using sim::TunedNumber;
  numbers.objects("name", [](const TunedNumber& n) { return n.tunable.name; });
  numbers.objects("unit", [](const TunedNumber& n) { return n.tunable.unit; });
  numbers.numbers("before", [](const TunedNumber& n) { return n.tunable.start; });
  numbers.numbers("after", [](const TunedNumber& n) { return n.value; });
  numbers.numbers("error", [](const TunedNumber& n) { return n.error; });
  numbers.objects("is_told", [](const TunedNumber& n) { return n.is_told; });
  numbers.objects("is_at_bound", [](const TunedNumber& n) { return n.is_at_bound; });
  py::dict made;
  made["numbers"] = numbers.take();
  made["judged"] = compared(tuning.judged);
  made["yaml"] = sim::tuned_yaml(tuning, "from Python");
  made["summary"] = sim::summary_json(tuning);
  made["svg"] = sim::tuning_svg(tuning);
  made["remarks"] = tuning.remarks;
  return made;
}

/// On dead reckoning and fixes.
py::dict tune_log(const std::vector<std::string>& plugin_path, const Settings& settings,
                  const std::string& dead_reckoning, const std::string& gps, const py::dict& wishes,
                  const py::object& progress) {
  const sim::LogTuningOptions options = log_options_of(wishes);
  const auto variants = wishes["variants"].cast<std::vector<std::string>>();
  sim::LogTuning tuning;
  do_watched(progress, [&](Job& job) {
    const Host host = examined_host(plugin_path);
    const sim::LogScenario scenario(host, settings, variants);
    tuning = sim::tune_on_log(host, scenario.variants().front().settings, sim::read_log_tables(dead_reckoning, gps),
                              options, hooks_of(job, options.most_seconds));
  });
  return dict_of(tuning);
}

/// On a log with the vehicle's own sensors.
py::dict tune_drive(const std::vector<std::string>& plugin_path, const Settings& settings, const DriveLog& log,
                    const py::dict& wishes, const py::object& progress) {
  const sim::LogTuningOptions options = log_options_of(wishes);
  sim::LogTuning tuning;
  do_watched(progress, [&](Job& job) {
    const Host host = examined_host(plugin_path);
    const sim::ReplayScenario scenario(host, settings, log.variants);
    const sim::ReplayVariant& variant = scenario.variants().front();
    const auto file = logs::open_log(log.file, {.msg_paths = {log.msg_paths.begin(), log.msg_paths.end()}});
    const logs::Drive drive = logs::read_drive(*file, variant.signals);
    if (drive.damage) job.tell({drive.damage->what});
    tuning = sim::tune_on_drive(host, variant.settings, drive, options, hooks_of(job, options.most_seconds));
  });
  return dict_of(tuning);
}

py::dict tune_controller(const std::vector<std::string>& plugin_path, const Settings& settings,
                         const std::vector<std::pair<std::string, Settings>>& given, const py::dict& wishes,
                         const py::object& progress) {
  std::vector<sim::DrivingCase> cases;
  cases.reserve(given.size());
  for (const auto& [name, world] : given) cases.push_back({name, world});
  sim::ControllerTuningOptions options;
  options.first_seed = wishes["first_seed"].cast<int>();
  options.seeds = wishes["seeds"].cast<int>();
  options.judge_first_seed = options.first_seed + options.seeds;
  options.judges = wishes["judges"].cast<int>();
  options.effort = wishes["effort"].cast<double>();
  options.threads = threads_of(wishes["threads"].cast<int>());
  options.most_evaluations = wishes["evaluations"].cast<int>();
  options.most_seconds = wishes["most_seconds"].cast<double>();
  sim::ControllerTuning tuning;
  do_watched(progress, [&](Job& job) {
    tuning =
        sim::tune_controller(examined_host(plugin_path), settings, cases, options, hooks_of(job, options.most_seconds));
  });
  const std::vector<double>& chosen = tuning.tried[static_cast<std::size_t>(tuning.chosen)].values;
  py::dict made, numbers;
  std::vector<std::string> names;
  std::vector<double> before;
  for (const sim::Tunable& number : tuning.numbers) {
    names.push_back(number.name);
    before.push_back(number.start);
  }
  numbers["name"] = py::module_::import("numpy").attr("array")(names);
  numbers["before"] = copy(before);
  numbers["after"] = copy(chosen);
  made["numbers"] = numbers;
  made["judged"] = compared(tuning.judged);
  made["yaml"] = sim::tuned_yaml(tuning, "from Python");
  made["summary"] = sim::summary_json(tuning);
  made["svg"] = sim::pareto_svg(tuning);
  made["remarks"] = py::list();
  return made;
}

}  // namespace

void bind_studies(py::module_& module) {
  module.def("sweep", &sweep, py::arg("plugin_path"), py::arg("settings"), py::arg("file"), py::arg("program"),
             py::arg("threads"), py::arg("progress"));
  module.def("tune_log", &tune_log, py::arg("plugin_path"), py::arg("settings"), py::arg("dead_reckoning"),
             py::arg("gps"), py::arg("wishes"), py::arg("progress"));
  module.def("tune_drive", &tune_drive, py::arg("plugin_path"), py::arg("settings"), py::arg("log"), py::arg("wishes"),
             py::arg("progress"));
  module.def("tune_controller", &tune_controller, py::arg("plugin_path"), py::arg("settings"), py::arg("cases"),
             py::arg("wishes"), py::arg("progress"));
}

}  // namespace rhec::python
