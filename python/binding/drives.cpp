// Logs with the vehicle's own sensors: estimated, and estimated with hindsight.
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <cmath>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "binding.hpp"
#include "columns.hpp"
#include "drives.hpp"
#include "hosts.hpp"
#include "jobs.hpp"
#include "rhec/core/base/error.hpp"
#include "rhec/logs/files/open_log.hpp"
#include "rhec/sim/horizons/horizon_log.hpp"
#include "rhec/sim/logs/smoothing.hpp"
#include "rhec/sim/maps/map_keeper.hpp"
#include "rhec/sim/replay/replay_input.hpp"
#include "rhec/sim/telemetry/track_writer.hpp"

namespace rhec::python {
namespace {

/// A log, and what each variant of a scenario made of it.
struct DriveReplays {
  std::unique_ptr<const sim::ReplayInput> input;
  std::vector<sim::DriveResult> results;  ///< of a smoother, the causal estimates behind the smoothed ones
  std::vector<Report> reports;            ///< of a smoother, by variant
  std::string horizons;                   ///< as in horizons.jsonl

  const Robot& robot() const { return input->scenario.variants().front().robot; }
  bool is_smoothed() const noexcept { return !reports.empty(); }
};

py::dict drive_estimates(const DriveReplays& self, std::size_t index) {
  using sim::DriveEstimate;
  const ModelDescription& about = self.robot().estimated_description();
  Columns columns(self.results.at(index).all.estimates);
  const auto values = [](const DriveEstimate& e) -> const auto& { return e.values; };
  const auto sigmas = [](const DriveEstimate& e) -> const auto& { return e.sigmas; };
  columns.numbers("time", [](const DriveEstimate& e) { return e.time; });
  columns.variables("", about.states, values);
  columns.variables("", about.parameters, values, about.states.size());
  columns.variables("sigma_", about.states, sigmas);
  columns.variables("sigma_", about.parameters, sigmas, about.states.size());
  columns.objects("fallback", [](const DriveEstimate& e) { return e.fallback; });
  columns.objects("health", [](const DriveEstimate& e) { return name_of(e.health); });
  columns.objects("findings", [](const DriveEstimate& e) { return e.findings; });
  return columns.take();
}

py::dict drive_innovations(const DriveReplays& self, std::size_t index) {
  using sim::DriveInnovation;
  const sim::DriveReplay& replay = self.results.at(index).all;
  const std::vector<Variable>& outputs = self.robot().model()->description().outputs;
  Columns columns(replay.innovations);
  columns.numbers("time", [](const DriveInnovation& i) { return i.time; });
  columns.objects("sensor",
                  [&](const DriveInnovation& i) { return replay.sensors[static_cast<std::size_t>(i.sensor)].name; });
  columns.objects("accepted", [](const DriveInnovation& i) { return i.accepted; });
  columns.numbers("nis", [](const DriveInnovation& i) { return i.nis; });
  for (std::size_t j = 0; j < outputs.size(); ++j) {
    columns.numbers(outputs[j].name,
                    [&](const DriveInnovation& i) { return sim::of_output(i.values, i, replay, static_cast<int>(j)); });
    columns.numbers("sigma_" + outputs[j].name,
                    [&](const DriveInnovation& i) { return sim::of_output(i.sigmas, i, replay, static_cast<int>(j)); });
  }
  return columns.take();
}

py::dict drive_predictions(const DriveReplays& self, std::size_t index) {
  using sim::DrivePrediction;
  const sim::DriveReplay& replay = self.results.at(index).withheld;
  Columns columns(replay.predictions);
  columns.numbers("time", [](const DrivePrediction& p) { return p.time; });
  columns.numbers("distance", [](const DrivePrediction& p) { return p.distance; });
  if (replay.withheld_sensor < 0) return columns.take();
  const Sensor& sensor = replay.sensors[static_cast<std::size_t>(replay.withheld_sensor)];
  for (std::size_t k = 0; k < sensor.outputs.size(); ++k) {
    const Variable& output = self.robot().model()->description().outputs[static_cast<std::size_t>(sensor.outputs[k])];
    columns.numbers("residual_" + output.name, [k](const DrivePrediction& p) { return p.residuals[k]; });
  }
  return columns.take();
}

std::string drive_summary(const DriveReplays& self) {
  return sim::drive_summary_json(self.results, self.input->scenario.name(), self.robot(), self.input->drives.front(),
                                 self.input->log, self.input->hold_out);
}

const sim::DriveReplay* causal_behind(const DriveReplays& self) {
  return self.is_smoothed() ? &self.results[1].all : nullptr;
}

std::string drive_picture(const DriveReplays& self) {
  return sim::drive_svg(self.results.front(), self.input->scenario.name(), self.robot(), self.input->drives.front(),
                        causal_behind(self));
}

void save_drive_files(const DriveReplays& self, const std::string& name) {
  sim::OutputFolder folder(name);
  sim::write_drive_files(folder, *self.input, self.results, causal_behind(self));
  folder.write("horizons.jsonl", self.horizons);
  folder.commit();
}

/// The estimates of the first variant, in the form that the file's name asks for.
void save_drive_track(const DriveReplays& self, const std::string& file) {
  const std::filesystem::path path(file);
  std::unique_ptr<sim::TrackWriter> writer;
  if (path.extension() == ".mcap")
    writer = sim::open_track_mcap(path, self.robot());
  else if (path.extension() == ".csv")
    writer = sim::open_track_csv(path, self.robot());
  else if (path.extension() == ".tum")
    writer = sim::open_track_tum(path, self.robot());
  else
    throw ArgumentError(file + ": expected a name that ends in .mcap, .csv or .tum");
  for (const sim::DriveEstimate& estimate : self.results.front().all.estimates)
    writer->write(sim::track_sample(estimate, self.robot(), self.input->drives.front().start));
  writer->close();
}

std::unique_ptr<DriveReplays> read_drive_input(const std::vector<std::string>& plugin_path, const Settings& settings,
                                               const DriveLog& log, Job& job) {
  auto made = std::make_unique<DriveReplays>();
  const auto file = logs::open_log(log.file, {.msg_paths = {log.msg_paths.begin(), log.msg_paths.end()}});
  auto input = std::make_unique<sim::ReplayInput>(
      sim::ReplayScenario(examined_host(plugin_path), settings, log.variants), log.hold_out, *file);
  job.tell(input->scenario.variants().front().robot.notes());
  if (!log.name.empty()) input->log = log.name;
  if (input->drives.front().damage) job.tell({input->drives.front().damage->what});
  made->input = std::move(input);
  return made;
}

/// Hooks that show the share of all variants that is done.
sim::LoopHooks variant_hooks(Job& job, const sim::ReplayScenario& scenario, std::size_t variant) {
  const auto count = static_cast<double>(scenario.variants().size());
  const std::string& name = scenario.variants()[variant].name;
  return {.progress = [&job, count, variant, name](double share) {
    job.show((static_cast<double>(variant) + share) / count, name);
  }};
}

std::unique_ptr<DriveReplays> estimate_drive(const std::vector<std::string>& plugin_path, const Settings& settings,
                                             const DriveLog& log, const py::object& progress) {
  std::unique_ptr<DriveReplays> made;
  do_watched(progress, [&](Job& job) {
    made = read_drive_input(plugin_path, settings, log, job);
    std::vector<std::shared_ptr<sim::MapKeeper>> keepers;
    std::vector<sim::HorizonLog> horizons;
    const std::int64_t most = sim::most_windows_of_log / std::ssize(made->input->drives);
    for (std::size_t v = 0; v < made->input->drives.size(); ++v) {
      sim::LoopHooks hooks = variant_hooks(job, made->input->scenario, v);
      horizons.emplace_back(made->input->scenario.variants()[v].robot, made->input->estimates(v), most);
      hooks.sampled = [&](const sim::LoopSample& sample) { horizons.back().take(sample); };
      keepers.push_back(std::make_shared<sim::MapKeeper>());
      hooks.robot = keepers.back();
      made->results.push_back(sim::estimate_variant(*made->input, v, hooks, std::make_shared<sim::MapKeeper>()));
    }
    made->horizons = sim::horizons_text(horizons, *made->input);
    for (const auto& keeper : keepers) keeper->save();
  });
  return made;
}

std::unique_ptr<DriveReplays> smooth_drive_log(const std::vector<std::string>& plugin_path, const Settings& settings,
                                               const DriveLog& log, const py::object& progress) {
  std::unique_ptr<DriveReplays> made;
  do_watched(progress, [&](Job& job) {
    made = read_drive_input(plugin_path, settings, log, job);
    std::vector<sim::HorizonLog> none;
    for (std::size_t v = 0; v < made->input->drives.size(); ++v) {
      auto [all, withheld] = sim::smooth_variant(*made->input, v, variant_hooks(job, made->input->scenario, v));
      made->reports.push_back(all.report);
      made->results.push_back({std::move(all.smoothed), std::move(withheld)});
      made->results.push_back({std::move(all.causal), {}});
      // A smoother has no windows, but a report reads the description of the model from their file.
      for (int i = 0; i < 2; ++i) none.emplace_back(made->input->scenario.variants()[v].robot, 1);
    }
    made->horizons = sim::horizons_text(none, *made->input, {"", sim::causal_suffix});
  });
  return made;
}

}  // namespace

void bind_drives(py::module_& module) {
  py::class_<DriveLog>(module, "DriveLog")
      .def(py::init([](const std::string& file, const std::string& name, const std::vector<std::string>& msg_paths,
                       const std::vector<std::string>& variants, int hold_out, int phase) {
             return DriveLog{file, name, msg_paths, variants, hold_out_of(hold_out, phase)};
           }),
           py::arg("file"), py::arg("name"), py::arg("msg_paths"), py::arg("variants"), py::arg("hold_out"),
           py::arg("phase"));
  py::class_<DriveReplays>(module, "DriveReplays")
      .def_property_readonly("names",
                             [](const DriveReplays& self) {
                               std::vector<std::string> names;
                               for (const sim::DriveResult& result : self.results) names.push_back(result.all.name);
                               return names;
                             })
      .def_property_readonly("summary_json", &drive_summary)
      .def_readonly("reports", &DriveReplays::reports)
      .def("estimates", &drive_estimates, py::arg("index"))
      .def("innovations", &drive_innovations, py::arg("index"))
      .def("predictions", &drive_predictions, py::arg("index"))
      .def("svg", &drive_picture)
      .def("save", &save_drive_files, py::arg("folder"))
      .def("save_track", &save_drive_track, py::arg("file"));
  module.def("estimate_drive", &estimate_drive, py::arg("plugin_path"), py::arg("settings"), py::arg("log"),
             py::arg("progress"));
  module.def("smooth_drive_log", &smooth_drive_log, py::arg("plugin_path"), py::arg("settings"), py::arg("log"),
             py::arg("progress"));
}

}  // namespace rhec::python
