#include <fmt/format.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <utility>

#include "arrays.hpp"
#include "binding.hpp"
#include "estimates.hpp"
#include "lock.hpp"
#include "reports.hpp"
#include "rhec/core/base/error.hpp"
#include "rhec/core/estimation/windowed_estimation.hpp"
#include "rhec/sim/problems/problem_file.hpp"
#include "robots.hpp"

namespace rhec::python {
namespace {

using EstimatorHandle = std::shared_ptr<EstimatorObject>;

/// What is made once of an estimator: with it come the names that its estimates share.
struct NamedEstimator : EstimatorObject {
  std::shared_ptr<const ModelDescription> about;
  std::shared_ptr<const std::vector<Sensor>> sensors, inputs;  ///< none where nobody judges
};

/// An estimate's state may go on behind the vehicle's with biases and scales of sensors, and values of motion; the
/// latter have no names.
std::shared_ptr<const ModelDescription> described(const Robot& robot, const Estimator& estimator) {
  auto about = std::make_shared<ModelDescription>(robot.estimated_description());
  const auto known = static_cast<std::size_t>(estimator.model().state_count());
  if (about->states.size() > known) about->states.resize(known);
  return about;
}

std::shared_ptr<NamedEstimator> make_estimator(const std::shared_ptr<RobotObject>& robot,
                                               const std::optional<Numbers>& initial_state) {
  auto made = std::make_shared<NamedEstimator>();
  made->robot = robot;
  made->keeper = std::make_shared<sim::MapKeeper>();
  Robot hooked = robot->robot;
  hooked.add_hooks(made->keeper);
  std::optional<Eigen::VectorXd> start;
  if (initial_state) {
    const std::vector<Variable>& states = hooked.bounded_description().states;
    start = Eigen::Map<const Eigen::VectorXd>(vector_of(*initial_state, states, "initial_state"),
                                              static_cast<Eigen::Index>(states.size()));
    if (start->array().isInf().any())
      throw Error("initial_state: found an infinite number; expected finite ones, and NaN where it is not known");
  }
  made->estimator = hooked.make_estimator(start);
  made->about = described(hooked, *made->estimator);
  const SensorWatch* const watch = made->estimator->watch();
  made->sensors = std::make_shared<const std::vector<Sensor>>(watch ? watch->sensors() : std::vector<Sensor>());
  made->inputs = std::make_shared<const std::vector<Sensor>>(watch ? watch->inputs() : std::vector<Sensor>());
  return made;
}

void push_measurement(NamedEstimator& self, double time, const Numbers& outputs, const std::optional<Numbers>& sigmas) {
  const std::vector<Variable>& variables = self.robot->robot.model()->description().outputs;
  const double* const values = vector_of(outputs, variables, "outputs");
  const double* const deviations = sigmas ? vector_of(*sigmas, variables, "sigmas") : nullptr;
  const Lock lock(self.mutex);
  self.estimator->push_measurement(time, values, deviations);
}

void push_input(NamedEstimator& self, double time, const Numbers& inputs) {
  const double* values = vector_of(inputs, self.robot->robot.model()->description().inputs, "inputs");
  const Lock lock(self.mutex);
  self.estimator->push_input(time, values);
}

py::object estimate(NamedEstimator& self, double time, std::optional<double> deadline, const py::object& out) {
  const Clock::time_point end = deadline_in(deadline);
  if (!out.is_none() && !py::isinstance<EstimateObject>(out))
    throw ArgumentError("out: expected an Estimate that this estimator has made before");
  const Lock lock(self.mutex);
  const Estimate* now = nullptr;
  double microseconds = 0.0;
  {
    const py::gil_scoped_release others_go_on;
    const auto start = Clock::now();
    now = &self.estimator->estimate(time, end);
    microseconds = microseconds_since(start);
  }
  if (!out.is_none()) {
    auto& place = out.cast<EstimateObject&>();
    if (!place.has_room_for(*now)) throw Error("out: an estimate of another vehicle; expected one of this estimator");
    place.take(*now);
    place.microseconds = microseconds;
    return out;
  }
  auto made = std::make_unique<EstimateObject>();
  made->about = self.about;
  made->sensors = self.sensors;
  made->inputs = self.inputs;
  made->take(*now);
  made->microseconds = microseconds;
  return py::cast(std::move(made));
}

template <class Call>
void without_interpreter(NamedEstimator& self, const Call& call) {
  const Lock lock(self.mutex);
  const py::gil_scoped_release others_go_on;
  call();
}

bool is_covariance(const Eigen::MatrixXd& matrix) {
  const double rounding = 1e-9 * matrix.cwiseAbs().maxCoeff();
  return matrix.allFinite() && (matrix - matrix.transpose()).cwiseAbs().maxCoeff() <= rounding &&
         matrix.llt().info() == Eigen::Success;
}

void reset_to(NamedEstimator& self, const std::optional<Numbers>& mean, const std::optional<Numbers>& covariance) {
  if (mean.has_value() != covariance.has_value())
    throw Error("reset: expected both the mean and the covariance, or neither");
  if (!mean) return without_interpreter(self, [&] { self.estimator->reset(); });
  const Eigen::Index n = self.estimator->model().state_count() + self.estimator->model().parameter_count();
  if (mean->ndim() != 1 || mean->size() != n || covariance->ndim() != 2 || covariance->shape(0) != n ||
      covariance->shape(1) != n)
    throw Error(fmt::format(
        "reset: found a mean that is {} and a covariance that is {}, expected the mean of [state; parameters] ({}) and "
        "its covariance ({} x {}): {} states as an Estimate has them, and {} parameters",
        shape_of(*mean), shape_of(*covariance), n, n, n, self.estimator->model().state_count(),
        self.estimator->model().parameter_count()));
  const Eigen::VectorXd to = Eigen::Map<const Eigen::VectorXd>(mean->data(), n);
  const Eigen::MatrixXd with = Eigen::Map<const Eigen::MatrixXd>(covariance->data(), n, n);
  if (!is_covariance(with))
    throw Error(
        "reset: the covariance is not symmetric, or not positive definite; expected that of [state; parameters]");
  bool done = false;
  without_interpreter(self, [&] { done = self.estimator->reset(to, with); });
  if (!done)
    throw Error("reset: the estimator cannot go on from there; expected finite numbers, and a measurement before it");
}

py::dict counts_of(NamedEstimator& self) {
  const Lock lock(self.mutex);
  const Estimator::Counts& counts = self.estimator->counts();
  py::dict made;
  made["nodes"] = counts.nodes;
  made["estimates"] = counts.estimates;
  made["fallbacks"] = counts.fallbacks;
  made["late"] = counts.late;
  made["dropped"] = counts.dropped;
  made["rejected"] = counts.rejected;
  made["rebased"] = counts.rebased;
  made["clocks_set"] = counts.clocks_set;
  made["missing"] = counts.missing;
  return made;
}

std::string window_line(NamedEstimator& self, const std::string& id) {
  const Lock lock(self.mutex);
  const auto* method = dynamic_cast<const WindowedEstimation*>(&self.estimator->method());
  if (method == nullptr || !method->has_window())
    throw Error("problem: the estimator has no window at present; expected one with the name rhe, and a measurement");
  const PluginChoice model = self.robot->robot.model_choice();
  return sim::problem_line(sim::record_of(method->problem(), &method->solution(), id, model.name, model.options));
}

/// The names of an estimate's values: of the vehicle's states, then of the parameters.
std::vector<std::string> names_of_values(const EstimateObject& self) {
  std::vector<std::string> names;
  for (const auto* variables : {&self.about->states, &self.about->parameters})
    for (const Variable& variable : *variables) names.push_back(variable.name);
  return names;
}

double value_of(const EstimateObject& self, const std::string& name) {
  const auto find = [&](const std::vector<Variable>& variables) {
    const auto at = std::find_if(variables.begin(), variables.end(), [&](const Variable& v) { return v.name == name; });
    return at == variables.end() ? -1 : static_cast<Eigen::Index>(at - variables.begin());
  };
  if (const Eigen::Index j = find(self.about->states); j >= 0 && j < self.value.state.size())
    return self.value.state[j];
  if (const Eigen::Index j = find(self.about->parameters); j >= 0) return self.value.parameters[j];
  const py::object error = py::module_::import("rhec._errors").attr("unknown_name")(name, names_of_values(self));
  PyErr_SetObject(reinterpret_cast<PyObject*>(Py_TYPE(error.ptr())), error.ptr());
  throw py::error_already_set();
}

py::array sigmas_of(const EstimateObject& self) {
  std::vector<double> sigmas;
  for (Eigen::Index j = 0; j < self.value.covariance.rows(); ++j)
    sigmas.push_back(std::sqrt(self.value.covariance(j, j)));
  return copy(sigmas);
}

py::list innovations_of(const EstimateObject& self) {
  py::list made;
  for (const Innovation& innovation : self.innovations) {
    py::dict each;
    each["time"] = innovation.time;
    each["sensor"] = self.sensors->at(static_cast<std::size_t>(innovation.sensor)).name;
    each["accepted"] = innovation.accepted;
    each["nis"] = innovation.nis;
    each["value"] = copy(innovation.value.data(), {innovation.value.size()});
    each["covariance"] =
        copy(innovation.covariance.data(), {innovation.covariance.rows(), innovation.covariance.cols()});
    made.append(named(each));
  }
  return made;
}

std::string described_estimate(const EstimateObject& self) {
  std::string text = fmt::format("<estimate at {:.3f} s:", self.value.time);
  for (std::size_t j = 0; j < self.about->states.size() && j < static_cast<std::size_t>(self.value.state.size()); ++j)
    text += fmt::format(" {} {:.4g}", self.about->states[j].name, self.value.state[static_cast<Eigen::Index>(j)]);
  for (std::size_t j = 0; j < self.about->parameters.size(); ++j)
    text +=
        fmt::format(" {} {:.4g}", self.about->parameters[j].name, self.value.parameters[static_cast<Eigen::Index>(j)]);
  return text + fmt::format("; health {}>", name_of(self.value.health.level));
}

void bind_estimates(py::module_& module) {
  py::class_<EstimateObject>(module, "Estimate",
                             "State and slip at one time, with their covariance. It stays as it is when the estimator "
                             "goes on. Its arrays are\n"
                             "read-only views; they keep the estimate alive.")
      .def("__reduce_ex__", not_copied("keep copies of its arrays, such as state.copy()"))
      .def_property_readonly(
          "time", [](const EstimateObject& self) { return self.value.time; }, "[s]")
      .def_property_readonly(
          "state",
          [](const py::object& self) {
            const Eigen::VectorXd& state = self.cast<const EstimateObject&>().value.state;
            return view(state.data(), {state.size()}, self);
          },
          "x, (n_x); behind the vehicle's states stand biases and scales of sensors that are estimated, and what "
          "outputs "
          "of\n"
          "motion (of inputs, as an accelerometer) tell: state[:len(vehicle.states)] is the vehicle's")
      .def_property_readonly(
          "parameters",
          [](const py::object& self) {
            const Eigen::VectorXd& parameters = self.cast<const EstimateObject&>().value.parameters;
            return view(parameters.data(), {parameters.size()}, self);
          },
          "p, (n_p): slip at present")
      .def_property_readonly(
          "covariance",
          [](const py::object& self) {
            const Eigen::MatrixXd& covariance = self.cast<const EstimateObject&>().value.covariance;
            return view(covariance.data(), {covariance.rows(), covariance.cols()}, self);
          },
          "of [state; parameters], (n_x + n_p, n_x + n_p), squared units")
      .def_property_readonly("sigmas", &sigmas_of, "standard deviations of [state; parameters], (n_x + n_p)")
      .def_property_readonly(
          "fallback", [](const EstimateObject& self) { return self.value.fallback; },
          "the solver failed; this is the prediction from earlier samples")
      .def_property_readonly(
          "predicted", [](const EstimateObject& self) { return self.value.predicted; },
          "the time is beyond the newest node: the state is integrated from there")
      .def_property_readonly(
          "health", [](const EstimateObject& self) { return name_of(self.value.health.level); }, "ok, degraded or lost")
      .def_property_readonly(
          "findings",
          [](const EstimateObject& self) {
            return self.value.health.level == HealthLevel::ok || self.sensors->empty()
                       ? std::string()
                       : in_words(self.value.health, *self.sensors, *self.inputs);
          },
          "why the health is not ok, in words")
      .def_property_readonly(
          "covariance_factor", [](const EstimateObject& self) { return self.value.health.covariance_factor; },
          "by how much larger the covariance is than the estimator's own, since innovations are correlated")
      .def_property_readonly(
          "innovations", &innovations_of,
          "of the measurements since the last estimate: dicts of time [s], sensor, accepted, nis, value, "
          "covariance")
      .def_readonly("microseconds", &EstimateObject::microseconds,
                    "that the estimator took for it, without Python [us]")
      .def_property_readonly("report", [](const EstimateObject& self) { return self.value.report; })
      .def("__getitem__", &value_of, py::arg("name"), "The value of a state or a parameter.")
      .def("keys", &names_of_values, "The names of states and parameters, for which it has values: dict(estimate).")
      .def("__iter__", [](const EstimateObject& self) { return py::cast(names_of_values(self)).attr("__iter__")(); })
      .def(
          "__contains__",
          [](const EstimateObject& self, const py::object& name) {
            return py::cast(names_of_values(self)).attr("__contains__")(name).cast<bool>();
          },
          py::arg("name"))
      .def("__repr__", &described_estimate);
}

}  // namespace

void bind_estimators(py::module_& module) {
  bind_estimates(module);
  [[maybe_unused]] const py::class_<EstimatorObject, EstimatorHandle> base(module, "EstimatorBase");
  py::class_<NamedEstimator, EstimatorObject, std::shared_ptr<NamedEstimator>>(
      module, "Estimator",
      "Estimates state and slip: push stamped measurements and inputs, and ask for the estimate at a time.\n\n"
      "Measurements and inputs may come in any order. Several threads may use it; each call waits for the others.")
      .def("__reduce_ex__", not_copied("make another one with make_estimator() of the robot, which can be pickled"))
      .def(py::init(&make_estimator), py::arg("robot").none(false), py::arg("initial_state") = py::none())
      .def("push_measurement", &push_measurement, py::arg("time"), py::arg("outputs"), py::arg("sigmas") = py::none(),
           "Measured y, (n_y), NaN where missing, at a time [s]. `sigmas`, (n_y): standard deviations of this "
           "measurement, e.g. as its receiver states them; those that are not above 0 are as always.")
      .def("push_input", &push_input, py::arg("time"), py::arg("inputs"),
           "Measured u, (n_u), NaN where missing, which holds from a time [s] on.")
      .def("estimate", &estimate, py::arg("time"), py::arg("deadline") = py::none(), py::kw_only(),
           py::arg("out") = py::none(),
           "The estimate at a time [s]. `deadline`: seconds from now after which the best so far is returned. `out`: "
           "an\n"
           "earlier estimate, which becomes this one, arrays included.")
      .def(
          "prepare", [](NamedEstimator& self) { without_interpreter(self, [&] { self.estimator->prepare(); }); },
          "Does work for the next sample in advance.")
      .def(
          "rehearse", [](NamedEstimator& self) { without_interpreter(self, [&] { self.estimator->rehearse(); }); },
          "Goes through the computation of the next estimate, without effect: for a loop that has slept and asks in a\n"
          "moment. Code and data are in the processor's caches then.")
      .def("reset", &reset_to, py::arg("mean") = py::none(), py::arg("covariance") = py::none(),
           "Begins anew; or goes on from a mean of [state; parameters] (n) and its covariance (n, n).")
      .def(
          "end_drive", [](NamedEstimator& self) { without_interpreter(self, [&] { self.estimator->end_drive(); }); },
          "Completes what is kept beyond the drive, such as a map of slip.")
      .def(
          "save_map",
          [](NamedEstimator& self) {
            const Lock lock(self.mutex);
            self.keeper->save();
          },
          "Writes the map of slip to its file (`estimator.memory.file`).")
      .def("problem_line", &window_line, py::arg("id"),
           "Its window's problem and solution as a line of a problem file.")
      .def_property_readonly(
          "has_started",
          [](NamedEstimator& self) {
            const Lock lock(self.mutex);
            return self.estimator->has_started();
          },
          "whether there was a measurement")
      .def_property_readonly("counts", &counts_of,
                             "of nodes, estimates, fallbacks, late, dropped and rejected measurements");
}

}  // namespace rhec::python
