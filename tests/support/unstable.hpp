#pragma once

#include <cmath>
#include <memory>
#include <vector>

#include "rhec/core/horizon/rhc_problem.hpp"
#include "rhec/core/model/formula_model.hpp"

namespace rhec::testing {

/// x' = 3 x + u + x u / 2: a deviation grows by e^(3 t).
template <class Scalar>
struct Unstable {
  static constexpr int state_count = 1, input_count = 1, parameter_count = 0, output_count = 1;
  void dynamics(const Scalar* x, const Scalar* u, const Scalar*, Scalar* dxdt) const {
    dxdt[0] = 3.0 * x[0] + u[0] + 0.5 * x[0] * u[0];
  }
  void outputs(const Scalar* x, Scalar* y) const { y[0] = x[0]; }
};

/// It follows a sine in steps of 0.2 s. The reference inputs lead far away by simulation.
inline std::unique_ptr<RhcProblem> unstable_control(int intervals) {
  ModelDescription about;
  about.name = "unstable";
  about.states = {{.name = "x", .unit = "m", .meaning = "position"}};
  about.inputs = {{.name = "u", .unit = "m/s", .meaning = "speed"}};
  about.outputs = {{.name = "y", .unit = "m", .meaning = "position"}};
  RhcProblem::Setup setup;
  setup.max_intervals = intervals;
  setup.state_weights = {1.0};
  setup.input_weights = {0.1};
  setup.terminal_weights = {1.0};
  auto problem =
      std::make_unique<RhcProblem>(std::make_shared<FormulaModel<Unstable>>(Unstable<double>{}, about), setup);
  problem->set_intervals(intervals);
  for (int i = 0; i <= intervals; ++i) {
    problem->state_reference(i)[0] = std::sin(0.3 * i);
    if (i == intervals) break;
    problem->set_duration(i, 0.2);
    problem->input_reference(i)[0] = 0.3 * std::sin(i) + 0.5;
  }
  problem->given_state()[0] = 0.1;
  std::vector<double> scratch(problem->scratch_size());
  problem->finish(scratch);
  return problem;
}

/// The simulation of the reference inputs.
inline Iterate unstable_guess(const RhcProblem& problem) {
  Iterate guess(problem.capacity());
  guess.state(0)[0] = problem.initial_state()[0];
  for (int i = 0; i < problem.intervals(); ++i) guess.control(i)[0] = 0.3 * std::sin(i) + 0.5;
  std::vector<double> scratch(problem.scratch_size());
  roll_out(problem, guess, scratch);
  return guess;
}

}  // namespace rhec::testing
