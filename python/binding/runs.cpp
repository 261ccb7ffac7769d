#include <fmt/format.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <cmath>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "binding.hpp"
#include "columns.hpp"
#include "hosts.hpp"
#include "jobs.hpp"
#include "rhec/sim/files/output_folder.hpp"
#include "rhec/sim/horizons/horizon_log.hpp"
#include "rhec/sim/loop/run_files.hpp"
#include "rhec/sim/loop/smoothed_drive.hpp"
#include "rhec/sim/maps/map_keeper.hpp"
#include "rhec/sim/problems/problem_file.hpp"
#include "rhec/sim/problems/problem_record.hpp"
#include "rhec/sim/telemetry/measurement_log.hpp"

namespace rhec::python {
namespace {

using ScenarioHandle = std::shared_ptr<const sim::Scenario>;

/// A drive that was simulated: as it was estimated while driving, and perhaps with hindsight.
struct Drive {
  ScenarioHandle scenario;
  sim::RunLog log;
  std::shared_ptr<const sim::RunLog> causal;  ///< of a smoothed drive: the estimates that drove
  std::string summary, horizons;
  std::vector<std::string> problems;  ///< lines of a problem file
  Report report;                      ///< of the smoother
};

py::dict steps_of(const Drive& drive) {
  const ModelDescription& about = drive.scenario->robot().estimated_description();
  Columns columns(drive.log.samples);
  using sim::Sample;
  columns.objects("step", [](const Sample& s) { return s.step; });
  columns.numbers("time", [](const Sample& s) { return s.time; });
  columns.variables(
      "true_", about.states, [](const Sample& s) -> const auto& { return s.true_state; });
  columns.variables(
      "true_", about.parameters, [](const Sample& s) -> const auto& { return s.true_parameters; });
  columns.variables(
      "", about.states, [](const Sample& s) -> const auto& { return s.state; });
  columns.variables(
      "", about.parameters, [](const Sample& s) -> const auto& { return s.parameters; });
  const auto sigma = [](const Sample& s) -> const auto& { return s.sigma; };
  columns.variables("sigma_", about.states, sigma);
  columns.variables("sigma_", about.parameters, sigma, about.states.size());
  columns.variables(
      "", about.inputs, [](const Sample& s) -> const auto& { return s.inputs; });
  columns.numbers("reference_x", [](const Sample& s) { return s.reference.x; });
  columns.numbers("reference_y", [](const Sample& s) { return s.reference.y; });
  columns.numbers("reference_heading", [](const Sample& s) { return s.reference.heading; });
  columns.numbers("reference_speed", [](const Sample& s) { return s.reference.speed; });
  columns.numbers("tracking", [](const Sample& s) { return s.tracking; });
  columns.numbers("heading_error", [](const Sample& s) { return s.heading_error; });
  columns.numbers("nees", [](const Sample& s) { return s.nees; });
  columns.objects("estimator_status", [](const Sample& s) { return name_of(s.estimator_status); });
  columns.objects("controller_status", [](const Sample& s) { return name_of(s.controller_status); });
  columns.objects("estimator_fallback", [](const Sample& s) { return s.estimator_fallback; });
  columns.objects("controller_fallback", [](const Sample& s) { return s.controller_fallback; });
  columns.objects("relaxed", [](const Sample& s) { return s.relaxed; });
  columns.objects("faults", [](const Sample& s) { return s.faults; });
  columns.objects("health", [](const Sample& s) { return name_of(s.health); });
  columns.objects("findings", [](const Sample& s) { return s.findings; });
  columns.numbers("rhe_us", [](const Sample& s) { return s.estimator_us; });
  columns.numbers("rhc_us", [](const Sample& s) { return s.controller_us; });
  return columns.take();
}

std::string svg_of(const Drive& drive) { return sim::run_svg(drive.log, *drive.scenario, drive.causal.get()); }

/// The files that the command line writes, for `rhec report`.
void save_drive(const Drive& drive, const std::string& folder_name) {
  sim::OutputFolder folder(folder_name);
  folder.write("steps.csv", sim::steps_csv(drive.log, *drive.scenario));
  folder.write("times.csv", sim::times_csv(drive.log));
  folder.write("summary.json", drive.summary);
  folder.write("horizons.jsonl", drive.horizons);
  folder.write("run.svg", svg_of(drive));
  folder.commit();
}

/// Keeps the problems of every n-th step of a loop, the last solve of each.
class ProblemKeeper {
 public:
  ProblemKeeper(const sim::Scenario& scenario, int every) : scenario_(scenario), every_(every) {}

