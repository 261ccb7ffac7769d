#include "robots.hpp"

#include <fmt/format.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <chrono>
#include <cmath>

#include "arrays.hpp"
#include "binding.hpp"
#include "hosts.hpp"
#include "jobs.hpp"
#include "models.hpp"
#include "reports.hpp"
#include "rhec/core/base/error.hpp"

namespace rhec::python {
namespace {

/// Rows of x, y, speed, and perhaps of room to the left and to the right.
Path path_of(const Numbers& waypoints, double acceleration, double lateral_acceleration) {
  if (waypoints.ndim() != 2 || (waypoints.shape(1) != 3 && waypoints.shape(1) != 5))
    throw Error("waypoints: found " + shape_of(waypoints) +
                ", expected rows of x [m], y [m], speed [m/s] (n x 3), or with the room to the left and to the right "
                "[m] (n x 5)");
  if (!(acceleration > 0.0)) throw Error("acceleration: expected more than 0 [m/s^2]");
  if (!(lateral_acceleration > 0.0)) throw Error("lateral_acceleration: expected more than 0 [m/s^2]");
  const py::ssize_t width = waypoints.shape(1);
  std::vector<Waypoint> points(static_cast<std::size_t>(waypoints.shape(0)));
  for (std::size_t i = 0; i < points.size(); ++i) {
    const double* row = waypoints.data() + static_cast<py::ssize_t>(i) * width;
    points[i] = {row[0], row[1], row[2]};
    if (width == 5) points[i].left = row[3], points[i].right = row[4];
  }
  return {points, {acceleration, lateral_acceleration}};
}

py::array waypoint_at(const Path& self, double arc_length) {
  if (!std::isfinite(arc_length)) throw Error("arc_length: expected a finite number [m]");
  const PathPoint at = self.point_at(arc_length);
  return copy({at.x, at.y, at.heading, at.speed, at.curvature});
}

py::tuple state_of(const Report& report) {
  const KktResidual& kkt = report.kkt;
  return py::make_tuple(static_cast<int>(report.status), report.iterations, report.factorisations, report.fallback_used,
                        report.objective, kkt.stationarity, kkt.defect, kkt.bound_violation, kkt.complementarity);
}

Report report_of(const py::tuple& state) {
  Report report;
  report.status = static_cast<Status>(state[0].cast<int>());
  report.iterations = state[1].cast<int>();
  report.factorisations = state[2].cast<int>();
  report.fallback_used = state[3].cast<bool>();
  report.objective = state[4].cast<double>();
  report.kkt = {state[5].cast<double>(), state[6].cast<double>(), state[7].cast<double>(), state[8].cast<double>()};
  return report;
}

void bind_reports(py::module_& module) {
  py::class_<Report>(module, "Report", "What a solver says of one solve.")
      .def_property_readonly(
          "status", [](const Report& self) { return name_of(self.status); },
          "solved, step_taken, relaxed, iteration_limit, deadline, infeasible, stalled or bad_input")
      .def_property_readonly(
          "usable", [](const Report& self) { return is_usable(self.status); },
          "whether the result may be used: all but infeasible and bad_input")
      .def_property_readonly(
          "advice", [](const Report& self) { return advice_for(self.status); },
          "what to do about the status, in one sentence")
      .def_readonly("iterations", &Report::iterations)
      .def_readonly("factorisations", &Report::factorisations)
      .def_readonly("fallback_used", &Report::fallback_used, "a robust method had to replace the fast one")
      .def_readonly("objective", &Report::objective)
      .def_property_readonly(
          "kkt", [](const Report& self) { return dict_of(self.kkt); },
          "largest stationarity, defect, bound_violation and complementarity, and the largest of all")
      .def(py::pickle(&state_of, &report_of))
      .def("__repr__", [](const Report& self) {
        return fmt::format("<{} after {} iterations, KKT residual {:.1e}>", name_of(self.status), self.iterations,
                           self.kkt.largest());
      });
}

}  // namespace

Clock::time_point deadline_in(std::optional<double> seconds) {
  if (!seconds || *seconds == INFINITY) return Clock::time_point::max();
  if (!(*seconds >= 0.0)) throw Error("deadline: expected seconds from now, at least 0");
  constexpr double longest = 1e9;
  return Clock::now() +
         std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(std::min(*seconds, longest)));
}

py::dict dict_of(const KktResidual& residual) {
  py::dict made;
  made["stationarity"] = residual.stationarity;
  made["defect"] = residual.defect;
  made["bound_violation"] = residual.bound_violation;
  made["complementarity"] = residual.complementarity;
  made["largest"] = residual.largest();
  return made;
}

void bind_robots(py::module_& module) {
  bind_reports(module);
  py::class_<Path>(module, "Path",
                   "Straight segments through waypoints.\n\n"
                   "waypoints: (n, 3), rows of x [m], y [m] and speed [m/s] (negative: in reverse, 0: a stop); or\n"
                   "(n, 5), with the room to the left and to the right [m]. Speeds are lowered so that accelerations\n"
                   "along the path and across it stay within the limits [m/s^2].")
      .def("__reduce_ex__", not_copied("make it again of its waypoints"))
      .def(py::init(&path_of), py::arg("waypoints"), py::kw_only(), py::arg("acceleration") = INFINITY,
           py::arg("lateral_acceleration") = INFINITY)
      .def_property_readonly("length", &Path::length, "[m]")
      .def_property_readonly("duration", &Path::duration, "at the reference speeds [s]")
      .def("__repr__",
           [](const Path& self) { return fmt::format("<path: {} waypoints, {:.1f} m>", self.size(), self.length()); })
      .def("__len__", &Path::size, "Number of distinct waypoints.")
      .def("at", &waypoint_at, py::arg("arc_length"),
           "x [m], y [m], heading [rad], speed [m/s] and curvature [1/m] at an arc length [m], (5).");

  py::class_<RobotObject, std::shared_ptr<RobotObject>>(module, "Robot")
      .def(py::init([](const std::vector<std::string>& plugin_path, const Settings& settings) {
             auto made = std::make_shared<RobotObject>(
                 Robot(examined_host(plugin_path), RobotOptions::table().parse(settings, "robot")));
             warn_of(made->robot.notes());
             return made;
           }),
           py::arg("plugin_path"), py::arg("settings"))
      .def_property_readonly("step", [](const RobotObject& self) { return self.robot.step(); })
      .def_property_readonly("vehicle", [](const RobotObject& self) {
        return Vehicle{self.robot.model(), self.robot.bounded_description()};
      });
}

}  // namespace rhec::python
