#include <fmt/format.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <cmath>
#include <optional>
#include <utility>

#include "arrays.hpp"
#include "binding.hpp"
#include "estimates.hpp"
#include "lock.hpp"
#include "reports.hpp"
#include "rhec/core/base/error.hpp"
#include "rhec/sim/problems/problem_file.hpp"
#include "robots.hpp"

namespace rhec::python {
namespace {

struct CommandObject {
  Controller::Command value;
  double microseconds = 0.0;  ///< that the controller took
};

struct ControllerObject {
  std::shared_ptr<const RobotObject> robot;
  std::shared_ptr<EstimatorObject> ahead;  ///< whose map says what slip is ahead; null: none
  std::unique_ptr<Controller> controller;
  Estimate seen;  ///< what it was given, while others may change that
  std::mutex mutex;
};

/// Both objects that a controller uses, always in this order.
class ControllerLock {
 public:
  explicit ControllerLock(ControllerObject& of) {
    if (of.ahead) ahead_.emplace(of.ahead->mutex);
    own_.emplace(of.mutex);
  }

 private:
  std::optional<Lock> ahead_, own_;
};

std::shared_ptr<ControllerObject> make_controller(const std::shared_ptr<RobotObject>& robot, const Path& path,
                                                  const std::shared_ptr<EstimatorObject>& ahead) {
  auto made = std::make_shared<ControllerObject>();
  made->robot = robot;
  std::shared_ptr<const SlipAhead> slip;
  if (ahead) slip = ahead->estimator->slip_ahead();
  if (slip) made->ahead = ahead;
  made->controller = robot->robot.make_controller(path, slip);
  return made;
}

void check_fit(const Estimate& estimate, const Model& vehicle) {
  if (estimate.state.size() >= vehicle.state_count() && estimate.parameters.size() == vehicle.parameter_count()) return;
  throw Error(
      fmt::format("estimate: has {} states and {} parameters; the controller's vehicle has {} and {}: expected an "
                  "estimate of the same robot",
                  estimate.state.size(), estimate.parameters.size(), vehicle.state_count(), vehicle.parameter_count()));
}

py::object control(ControllerObject& self, const EstimateObject& estimate, std::optional<double> deadline,
                   const py::object& out) {
  const Clock::time_point end = deadline_in(deadline);
  if (!out.is_none() && !py::isinstance<CommandObject>(out))
    throw ArgumentError("out: expected a Command that this controller has made before");
  const ControllerLock lock(self);
  check_fit(estimate.value, self.controller->vehicle());
  self.seen = estimate.value;
  self.seen.innovations = {};
  const Controller::Command* now = nullptr;
  double microseconds = 0.0;
  {
    const py::gil_scoped_release others_go_on;
    const auto start = Clock::now();
    now = &self.controller->control(self.seen, end);
    microseconds = microseconds_since(start);
  }
  if (!out.is_none()) {
    auto& place = out.cast<CommandObject&>();
    if (place.value.inputs.size() != now->inputs.size())
      throw Error("out: a command of another vehicle; expected one of this controller");
    place.value = *now;
    place.microseconds = microseconds;
    return out;
  }
  return py::cast(std::make_unique<CommandObject>(CommandObject{*now, microseconds}));
}

template <class Call>
auto locked(ControllerObject& self, const Call& call) {
  const ControllerLock lock(self);
  const py::gil_scoped_release others_go_on;
  return call(*self.controller);
}

void applied(ControllerObject& self, const Numbers& inputs) {
  const double* values = vector_of(inputs, self.controller->vehicle().description().inputs, "inputs");
  if (!all_finite(inputs)) throw Error("inputs: found a number that is not finite; expected what the vehicle has had");
  locked(self, [&](Controller& controller) { controller.applied(values); });
}

void locate(ControllerObject& self, std::optional<double> arc_length) {
  if (arc_length && !std::isfinite(*arc_length))
    throw Error("arc_length: found a number that is not finite; expected metres along the path, or None");
  locked(self, [&](Controller& controller) { arc_length ? controller.locate(*arc_length) : controller.locate(); });
}

int set_obstacles(ControllerObject& self, const Numbers& obstacles, double time) {
  constexpr py::ssize_t width = 7;
  const bool is_none = obstacles.ndim() == 1 && obstacles.size() == 0;
  if (!is_none && (obstacles.ndim() != 2 || obstacles.shape(1) != width))
    throw Error("obstacles: found " + shape_of(obstacles) +
                ", expected rows of x [m], y [m], semi-axes along and across [m], heading [rad], velocity in x and y "
                "[m/s] (n x 7)");
  if (!all_finite(obstacles) || !std::isfinite(time))
    throw Error("obstacles, time: found a number that is not finite; leave out what is not known");
  std::vector<Obstacle> all;
  for (py::ssize_t i = 0; i < obstacles.shape(0); ++i) {
    const double* row = obstacles.data() + i * width;
    if (row[2] < 0.0 || row[3] < 0.0)
      throw Error(
          fmt::format("obstacles: row {} has the semi-axes {} and {} m; expected at least 0", i, row[2], row[3]));
    all.push_back({row[0], row[1], row[2], row[3], row[4], row[5], row[6]});
  }
  return locked(self, [&](Controller& controller) { return controller.set_obstacles(all, time); });
}

/// By name.
py::dict violations(ControllerObject& self) {
  const ControllerLock lock(self);
  self.controller->finish();
  py::dict found;
  const TermFunctions* const terms = self.controller->problem().terms().functions();
  const std::vector<double>& values = self.controller->command().violations;
  for (std::size_t j = 0; j < values.size(); ++j) found[py::str(terms->limit_names()[j])] = values[j];
  return found;
}

/// What is planned: times from now, and the vehicle's states and inputs.
py::dict plan(ControllerObject& self) {
  const ControllerLock lock(self);
  const Controller& controller = *self.controller;
  const RhcProblem& problem = controller.problem();
  const auto n = static_cast<py::ssize_t>(problem.intervals());
  const auto nx = static_cast<py::ssize_t>(controller.vehicle().state_count()),
             nu = static_cast<py::ssize_t>(controller.vehicle().input_count());
  std::vector<double> times(static_cast<std::size_t>(n + 1)), states, inputs(static_cast<std::size_t>(n * nu));
  for (py::ssize_t i = 0; i <= n; ++i) {
    const double* row = controller.plan().state(static_cast<int>(i));
    states.insert(states.end(), row, row + nx);
    if (i == n) break;
    times[static_cast<std::size_t>(i + 1)] = times[static_cast<std::size_t>(i)] + problem.duration(static_cast<int>(i));
    controller.plan_inputs(static_cast<int>(i), inputs.data() + i * nu);
  }
  py::dict made;
  made["times"] = copy(times);
  made["states"] = copy(states.data(), {n + 1, nx});
  made["inputs"] = copy(inputs.data(), {n, nu});
  return made;
}

std::string plan_line(ControllerObject& self, const std::string& id) {
  const ControllerLock lock(self);
  const PluginChoice model = self.robot->robot.model_choice();
  return sim::problem_line(
      sim::record_of(self.controller->problem(), &self.controller->plan(), id, model.name, model.options));
}

void bind_commands(py::module_& module) {
  py::class_<CommandObject>(
      module, "Command", "The inputs to be applied until the next call. It stays as it is when the controller goes on.")
      .def("__reduce_ex__", not_copied("keep copies of its arrays, such as inputs.copy()"))
      .def_property_readonly(
          "inputs",
          [](const py::object& self) {
            const std::vector<double>& inputs = self.cast<const CommandObject&>().value.inputs;
            return view(inputs.data(), {static_cast<py::ssize_t>(inputs.size())}, self);
          },
          "u, (n_u), a read-only view")
      .def_property_readonly(
          "fallback", [](const CommandObject& self) { return self.value.fallback; },
          "the solver failed; the last plan is continued")
      .def_property_readonly(
          "heading_error", [](const CommandObject& self) { return self.value.heading_error; },
          "heading of the estimate less that of the path, in (-pi, pi] [rad]")
      .def_property_readonly(
          "relaxed", [](const CommandObject& self) { return self.value.relaxed; },
          "a state's bound was out of reach and was relaxed")
      .def_property_readonly(
          "faces_away", [](const CommandObject& self) { return self.value.faces_away; },
          "the vehicle faces away from the path, and stands until somebody turns it")
      .def_property_readonly(
          "turns_around", [](const CommandObject& self) { return self.value.turns_around; },
          "the vehicle, which looks away from the path, goes round, or turns in several moves")
      .def_property_readonly(
          "goes_back", [](const CommandObject& self) { return self.value.goes_back; },
          "the vehicle moves against the path's direction: back along it, or in a move of a turn in several ones")
      .def_property_readonly(
          "stands", [](const CommandObject& self) { return self.value.stands; },
          "the plan is to stand where the path goes on")
      .def_property_readonly(
          "pace", [](const CommandObject& self) { return self.value.pace; },
          "share of the path's speeds that is driven at present")
      .def_property_readonly(
          "reference",
          [](const CommandObject& self) {
            const PathPoint& at = self.value.reference;
            return copy({at.x, at.y, at.heading, at.speed});
          },
          "the closest point of the path: x [m], y [m], heading [rad], speed [m/s], (4)")
      .def_readonly("microseconds", &CommandObject::microseconds,
                    "that the controller took for it, without Python [us]")
      .def_property_readonly(
          "report", [](const CommandObject& self) { return self.value.report; },
          "of the solver; the controller's `finish` adds objective and KKT residual to the next one")
      .def("__repr__", [](const CommandObject& self) {
        std::string text = "<command";
        for (const double input : self.value.inputs) text += fmt::format(" {:.4g}", input);
        return text + fmt::format(", {}>", name_of(self.value.report.status));
      });
}

}  // namespace

void bind_controllers(py::module_& module) {
  bind_commands(module);
  py::class_<ControllerObject, std::shared_ptr<ControllerObject>>(
      module, "Controller",
      "Follows a path: estimate in, inputs out. Several threads may use it; each call waits for the others.")
      .def("__reduce_ex__", not_copied("make another one with make_controller() of the robot, which can be pickled"))
      .def(py::init(&make_controller), py::arg("robot").none(false), py::arg("path"), py::arg("ahead") = nullptr)
      .def("control", &control, py::arg("estimate"), py::arg("deadline") = py::none(), py::kw_only(),
           py::arg("out") = py::none(),
           "The inputs for an estimate. `deadline`: seconds from now after which the best so far is returned. `out`: "
           "an\n"
           "earlier command, which becomes this one, arrays included.")
      .def(
          "prepare", [](ControllerObject& self) { locked(self, [](Controller& c) { c.prepare(); }); },
          "Does work for the next sample in advance.")
      .def(
          "finish", [](ControllerObject& self) { locked(self, [](Controller& c) { c.finish(); }); },
          "Assesses the last plan; `prepare` and the next `control` do that, too.")
      .def("violations", &violations,
           "By limit of the terms, how far what follows the last command is beyond it, in the limit's unit; 0: it is "
           "kept.\n"
           "Looks at the next sampling interval alone. Does what `finish` does, which takes a moment.")
      .def("applied", &applied, py::arg("inputs"),
           "Says which inputs, (n_u), the vehicle has had, where they were not the command.")
      .def("locate", &locate, py::arg("arc_length") = py::none(),
           "Searches the whole path for the vehicle at the next call; or says how far along it the vehicle is [m], "
           "where\n"
           "that is known.")
      .def("set_obstacles", &set_obstacles, py::arg("obstacles"), py::arg("time"),
           "The obstacles from now on, as they were at a time [s]: rows of x [m], y [m], semi-axes along and across "
           "[m],\n"
           "heading [rad], velocity in x and y [m/s], (n, 7). Returns how many there is room for.")
      .def(
          "reset", [](ControllerObject& self) { locked(self, [](Controller& c) { c.reset(); }); }, "Begins anew.")
      .def("plan", &plan, "What is planned: times from now [s] (N + 1), states (N + 1, n_x) and inputs (N, n_u).")
      .def("problem_line", &plan_line, py::arg("id"), "Its problem and plan as a line of a problem file.")
      .def_property_readonly(
          "finished", [](ControllerObject& self) { return locked(self, [](Controller& c) { return c.finished(); }); },
          "whether the end of the path is passed, or the vehicle has stopped there")
      .def_property_readonly(
          "fallbacks", [](ControllerObject& self) { return locked(self, [](Controller& c) { return c.fallbacks(); }); },
          "samples whose solve failed");
}

}  // namespace rhec::python