  decltype(sim::LoopHooks::solved) hook() {
    if (every_ <= 0) return {};
    return
        [this](std::int64_t step, const HorizonProblem& problem, const Iterate& guess, const Iterate&, const Report&) {
          if (failure_ || step % every_ != 0) return;
          try {
            keep(step, problem, guess);
          } catch (...) {  // a solver must not throw; `lines` does
            failure_ = std::current_exception();
          }
        };
  }
  std::vector<std::string> lines() const {
    if (failure_) std::rethrow_exception(failure_);
    std::vector<std::string> all;
    for (const auto& [id, line] : lines_) all.push_back(line);
    return all;
  }

 private:
  void keep(std::int64_t step, const HorizonProblem& problem, const Iterate& guess) {
    const PluginChoice model = scenario_.robot().model_choice();
    const std::string id = fmt::format("{}/{}/{}", scenario_.options().name, problem.kind(), step);
    lines_[{std::string(problem.kind()), step}] =
        sim::problem_line(sim::record_of(problem, &guess, id, model.name, model.options));
  }

  const sim::Scenario& scenario_;
  int every_;
  std::map<std::pair<std::string, std::int64_t>, std::string> lines_;
  std::exception_ptr failure_;
};

std::unique_ptr<Drive> run_drive(const std::vector<std::string>& plugin_path, const Settings& settings,
                                 int problems_every, const std::string& log, const py::object& progress) {
  auto drive = std::make_unique<Drive>();
  do_watched(progress, [&](Job& job) {
    drive->scenario = std::make_shared<const sim::Scenario>(examined_host(plugin_path), settings);
    const sim::Scenario& scenario = *drive->scenario;
    job.tell(scenario.notes());
    const double samples = scenario.path().length() / (scenario.options().speed * scenario.robot().step());
    sim::HorizonLog horizons(scenario.robot(), static_cast<std::int64_t>(samples) + 1);
    const auto keeper = std::make_shared<sim::MapKeeper>();
    ProblemKeeper problems(scenario, problems_every);
    std::optional<sim::MeasurementLog> measured;
    if (!log.empty()) measured.emplace(log, scenario.robot().model()->description());
    sim::LoopHooks hooks{.progress = [&](double share) { job.show(share); },
                         .solved = problems.hook(),
                         .sampled = [&](const sim::LoopSample& sample) { horizons.take(sample); },
                         .robot = keeper};
    if (measured) measured->listen(hooks);
    drive->log = sim::run_closed_loop(scenario, hooks);
    if (measured) measured->close();
    drive->problems = problems.lines();
    drive->summary = sim::summary_json(sim::summarise(drive->log, scenario));
    drive->horizons = sim::horizons_text(horizons, drive->log, scenario);
    keeper->save();
  });
  return drive;
}

std::unique_ptr<Drive> smooth_drive(const std::vector<std::string>& plugin_path, const Settings& settings,
                                    const py::object& progress) {
  auto drive = std::make_unique<Drive>();
  do_watched(progress, [&](Job& job) {
    drive->scenario = std::make_shared<const sim::Scenario>(examined_host(plugin_path), settings);
    const sim::Scenario& scenario = *drive->scenario;
    job.tell(scenario.notes());
    sim::SmoothedDrive made = sim::smooth_closed_loop(scenario, {.progress = [&](double share) { job.show(share); }});
    drive->summary = sim::summary_json(made, scenario);
    drive->horizons = sim::horizons_text(sim::HorizonLog(scenario.robot(), 1), made.smoothed, scenario);
    drive->log = std::move(made.smoothed);
    drive->causal = std::make_shared<const sim::RunLog>(std::move(made.causal));
    drive->report = made.report;
  });
  return drive;
}

py::object causal_steps(const Drive& drive) {
  if (!drive.causal) return py::none();
  return steps_of({drive.scenario, *drive.causal, nullptr, {}, {}, {}, {}});
}

}  // namespace

void bind_runs(py::module_& module) {
  py::class_<Drive>(module, "Drive")
      .def_property_readonly("name", [](const Drive& self) { return self.scenario->options().name; })
      .def_property_readonly("completed", [](const Drive& self) { return self.log.completed; })
      .def_property_readonly("ended", [](const Drive& self) { return self.log.ended; })
      .def_readonly("summary_json", &Drive::summary)
      .def_readonly("problems", &Drive::problems)
      .def_readonly("report", &Drive::report)
      .def("steps", &steps_of)
      .def("causal_steps", &causal_steps)
      .def("svg", &svg_of)
      .def("save", &save_drive, py::arg("folder"));
  module.def("run", &run_drive, py::arg("plugin_path"), py::arg("settings"), py::arg("problems_every"), py::arg("log"),
             py::arg("progress"));
  module.def("smooth_drive", &smooth_drive, py::arg("plugin_path"), py::arg("settings"), py::arg("progress"));
}

}  // namespace rhec::python
