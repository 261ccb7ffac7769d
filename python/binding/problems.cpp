#include <fmt/format.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <chrono>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "arrays.hpp"
#include "binding.hpp"
#include "hosts.hpp"
#include "lock.hpp"
#include "models.hpp"
#include "reports.hpp"
#include "rhec/core/base/error.hpp"
#include "rhec/sim/problems/problem_file.hpp"
#include "rhec/sim/problems/problem_record.hpp"

namespace rhec::python {
namespace {

/// A problem with every number that a solver needs.
struct Problem {
  Host host;
  sim::ProblemRecord record;
  std::shared_ptr<const Model> model;  ///< as it is named, before the problem adds states to it
  std::unique_ptr<HorizonProblem> built;
};

struct Solution {
  std::shared_ptr<const Problem> problem;
  sim::Outcome outcome;
  Report report;
  Iterate point;
  std::vector<double> states, inputs, parameters;  ///< (N + 1) x n_x, N x n_u, N x n_p
  std::vector<double> covariances;                 ///< (N + 1) x n_s x n_s, or empty
};

std::vector<std::shared_ptr<Problem>> problems_of(const std::vector<std::string>& plugin_path, const std::string& text,
                                                  const std::string& name) {
  const Host host = examined_host(plugin_path);
  std::vector<std::shared_ptr<Problem>> made;
  for (sim::ProblemRecord& record : sim::read_problems(text, name)) {
    auto problem = std::make_shared<Problem>(Problem{host, std::move(record), nullptr, nullptr});
    sim::make_terms({&problem->record, 1}, host);
    problem->model = host.make_model(problem->record.model, problem->record.model_options);
    problem->built = sim::build(problem->record, sim::as_integrated(problem->record, problem->model));
    made.push_back(std::move(problem));
  }
  return made;
}

py::ssize_t intervals(const Problem& problem) { return problem.built->intervals(); }

/// The values of a point by variables of the problem, interval by interval.
void take_values(const Problem& problem, Solution& solution) {
  const HorizonStructure& structure = problem.built->structure();
  const auto n = static_cast<std::size_t>(problem.built->intervals()),
             nx = static_cast<std::size_t>(structure.vehicle_states()),
             nu = static_cast<std::size_t>(structure.inputs()), np = static_cast<std::size_t>(structure.parameters());
  solution.inputs.resize(n * nu);
  solution.parameters.resize(n * np);
  for (std::size_t i = 0; i <= n; ++i) {
    const double* row = solution.point.state(static_cast<int>(i));
    solution.states.insert(solution.states.end(), row, row + nx);
    if (i == n) break;
    structure.inputs_on(solution.point, static_cast<int>(i), solution.inputs.data() + i * nu);
    structure.parameters_on(solution.point, static_cast<int>(i), solution.parameters.data() + i * np);
  }
}

void take_covariances(const HorizonProblem& problem, Solver& solver, Solution& solution) {
  const auto ns = static_cast<std::size_t>(problem.capacity().states);
  solution.covariances.resize(static_cast<std::size_t>(problem.intervals() + 1) * ns * ns);
  if (!solver.covariances(solution.point, {0, problem.intervals()}, solution.covariances))
    throw Error(
        fmt::format("covariances: the solver '{}' gives none of this problem; sparse_sqp and gn_rti give those of "
                    "estimation problems whose Hessian is regular",
                    solution.outcome.solver));
}

void check_kind(const Problem& problem, bool covariances) {
  if (covariances && problem.record.kind != "rhe")
    throw Error(fmt::format("covariances: {}: a problem of the kind '{}' has none; expected one of estimation",
                            problem.record.id, problem.record.kind));
}

std::unique_ptr<Solution> solve(const std::shared_ptr<const Problem>& problem, const std::string& solver_name,
                                const Settings& options, std::optional<double> deadline, bool cold, bool covariances) {
  check_kind(*problem, covariances);
  const std::shared_ptr<Solver> solver = problem->host.make_solver(solver_name, options);
  HorizonProblem& ocp = *problem->built;
  if (const std::string reason = solver->why_not(ocp); !reason.empty())
    throw Error(fmt::format("{}: solver '{}' cannot take this problem: {}; choose another one of rhec.plugins()",
                            problem->record.id, solver_name, reason));
  auto made = std::make_unique<Solution>();
  made->problem = problem;
  const py::gil_scoped_release others_go_on;
  solver->setup(ocp);
  made->point = Iterate(ocp.capacity());
  if (cold)
    sim::cold_start(problem->record, ocp, made->point);
  else
    sim::start(problem->record, ocp, made->point);
  const Clock::time_point end = deadline_in(deadline), start = Clock::now();
  solver->prepare(made->point);
  made->report = solver->solve(made->point, end);
  const double seconds = std::chrono::duration<double>(Clock::now() - start).count();
  StageQp qp(ocp.capacity());
  std::vector<double> scratch(ocp.scratch_size());
  assess(ocp, made->point, qp, scratch, made->report);
  made->outcome = {
      solver_name,  made->report.status, made->report.iterations, made->report.objective, made->report.kkt.largest(),
      1e6 * seconds};
  take_values(*problem, *made);
  if (covariances) take_covariances(ocp, *solver, *made);
  return made;
}

/// Objective and largest defect of a point given by values of the variables.
py::dict evaluate(const Problem& problem, const Numbers& states, const Numbers& inputs, const Numbers& parameters) {
  const HorizonProblem& ocp = *problem.built;
  const HorizonStructure& structure = ocp.structure();
  const py::ssize_t n = intervals(problem), nx = structure.vehicle_states(), nu = structure.inputs(),
                    np = structure.parameters();
  const auto check = [](const Numbers& given, py::ssize_t rows, py::ssize_t width, const char* what) {
    if (given.ndim() != 2 || given.shape(0) != rows || given.shape(1) != width)
      throw Error(fmt::format("{}: expected an array ({}, {})", what, rows, width));
  };
  check(states, n + 1, nx, "states");
  check(inputs, n, nu, "inputs");
  check(parameters, n, np, "parameters");
  Iterate point(ocp.capacity());
  for (py::ssize_t i = 0; i <= n; ++i) {
    double* row = point.state(static_cast<int>(i));
    std::copy_n(states.data() + i * nx, nx, row);
    std::copy_n(parameters.data() + (i > 0 ? i - 1 : 0) * np, n > 0 ? np : 0, row + nx);
  }
  structure.set_decisions(point, inputs.data(), parameters.data());
  for (int i = 0; i < static_cast<int>(n); ++i) structure.carry_lifted(i, point);
  std::vector<double> scratch(ocp.scratch_size());
  py::dict made;
  std::vector<double> defects(static_cast<std::size_t>((n + 1) * ocp.capacity().states));
  made["objective"] = ocp.evaluate(point, defects.data(), scratch);
  double largest = 0.0;
  for (const double defect : defects) largest = std::max(largest, std::abs(defect));
  made["defect"] = largest;
  return made;
}

void bind_solutions(py::module_& module) {
  const auto array = [](std::vector<double> Solution::*of, py::ssize_t more, auto width) {
    return [of, more, width](const py::object& self) {
      const auto& solution = self.cast<const Solution&>();
      return view(
          (solution.*of).data(),
          {intervals(*solution.problem) + more, static_cast<py::ssize_t>(width(solution.problem->built->structure()))},
          self);
    };
  };
  py::class_<Solution>(module, "Solution",
                       "What a solver made of a problem. Its arrays are read-only views; they keep it alive.")
      .def("__reduce_ex__", not_copied("keep copies of its arrays, or its line()"))
      .def_property_readonly("report", [](const Solution& self) { return self.report; })
      .def_property_readonly("status", [](const Solution& self) { return name_of(self.report.status); })
      .def_property_readonly(
          "usable", [](const Solution& self) { return is_usable(self.report.status); },
          "whether it may be used: all but infeasible and bad_input")
      .def_property_readonly("objective", [](const Solution& self) { return self.report.objective; })
      .def_property_readonly(
          "kkt", [](const Solution& self) { return named(dict_of(self.report.kkt)); },
          "KKT residual, measured alike for all solvers (docs/method.md, section 7)")
      .def_property_readonly(
          "seconds", [](const Solution& self) { return 1e-6 * self.outcome.solve_time_us; }, "of the solve")
      .def_property_readonly("states",
                             array(&Solution::states, 1, [](const HorizonStructure& s) { return s.vehicle_states(); }),
                             "(N + 1, n_x)")
      .def_property_readonly(
          "inputs", array(&Solution::inputs, 0, [](const HorizonStructure& s) { return s.inputs(); }), "(N, n_u)")
      .def_property_readonly("parameters",
                             array(&Solution::parameters, 0, [](const HorizonStructure& s) { return s.parameters(); }),
                             "(N, n_p)")
      .def_property_readonly(
          "covariances",
          [](const py::object& self) -> py::object {
            const auto& solution = self.cast<const Solution&>();
            if (solution.covariances.empty()) return py::none();
            const py::ssize_t ns = solution.problem->built->capacity().states;
            return view(solution.covariances.data(), {intervals(*solution.problem) + 1, ns, ns}, self);
          },
          "of [state; parameters] at each node, (N + 1, n_s, n_s), if they were asked for")
      .def(
          "line",
          [](const Solution& self) {
            return sim::solution_line(self.problem->record, *self.problem->built, self.point, self.outcome);
          },
          "As a line of a solution file (docs/problem_format.md).")
      .def("__repr__", [](const Solution& self) {
        return fmt::format("<{}: {}, objective {:.6g}, KKT residual {:.1e}, {:.0f} us>", self.outcome.solver,
                           name_of(self.report.status), self.report.objective, self.report.kkt.largest(),
                           self.outcome.solve_time_us);
      });
}

}  // namespace

void bind_problems(py::module_& module) {
  py::class_<Problem, std::shared_ptr<Problem>>(module, "ProblemBase")
      .def_property_readonly("id", [](const Problem& self) { return self.record.id; })
      .def_property_readonly("kind", [](const Problem& self) { return self.record.kind; })
      .def_property_readonly("intervals", &intervals)
      .def_property_readonly("vehicle",
                             [](const Problem& self) {
                               return Vehicle{self.model, self.model->description()};
                             })
      .def_property_readonly("state_names",
                             [](const Problem& self) { return names_of(self.built->model().description().states); })
      .def_property_readonly("input_names",
                             [](const Problem& self) { return names_of(self.built->model().description().inputs); })
      .def_property_readonly("parameter_names",
                             [](const Problem& self) { return names_of(self.built->model().description().parameters); })
      .def("line", [](const Problem& self) { return sim::problem_line(self.record); })
      .def("solve", &solve, py::arg("solver"), py::arg("options"), py::arg("deadline"), py::arg("cold"),
           py::arg("covariances"))
      .def("evaluate", &evaluate, py::arg("states"), py::arg("inputs"), py::arg("parameters"));
  bind_solutions(module);
  module.def("problems", &problems_of, py::arg("plugin_path"), py::arg("text"), py::arg("name"));
}

}  // namespace rhec::python
