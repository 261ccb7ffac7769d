#include "models.hpp"

#include <fmt/format.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <cmath>
#include <optional>
#include <string>

#include "arrays.hpp"
#include "binding.hpp"
#include "hosts.hpp"
#include "rhec/core/base/error.hpp"
#include "rhec/core/model/motion_outputs.hpp"
#include "rhec/core/model/vehicle_graph.hpp"
#include "rhec/core/term/term_functions.hpp"
#include "rhec/plugins/equations/equation_term.hpp"
#include "rhec/plugins/equations/vehicle_cpp.hpp"
#include "rhec/plugins/robot/model_section.hpp"
#include "rhec/sim/check/model_check.hpp"
#include "rhec/sim/check/term_check.hpp"

namespace rhec::python {
namespace {

/// Rows of several arguments, of which each has `count` or is one row for all.
class Rows {
 public:
  /// Lengthens the common number of rows.
  void add(const Numbers& given, const std::vector<Variable>& variables, const char* what) {
    const py::ssize_t rows = rows_of(given, variables, what);
    if (given.ndim() == 2) has_rows_ = true;
    if (count_ != 1 && rows != 1 && rows != count_)
      throw Error(
          fmt::format("{}: found {} rows, expected {}, as many as the other arguments have", what, rows, count_));
    if (rows != 1) count_ = rows;  // none is a number, too
    parts_.push_back({given.data(), static_cast<py::ssize_t>(variables.size()), rows});
  }
  py::ssize_t count() const { return count_; }
  /// The shape of a result with so many numbers a row.
  Shape shape(py::ssize_t width) const { return has_rows_ ? Shape{count_, width} : Shape{width}; }
  const double* row(std::size_t part, py::ssize_t row) const {
    const Part& at = parts_[part];
    return at.data + (at.rows == 1 ? 0 : row * at.width);
  }

