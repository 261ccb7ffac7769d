#include "core/model/graph_steps.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "models/bicycle_slip/bicycle_slip.hpp"
#include "rhec/core/model/step_graph.hpp"

namespace rhec {
namespace graph_steps_test {

TEST(LoadColumns, RepeatsTheLastRow) {
  const double rows[] = {1, 2, 3, 4};
  double registers[2 * GraphSteps::lanes];
  load_columns(rows, 2, 2, registers);
  for (int i = 0; i < GraphSteps::lanes; ++i) {
    EXPECT_EQ(registers[i], i == 0 ? 1 : 3);
    EXPECT_EQ(registers[GraphSteps::lanes + i], i == 0 ? 2 : 4);
  }
}

// With many short steps the derivatives of an interval are those of its differences, whatever the number of steps.
TEST(GraphSteps, DerivativesOfManyStepsAreThoseOfTheirValues) {
  const VehicleGraph vehicle = trace<BicycleSlip>();
  const StepGraph step = StepGraph::make(vehicle, false);
  std::vector<int> slopes = step.next, bends;
  slopes.insert(slopes.end(), step.jacobian.nodes.begin(), step.jacobian.nodes.end());
  bends = slopes;
  bends.insert(bends.end(), step.hessian.nodes.begin(), step.hessian.nodes.end());
  const Tape values(*vehicle.graph, step.arguments(), step.next, vehicle.options),
      jacobians(*vehicle.graph, step.arguments(), slopes, vehicle.options),
      hessians(*vehicle.graph, step.arguments(), bends, vehicle.options);
  constexpr int nx = 4, nu = 2, np = 2, nz = 8;
  const std::size_t registers = std::max({values.scratch(8), jacobians.scratch(8), hessians.scratch(8)});
  std::vector<double> x{1.0, 2.0, 0.3, 0.2}, u{3.0, 0.4}, p{0.8, 0.7}, weights{0.5, -1.0, 2.0, 0.3};
  const double duration = 0.5;
  const auto integrate = [&](std::vector<double>* next, std::vector<double>* slope, std::vector<double>* bend) {
    std::vector<double> memory(GraphSteps::memory(nx, nz) + registers + 8);
    auto* aligned = memory.data();
    while (reinterpret_cast<std::uintptr_t>(aligned) % 64) ++aligned;
    Model::Intervals request;
    request.count = 1;
    request.states = x.data();
    request.inputs = u.data();
    request.parameters = p.data();
    request.durations = &duration;
    request.substeps = 6;
    if (next) request.next_states = next->data();
    if (slope) request.jacobians = slope->data();
    if (bend) {
      request.multipliers = weights.data();
      request.hessians = bend->data();
    }
    GraphSteps steps({&values, &jacobians, &hessians, runnable_tape_kernels().back(), nx, nu, np}, request, aligned);
    steps.integrate(0, 1);
  };
  std::vector<double> next(nx), slope(nx * nz), bend(nz * nz);
  integrate(&next, &slope, &bend);
  double* const variables[nz] = {&x[0], &x[1], &x[2], &x[3], &u[0], &u[1], &p[0], &p[1]};
  const double h = 1e-5;
  for (int c = 0; c < nz; ++c) {
    std::vector<double> ahead(nx), behind(nx), slope_ahead(nx * nz), slope_behind(nx * nz);
    const double origin = *variables[c];
    *variables[c] = origin + h;
    integrate(&ahead, &slope_ahead, nullptr);
    *variables[c] = origin - h;
    integrate(&behind, &slope_behind, nullptr);
    *variables[c] = origin;
    for (int r = 0; r < nx; ++r) EXPECT_NEAR(slope[c * nx + r], (ahead[r] - behind[r]) / (2 * h), 1e-8);
    for (int d = 0; d < nz; ++d) {
      double expected = 0.0;
      for (int r = 0; r < nx; ++r)
        expected += weights[r] * (slope_ahead[d * nx + r] - slope_behind[d * nx + r]) / (2 * h);
      EXPECT_NEAR(bend[c * nz + d], expected, 1e-7) << c << ", " << d;
    }
  }
}

}  // namespace graph_steps_test
}  // namespace rhec
