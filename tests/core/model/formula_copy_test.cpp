#include "rhec/core/model/formula_copy.hpp"

#include <gtest/gtest.h>

#include "rhec/core/model/step_graph.hpp"

namespace rhec {
namespace formula_copy_test {

VehicleGraph cart() {
  VehicleGraph made;
  Graph& graph = *made.graph;
  const Expression gain = Expression::input(graph, "gain"), x = Expression::input(graph, "x"),
                   idle = Expression::input(graph, "idle"), u = Expression::input(graph, "u");
  made.options = {{gain.node_in(graph), 2.0}};
  made.states = {x.node_in(graph), idle.node_in(graph)};
  made.inputs = {u.node_in(graph)};
  made.rates = {(gain * u).node_in(graph), graph.constant(0.0)};
  made.outputs = {x.node_in(graph), (x + gain).node_in(graph), sin(x).node_in(graph)};
  return made;
}

TEST(FormulaCopy, KeepsVariablesAndLeavesOutDerivatives) {
  const VehicleGraph vehicle = cart();
  const int formula = vehicle.graph->size();
  StepGraph::make(vehicle, false);
  ASSERT_GT(vehicle.graph->size(), 2 * formula);
  const VehicleGraph copy = formula_copy(vehicle);
  EXPECT_LE(copy.graph->size(), formula);
  ASSERT_EQ(copy.options.size(), 1u);
  EXPECT_EQ(copy.options[0].value, 2.0);
  EXPECT_EQ(copy.graph->name_of(copy.options[0].node), "gain");
  ASSERT_EQ(copy.states.size(), 2u);
  EXPECT_EQ(copy.graph->name_of(copy.states[1]), "idle");  // though nothing depends on it
  const int inputs[] = {copy.options[0].node, copy.states[0], copy.states[1], copy.inputs[0]};
  const double values[] = {2.0, 0.5, 0.0, 3.0};
  EXPECT_EQ(copy.graph->evaluate(copy.rates, inputs, values), (std::vector<double>{6.0, 0.0}));
  EXPECT_EQ(copy.graph->evaluate(copy.outputs, inputs, values)[1], 2.5);
}

TEST(FormulaCopy, TakesSomeOutputs) {
  const int chosen[] = {2, 0};
  const VehicleGraph copy = formula_copy(cart(), chosen);
  ASSERT_EQ(copy.outputs.size(), 2u);
  EXPECT_EQ((*copy.graph)[copy.outputs[0]].operation, Operation::sine);
  EXPECT_EQ(copy.outputs[1], copy.states[0]);
}

TEST(FormulaCopy, HasStraightMotionApart) {
  VehicleGraph vehicle = cart();
  Graph& graph = *vehicle.graph;
  const Expression speed = Expression::input(graph, "ground_speed"), gain(graph, vehicle.options[0].node);
  vehicle.straight =
      StraightMotion{speed.node_in(graph), {-1, (2.0 * speed).node_in(graph)}, {(speed / gain).node_in(graph)}};
  EXPECT_FALSE(formula_copy(vehicle).straight.has_value());
  const VehicleGraph copy = motion_copy(vehicle);
  ASSERT_TRUE(copy.straight.has_value());
  EXPECT_TRUE(copy.rates.empty());
  EXPECT_EQ(copy.straight->states[0], -1);
  const int wanted[] = {copy.straight->states[1], copy.straight->inputs[0]};
  const int inputs[] = {copy.straight->ground_speed, copy.options[0].node};
  const double values[] = {3.0, 2.0};
  EXPECT_EQ(copy.graph->evaluate(wanted, inputs, values), (std::vector<double>{6.0, 1.5}));
}

}  // namespace formula_copy_test
}  // namespace rhec