 private:
  struct Part {
    const double* data;
    py::ssize_t width, rows;
  };
  std::vector<Part> parts_;
  py::ssize_t count_ = 1;
  bool has_rows_ = false;
};

py::array rates(const Vehicle& self, const Numbers& states, const Numbers& inputs, const Numbers& parameters) {
  Rows rows;
  rows.add(states, self.about.states, "states");
  rows.add(inputs, self.about.inputs, "inputs");
  rows.add(parameters, self.about.parameters, "parameters");
  const py::ssize_t width = self.model->state_count();
  std::vector<double> made(static_cast<std::size_t>(rows.count() * width));
  for (py::ssize_t i = 0; i < rows.count(); ++i)
    self.model->rates(rows.row(0, i), rows.row(1, i), rows.row(2, i), made.data() + i * width);
  return copy(made.data(), rows.shape(width));
}

/// Outputs of motion, such as a gyro's, depend on the inputs and the parameters, too.
py::array observe(const Vehicle& self, const Numbers& states, const std::optional<Numbers>& inputs,
                  const std::optional<Numbers>& parameters) {
  const MotionOutputs motion(*self.model);
  if (motion.count() > 0 && (!inputs || !parameters))
    throw Error(fmt::format("inputs and parameters: {} measures motion, which depends on them; expected both",
                            self.about.outputs[static_cast<std::size_t>(motion.which().front())].name));
  Rows rows;
  rows.add(states, self.about.states, "states");
  if (inputs) rows.add(*inputs, self.about.inputs, "inputs");
  if (parameters) rows.add(*parameters, self.about.parameters, "parameters");
  const py::ssize_t width = self.model->output_count();
  std::vector<double> made(static_cast<std::size_t>(rows.count() * width)), moved(motion.which().size());
  for (py::ssize_t i = 0; i < rows.count(); ++i) {
    double* const outputs = made.data() + i * width;
    self.model->observe({.count = 1, .states = rows.row(0, i), .outputs = outputs});
    if (motion.count() == 0) continue;
    motion.evaluate({.count = 1,
                     .states = rows.row(0, i),
                     .inputs = rows.row(1, i),
                     .parameters = rows.row(2, i),
                     .outputs = moved.data()});
    for (std::size_t k = 0; k < moved.size(); ++k) outputs[motion.which()[k]] = moved[k];
  }
  return copy(made.data(), rows.shape(width));
}

py::object integrate(const Vehicle& self, const Numbers& states, const Numbers& inputs, const Numbers& parameters,
                     double duration, int substeps, bool with_jacobian) {
  if (!(duration > 0.0) || std::isinf(duration)) throw Error("duration: expected a finite number, greater than 0 [s]");
  if (substeps < 1) throw Error("substeps: expected an integer, at least 1");
  Rows rows;
  rows.add(states, self.about.states, "states");
  rows.add(inputs, self.about.inputs, "inputs");
  rows.add(parameters, self.about.parameters, "parameters");
  const py::ssize_t nx = self.model->state_count(), nz = nx + self.model->input_count() + self.model->parameter_count();
  std::vector<double> next(static_cast<std::size_t>(rows.count() * nx));
  std::vector<double> columns(static_cast<std::size_t>(with_jacobian ? rows.count() * nx * nz : 0));
  for (py::ssize_t i = 0; i < rows.count(); ++i)
    self.model->integrate({.count = 1,
                           .states = rows.row(0, i),
                           .inputs = rows.row(1, i),
                           .parameters = rows.row(2, i),
                           .durations = &duration,
                           .substeps = substeps,
                           .next_states = next.data() + i * nx,
                           .jacobians = with_jacobian ? columns.data() + i * nx * nz : nullptr});
  py::array ends = copy(next.data(), rows.shape(nx));
  if (!with_jacobian) return ends;
  std::vector<double> jacobians(columns.size());
  for (py::ssize_t i = 0; i < rows.count(); ++i)
    for (py::ssize_t c = 0; c < nz; ++c)
      for (py::ssize_t r = 0; r < nx; ++r) jacobians[(i * nx + r) * nz + c] = columns[(i * nz + c) * nx + r];
  Shape shape = rows.shape(nx);
  shape.push_back(nz);
  return py::make_tuple(ends, copy(jacobians.data(), shape));
}

/// The formula's nodes: what each does, of which others, or its value or name.
py::object graph(const Vehicle& self) {
  const VehicleGraph* made = self.model->graph();
  if (made == nullptr) return py::none();
  const Graph& graph = *made->graph;
  py::list nodes;
  for (int i = 0; i < graph.size(); ++i) {
    const Graph::Node& node = graph[i];
    nodes.append(
        py::make_tuple(std::string(identifier_of(node.operation)), node.a, node.b, node.value, graph.name_of(i)));
  }
  py::dict options;
  for (const Tape::Known& option : made->options)
    options[py::int_(option.node)] = py::make_tuple(graph.name_of(option.node), option.value);
  py::dict all;
  all["nodes"] = nodes;
  all["states"] = made->states;
  all["inputs"] = made->inputs;
  all["parameters"] = made->parameters;
  all["options"] = options;
  all["rates"] = made->rates;
  all["outputs"] = made->outputs;
  return all;
}

std::vector<std::shared_ptr<const Model>> looked_at_on(const Vehicle* vehicle) {
  if (vehicle == nullptr) return {};
  return {vehicle->model};
}

/// Of a term's section.
std::string check_of_term(const std::vector<std::string>& plugin_path, const Settings& section,
                          const Vehicle* vehicle) {
  const Host host = examined_host(plugin_path);
  const py::gil_scoped_release others_go_on;
  return sim::check_json(sim::check_term(host, section, looked_at_on(vehicle)));
}

/// Of a model's section, or of one that has the name of a term.
std::string check_of(const std::vector<std::string>& plugin_path, const Settings& section, const Vehicle* vehicle) {
  const Host host = examined_host(plugin_path);
  const Settings* const name = section.find("name");
  if (name != nullptr && section.find("equations") == nullptr && sim::is_name_of_term(host, name->as_text())) {
    Settings term = sim::section_of_term(name->as_text());
    for (const auto& [key, value] : section.members())
      if (key != "name") term.set(key, value);
    return check_of_term(plugin_path, term, vehicle);
  }
  if (vehicle != nullptr) throw Error("check: vehicle: it is for a term, which is looked at on it; this is a model");
  RobotOptions options;
  options.model = section;
  const py::gil_scoped_release others_go_on;
  return sim::check_json(sim::check_model(host, Robot(host, options)));
}

/// Throws Error where a term's equations have a mistake, or do not suit the vehicle.
void check_term(const Settings& section, const Vehicle* vehicle) {
  const std::shared_ptr<Term> made = load_inline_term(section);
  if (vehicle != nullptr) TermFunctions(*vehicle->model, {{.name = "term", .term = made}});
}

py::dict sources_of(const std::string& file) {
  const VehicleSources sources = vehicle_as_cpp(file);
  py::dict files;
  for (const VehicleSources::File& each : sources.files) files[py::str(each.name)] = each.content;
  py::dict made;
  made["plugin"] = sources.plugin;
  made["files"] = files;
  made["notes"] = sources.notes;
  return made;
}

py::object roles_of(const Vehicle& self) {
  const Roles& roles = self.about.roles;
  py::dict made;
  const auto add = [&made](const char* role, int index, const std::vector<Variable>& variables) {
    if (index >= 0) made[role] = variables[static_cast<std::size_t>(index)].name;
  };
  add("position_x", roles.position_x, self.about.states);
  add("position_y", roles.position_y, self.about.states);
  add("heading", roles.heading, self.about.states);
  add("speed", roles.speed, self.about.inputs);
  add("speed_state", roles.speed_state, self.about.states);
  add("speed_factor", roles.speed_factor, self.about.parameters);
  return named(made);
}

}  // namespace

void bind_models(py::module_& module) {
  py::class_<Variable>(module, "Variable", "A state, input, parameter or output of a vehicle.")
      .def_readonly("name", &Variable::name)
      .def_readonly("unit", &Variable::unit, "SI; \"1\" of a pure number")
      .def_readonly("meaning", &Variable::meaning)
      .def_readonly("lower", &Variable::lower, "bound; -inf for none")
      .def_readonly("upper", &Variable::upper, "bound; inf for none")
      .def_readonly("typical", &Variable::scale, "a typical magnitude")
      .def_readonly("is_angle", &Variable::is_angle)
      .def_readonly("nominal", &Variable::nominal, "of a parameter: its value without slip")
      .def("__repr__",
           [](const Variable& self) { return fmt::format("<{} [{}]: {}>", self.name, self.unit, self.meaning); });

  const auto variables = [](std::vector<Variable> ModelDescription::*of) {
    return [of](const Vehicle& self) { return self.about.*of; };
  };
  py::class_<Vehicle>(module, "Vehicle", "A vehicle's model: dx/dt = f(x, u, p), y = h(x).")
      .def("__reduce_ex__", not_copied("keep the model or the robot that it is of"))
      .def_property_readonly("name", [](const Vehicle& self) { return self.about.name; })
      .def("__repr__",
           [](const Vehicle& self) {
             const ModelDescription& about = self.about;
             return fmt::format("<vehicle '{}': {} states, {} inputs, {} parameters, {} outputs>", about.name,
                                about.states.size(), about.inputs.size(), about.parameters.size(),
                                about.outputs.size());
           })
      .def_property_readonly(
          "source", [](const Vehicle& self) { return self.about.source; }, "where the equations were published")
      .def_property_readonly("states", variables(&ModelDescription::states), "x, n_x variables")
      .def_property_readonly("inputs", variables(&ModelDescription::inputs), "u, n_u variables")
      .def_property_readonly("parameters", variables(&ModelDescription::parameters), "p, n_p variables: slip")
      .def_property_readonly("outputs", variables(&ModelDescription::outputs), "y, n_y variables: what is measured")
      .def_property_readonly("roles", &roles_of, "the variables that are position, heading, speed and speed factor")
      .def_property_readonly(
          "instruction_sets", [](const Vehicle& self) { return self.model->instruction_sets(); },
          "what it can be evaluated by on this machine; the last one is used")
      .def("rates", &rates, py::arg("states"), py::arg("inputs"), py::arg("parameters"),
           "dx/dt, (n_x) or (n, n_x) [units of the states / s], of vectors or of rows of them.")
      .def("observe", &observe, py::arg("states"), py::arg("inputs") = py::none(), py::arg("parameters") = py::none(),
           "y = h(x), or h(x, u, p) where outputs measure motion, as a gyro's do: (n_y) or (n, n_y).")
      .def(
          "integrate", &integrate, py::arg("states"), py::arg("inputs"), py::arg("parameters"), py::arg("duration"),
          py::arg("substeps") = 1, py::arg("with_jacobian") = false,
          "The state after `duration` [s] with constant inputs, (n_x) or (n, n_x), by so many Runge-Kutta steps; with\n"
          "its derivatives by [x; u; p], (n_x, n_z) or (n, n_x, n_z), if asked for.")
      .def("graph", &graph, "The formula's nodes, or None if the model has no graph.");

  module.def(
      "make_vehicle",
      [](const std::vector<std::string>& plugin_path, const Settings& section) {
        const ModelSection made(examined_host(plugin_path), section);
        return Vehicle{made.model(), made.model()->description()};
      },
      py::arg("plugin_path"), py::arg("section"));
  module.def("check", &check_of, py::arg("plugin_path"), py::arg("section"), py::arg("vehicle"));
  module.def("check_of_term", &check_of_term, py::arg("plugin_path"), py::arg("section"), py::arg("vehicle"));
  module.def("check_term", &check_term, py::arg("section"), py::arg("vehicle"));
  module.def("vehicle_as_cpp", &sources_of, py::arg("file"));
}

}  // namespace rhec::python
