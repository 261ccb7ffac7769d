#include "support/cart.hpp"

#include <cmath>
#include <utility>

#include "rhec/core/model/formula_model.hpp"

namespace rhec::testing {
namespace {

template <class Scalar>
struct Cart {
  static constexpr int state_count = 2, input_count = 1, parameter_count = 2, output_count = 2;
  void dynamics(const Scalar* x, const Scalar* u, const Scalar* p, Scalar* dxdt) const {
    dxdt[0] = x[1];
    dxdt[1] = p[1] * u[0] - p[0] * x[1] * x[1];
  }
  void outputs(const Scalar* x, Scalar* y) const {
    y[0] = x[0];
    y[1] = x[1] * x[1];
  }
};

}  // namespace

std::shared_ptr<const Model> cart() {
  ModelDescription about;
  about.name = "cart";
  about.states = {{.name = "x", .unit = "m", .meaning = "position", .scale = 2.0},
                  {.name = "v", .unit = "m/s", .meaning = "speed", .lower = -5.0, .upper = 5.0}};
  about.inputs = {{.name = "a", .unit = "m/s2", .meaning = "acceleration", .lower = -1.0, .upper = 1.0}};
  about.parameters = {{.name = "drag", .unit = "1/m", .meaning = "drag", .lower = 0.0, .upper = 0.5, .nominal = 0.0},
                      {.name = "gain", .unit = "1", .meaning = "gain of the motor", .lower = 0.2, .upper = 2.0}};
  about.outputs = {{.name = "x", .unit = "m", .meaning = "position"}, {.name = "w", .unit = "m2/s2", .meaning = "v^2"}};
  about.roles = {.position_x = 0};
  return std::make_shared<FormulaModel<Cart>>(Cart<double>{}, about);
}

std::unique_ptr<RhcProblem> cart_control(int intervals, std::vector<int> blocked_inputs) {
  RhcProblem::Setup setup;
  setup.max_intervals = intervals;
  setup.state_weights = {2.0, 0.5};
  setup.terminal_weights = {7.0, 0.0};
  setup.input_weights = {0.3};
  setup.blocked_inputs = std::move(blocked_inputs);
  auto problem = std::make_unique<RhcProblem>(cart(), setup);
  problem->set_intervals(intervals);
  for (int i = 0; i < intervals; ++i) problem->set_duration(i, 0.2);
  for (int i = 0; i <= intervals; ++i) {
    problem->state_reference(i)[0] = 0.1 * i;
    problem->state_reference(i)[1] = 0.5;
    if (i < intervals) problem->input_reference(i)[0] = 0.05;
  }
  problem->given_state()[0] = -0.3;
  problem->given_state()[1] = 1.0;
  problem->given_parameters()[0] = 0.1;
  problem->given_parameters()[1] = 0.9;
  std::vector<double> scratch(problem->scratch_size());
  problem->finish(scratch);
  return problem;
}

std::unique_ptr<RheProblem> cart_estimation(int intervals, RheProblem::Setup setup) {
  setup.max_intervals = intervals;
  if (setup.output_weights.empty()) setup.output_weights = {4.0, 1.0};
  if (setup.input_weights.empty()) setup.input_weights = {25.0};
  auto problem = std::make_unique<RheProblem>(cart(), setup);
  problem->set_intervals(intervals);
  for (int i = 0; i < intervals; ++i) problem->set_duration(i, 0.2);
  problem->finish();
  problem->arrival_mean = Eigen::Vector4d(0.1, 0.8, 0.2, 1.0);
  problem->arrival_information = Eigen::Vector4d(1.0, 2.0, 30.0, 10.0).asDiagonal();
  for (int i = 0; i <= intervals; ++i) {
    problem->output(i)[0] = 0.2 * i + 0.05 * std::sin(3.0 * i);
    problem->output(i)[1] = 1.0 + 0.1 * std::cos(2.0 * i);
    if (i < intervals) problem->measured_input(i)[0] = 0.3 * std::sin(1.0 * i);
  }
  return problem;
}

Iterate scattered_point(const Ocp& ocp) {
  Iterate point(ocp.capacity());
  double next = 0.0;
  const auto fill = [&next](double* row, int count, double middle) {
    for (int j = 0; j < count; ++j) row[j] = middle + 0.3 * std::sin(next += 1.0);
  };
  for (int i = 0; i <= ocp.intervals(); ++i) {
    fill(point.state(i), ocp.state_count(i), 0.5);
    fill(point.costate(i), ocp.state_count(i), 0.0);
    if (i < ocp.intervals()) fill(point.control(i), ocp.control_count(i), 0.2);
  }
  return point;
}

}  // namespace rhec::testing
