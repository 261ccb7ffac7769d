#pragma once

// Problems that the tests of nlopt share, and the solver with options.

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "rhec/core/base/error.hpp"
#include "rhec/core/model/formula_model.hpp"
#include "rhec/core/ocp/solver.hpp"
#include "rhec/plugins/host/host.hpp"
#include "rhec/plugins/yaml/yaml.hpp"
#include "support/error_of.hpp"
#include "support/random_problem.hpp"
#include "support/test_models.hpp"

namespace rhec::nlopt::testing {

using rhec::testing::Integrator;
using rhec::testing::RandomProblem;

inline const Host& host() {
  static const Host one;
  return one;
}
inline std::shared_ptr<Solver> nlopt_with(const std::string& options) {
  return host().make_solver("nlopt", parse_yaml(options, "options"));
}
inline std::shared_ptr<const Model> bicycle() { return host().make_model("bicycle_slip"); }

inline std::string error_of_options(const std::string& options) {
  return error_of([&] { nlopt_with(options); });
}

/// A controller's problem that starts off its path, with limits of the steering rate that bind.
inline std::unique_ptr<RhcProblem> tight_control(RandomProblem& random, int intervals) {
  RandomProblem::RhcSpec spec;
  spec.intervals = intervals;
  spec.off = 0.4;
  auto problem = random.rhc(spec);
  for (int i = 0; i < intervals; ++i) {
    problem->input_lower(i, 1) = -0.1;
    problem->input_upper(i, 1) = 0.1;
  }
  std::vector<double> scratch(problem->scratch_size());
  problem->finish(scratch);
  return problem;
}

inline int bounds_held(const Ocp& ocp, const Iterate& point) {
  int held = 0;
  for (int i = 0; i <= ocp.intervals(); ++i) {
    for (int j = 0; j < ocp.state_count(i); ++j) held += std::abs(point.state_bound(i)[j]) > 1e-6;
    if (i == ocp.intervals()) break;
    for (int j = 0; j < ocp.control_count(i); ++j) held += std::abs(point.control_bound(i)[j]) > 1e-6;
  }
  return held;
}

struct Limits {
  std::vector<double> state_lower, state_upper, input_lower, input_upper;
};
template <template <class> class Formula = Integrator>
std::unique_ptr<RheProblem> integrator(int intervals, const Limits& limits) {
  ModelDescription about;
  about.name = "integrator";
  about.states = {{.name = "x", .unit = "m", .meaning = "position"}};
  about.inputs = {{.name = "u", .unit = "m/s", .meaning = "speed"}};
  about.outputs = {{.name = "y", .unit = "m", .meaning = "position"}};
  RheProblem::Setup setup;
  setup.max_intervals = std::max(intervals, 1);
  setup.output_weights = {1.0};
  setup.input_weights = {1.0};
  setup.state_lower = limits.state_lower;
  setup.state_upper = limits.state_upper;
  setup.input_lower = limits.input_lower;
  setup.input_upper = limits.input_upper;
  auto problem = std::make_unique<RheProblem>(std::make_shared<FormulaModel<Formula>>(Formula<double>{}, about), setup);
  problem->set_intervals(intervals);
  problem->finish();
  problem->arrival_information(0, 0) = 1.0;
  for (int i = 0; i <= intervals; ++i) {
    problem->output(i)[0] = 0.5;
    if (i == intervals) break;
    problem->measured_input(i)[0] = 0.25;
    problem->set_duration(i, 1.0);
  }
  return problem;
}
inline const Limits unlimited = {{-HUGE_VAL}, {HUGE_VAL}, {-HUGE_VAL}, {HUGE_VAL}};
inline const Limits limited_inputs = {{-HUGE_VAL}, {HUGE_VAL}, {-1.0}, {1.0}};
inline const Limits limited_states = {{-2.0}, {2.0}, {-1.0}, {1.0}};

}  // namespace rhec::nlopt::testing
