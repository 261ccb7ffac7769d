#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <memory>
#include <string>
#include <vector>

#include "binding.hpp"
#include "columns.hpp"
#include "drives.hpp"
#include "hosts.hpp"
#include "jobs.hpp"
#include "rhec/sim/files/output_folder.hpp"
#include "rhec/sim/horizons/horizon_log.hpp"
#include "rhec/sim/logs/recorded_log.hpp"
#include "rhec/sim/logs/smoothing.hpp"
#include "rhec/sim/maps/map_keeper.hpp"

namespace rhec::python {
namespace {

struct LogFiles {
  std::string dead_reckoning, gps;
  std::vector<std::string> variants;
  sim::HoldOut hold_out;
};

/// A recorded drive, and what each variant of a scenario made of it.
struct Replays {
  std::unique_ptr<const sim::LogScenario> scenario;
  sim::RecordedLog log;
  sim::HoldOut hold_out;
  std::vector<sim::Replay> replays;
  std::vector<Report> reports;  ///< of a smoother, by variant
  std::string horizons;
};

py::dict estimates_of(const Replays& self, std::size_t index) {
  const sim::Replay& replay = self.replays.at(index);
  const ModelDescription& about = self.scenario->variants().front().robot.model()->description();
  using sim::LoggedEstimate;
  Columns columns(replay.estimates);
  const auto fix_of = [&](const LoggedEstimate& e) {
    return e.fix >= 0 ? self.log.fixes[static_cast<std::size_t>(e.fix)] : sim::Fix{0.0, NAN, NAN};
  };
  const auto values = [](const LoggedEstimate& e) -> const auto& { return e.values; };
  const auto sigmas = [](const LoggedEstimate& e) -> const auto& { return e.sigmas; };
  columns.numbers("time", [](const LoggedEstimate& e) { return e.time; });
  columns.objects("kind", [](const LoggedEstimate& e) { return e.fix >= 0 ? "fix" : "node"; });
  columns.variables("", about.states, values);
  columns.variables("", about.parameters, values, about.states.size());
  columns.variables("sigma_", about.states, sigmas);
  columns.variables("sigma_", about.parameters, sigmas, about.states.size());
  columns.numbers("fix_x", [&](const LoggedEstimate& e) { return fix_of(e).x; });
  columns.numbers("fix_y", [&](const LoggedEstimate& e) { return fix_of(e).y; });
  columns.numbers("residual", [](const LoggedEstimate& e) { return e.residual; });
  columns.objects("held_out", [](const LoggedEstimate& e) { return e.held_out; });
  columns.objects("fallback", [](const LoggedEstimate& e) { return e.fallback; });
  return columns.take();
}

std::string replay_summary(const Replays& self) {
  return sim::summary_json(self.replays, self.log, *self.scenario, self.hold_out);
}

/// Of a smoother the causal estimates stand behind the smoothed ones, and are compared with them.
std::string replay_picture(const Replays& self) {
  const bool is_smoothed = !self.reports.empty();
  return sim::replay_svg(self.replays.front(), self.log, *self.scenario, is_smoothed ? &self.replays[1] : nullptr);
}

void save_replays(const Replays& self, const std::string& name) {
  sim::OutputFolder folder(name);
  folder.write("estimates.csv", sim::estimates_csv(self.replays, self.log, *self.scenario));
  folder.write("summary.json", replay_summary(self));
  folder.write("times.csv", sim::times_csv(self.replays));
  folder.write("horizons.jsonl", self.horizons);
  folder.write("run.svg", replay_picture(self));
  folder.commit();
}

void read_log(const std::vector<std::string>& plugin_path, const Settings& settings, const LogFiles& files,
              Replays& made, Job& job) {
  made.scenario = std::make_unique<const sim::LogScenario>(examined_host(plugin_path), settings, files.variants);
  job.tell(made.scenario->variants().front().robot.notes());
  made.log = sim::read_recorded_log(files.dead_reckoning, files.gps, *made.scenario);
  made.hold_out = files.hold_out;
}

/// The share of all variants that is done.
auto share_of(Job& job, const sim::LogScenario& scenario, std::size_t index) {
  const auto count = static_cast<double>(scenario.variants().size());
  const std::string& name = scenario.variants()[index].name;
  return [&job, count, index, name](double share) { job.show((static_cast<double>(index) + share) / count, name); };
}

std::unique_ptr<Replays> estimate_log(const std::vector<std::string>& plugin_path, const Settings& settings,
                                      const LogFiles& files, const py::object& progress) {
  auto made = std::make_unique<Replays>();
  do_watched(progress, [&](Job& job) {
    read_log(plugin_path, settings, files, *made, job);
    std::vector<sim::HorizonLog> horizons;
    std::vector<std::shared_ptr<sim::MapKeeper>> keepers;
    const double seconds = made->log.rows.back().time - made->log.rows.front().time;
    const auto& variants = made->scenario->variants();
    for (std::size_t i = 0; i < variants.size(); ++i) {
      const auto nodes = static_cast<std::int64_t>(seconds / variants[i].robot.step()) + std::ssize(made->log.fixes);
      horizons.emplace_back(variants[i].robot, nodes);
      keepers.push_back(std::make_shared<sim::MapKeeper>());
      made->replays.push_back(
          sim::replay(variants[i].robot, made->log, made->scenario->log(), made->hold_out,
                      {.progress = share_of(job, *made->scenario, i),
                       .sampled = [&](const sim::LoopSample& sample) { horizons.back().take(sample); },
                       .robot = keepers.back()}));
      made->replays.back().name = variants[i].name;
    }
    made->horizons = sim::horizons_text(horizons, made->log, *made->scenario, made->hold_out);
    for (const auto& keeper : keepers) keeper->save();
  });
  return made;
}

std::unique_ptr<Replays> smooth_log(const std::vector<std::string>& plugin_path, const Settings& settings,
                                    const LogFiles& files, const py::object& progress) {
  auto made = std::make_unique<Replays>();
  do_watched(progress, [&](Job& job) {
    read_log(plugin_path, settings, files, *made, job);
    std::vector<sim::HorizonLog> none;
    const auto& variants = made->scenario->variants();
    for (std::size_t i = 0; i < variants.size(); ++i) {
      sim::SmoothedReplay result = sim::smooth(variants[i].name, variants[i].robot, made->log, made->scenario->log(),
                                               made->hold_out, {.progress = share_of(job, *made->scenario, i)});
      made->reports.push_back(result.report);
      made->replays.push_back(std::move(result.smoothed));
      made->replays.push_back(std::move(result.causal));
      none.emplace_back(variants[i].robot, 1);
      none.emplace_back(variants[i].robot, 1);
    }
    made->horizons = sim::horizons_text(none, made->log, *made->scenario, made->hold_out, {"", sim::causal_suffix});
  });
  return made;
}

}  // namespace

void bind_logs(py::module_& module) {
  py::class_<LogFiles>(module, "LogFiles")
      .def(py::init([](const std::string& dead_reckoning, const std::string& gps,
                       const std::vector<std::string>& variants, int hold_out, int phase) {
             return LogFiles{dead_reckoning, gps, variants, hold_out_of(hold_out, phase)};
           }),
           py::arg("dead_reckoning"), py::arg("gps"), py::arg("variants"), py::arg("hold_out"), py::arg("phase"));
  py::class_<Replays>(module, "Replays")
      .def_property_readonly("names",
                             [](const Replays& self) {
                               std::vector<std::string> names;
                               for (const sim::Replay& replay : self.replays) names.push_back(replay.name);
                               return names;
                             })
      .def_property_readonly("summary_json", &replay_summary)
      .def_readonly("reports", &Replays::reports)
      .def("estimates", &estimates_of, py::arg("index"))
      .def("svg", &replay_picture)
      .def("save", &save_replays, py::arg("folder"));
  module.def("estimate_log", &estimate_log, py::arg("plugin_path"), py::arg("settings"), py::arg("files"),
             py::arg("progress"));
  module.def("smooth_log", &smooth_log, py::arg("plugin_path"), py::arg("settings"), py::arg("files"),
             py::arg("progress"));
}

}  // namespace rhec::python
