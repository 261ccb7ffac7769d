#include "rhec/core/model/step_graph.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "models/bicycle_sideslip/bicycle_sideslip.hpp"
#include "models/tractor_trailer/tractor_trailer.hpp"

namespace rhec {
namespace step_graph_test {

std::vector<double> evaluate(const VehicleGraph& vehicle, const StepGraph& step, const std::vector<int>& of) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> uniform(0.1, 0.6);
  const std::vector<int> arguments = step.arguments();
  std::vector<double> values(arguments.size());
  std::generate(values.begin(), values.end(), [&] { return uniform(random); });
  std::vector<int> known = arguments;
  for (const auto& [node, value] : vehicle.options) {
    known.push_back(node);
    values.push_back(value);
  }
  return vehicle.graph->evaluate(of, known, values);
}

template <template <class> class Formula>
void expect_same_curvature(bool ramp) {
  const VehicleGraph staged_vehicle = trace<Formula>(), whole_vehicle = trace<Formula>(),
                     best_vehicle = trace<Formula>();
  const StepGraph staged = StepGraph::make(staged_vehicle, ramp, StepCurvature::stages),
                  whole = StepGraph::make(whole_vehicle, ramp, StepCurvature::whole),
                  best = StepGraph::make(best_vehicle, ramp, StepCurvature::by_count);
  const auto one = evaluate(staged_vehicle, staged, staged.hessian.nodes),
             other = evaluate(whole_vehicle, whole, whole.hessian.nodes);
  ASSERT_EQ(one.size(), other.size());
  for (std::size_t k = 0; k < one.size(); ++k) EXPECT_NEAR(one[k], other[k], 1e-12 * (1.0 + std::abs(one[k]))) << k;
  const auto operations = [](const VehicleGraph& vehicle, const StepGraph& step) {
    std::vector<int> all = step.next;
    for (const auto* nodes : {&step.jacobian.nodes, &step.hessian.nodes})
      all.insert(all.end(), nodes->begin(), nodes->end());
    return vehicle.graph->count_operations(all);
  };
  EXPECT_LE(operations(best_vehicle, best), operations(staged_vehicle, staged));
  EXPECT_LE(operations(best_vehicle, best), operations(whole_vehicle, whole));
}

// Two ways to the same second derivatives, of which neither takes fewer operations for all vehicles.
TEST(StepGraph, BothCurvaturesAgreeAndTheShorterIsTaken) {
  for (const bool ramp : {false, true}) {
    expect_same_curvature<BicycleSideslip>(ramp);
    expect_same_curvature<TractorTrailer>(ramp);
  }
}

// A ramp that does not rise is a constant parameter.
TEST(StepGraph, ARampWithoutARiseIsAStep) {
  const VehicleGraph vehicle = trace<BicycleSideslip>();
  const StepGraph steady = StepGraph::make(vehicle, false), ramped = StepGraph::make(vehicle, true);
  const std::size_t nx = vehicle.states.size(), np = vehicle.parameters.size(), nu = vehicle.inputs.size();
  std::vector<int> from(ramped.z.begin() + static_cast<std::ptrdiff_t>(nx + np + nu), ramped.z.end());
  from.push_back(ramped.h);
  std::vector<int> to = vehicle.parameters;
  to.push_back(steady.h);
  EXPECT_EQ(vehicle.graph->substitute(ramped.next, from, to), steady.next);
}

}  // namespace step_graph_test
}  // namespace rhec
