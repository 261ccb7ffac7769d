#include "sim/check/node_labels.hpp"

#include <gtest/gtest.h>

#include "sim/support/tank_graph.hpp"

namespace rhec::sim {
namespace node_labels_test {

TEST(NodeLabels, AreTheDescriptionsNames) {
  const TankGraph tank;
  const NodeLabels labels(tank.vehicle, tank.about);
  Graph& graph = *tank.vehicle.graph;
  EXPECT_EQ(labels.name(tank.vehicle.states[0]), "level");  // not x0
  EXPECT_EQ(labels.term(tank.vehicle.states[0]), "state");
  EXPECT_EQ(labels.term(tank.vehicle.inputs[0]), "input");
  EXPECT_EQ(labels.term(tank.vehicle.parameters[0]), "parameter");
  EXPECT_EQ(labels.name(tank.vehicle.options[0].node), "hole");
  EXPECT_EQ(labels.term(tank.vehicle.options[0].node), "option");
  EXPECT_EQ(labels.name(tank.vehicle.rates[0]), "level'");
  EXPECT_EQ(labels.name(tank.vehicle.outputs[0]), "seen");
  EXPECT_EQ(labels.name(tank.vehicle.outputs[1]), "wheel");  // a state that is measured
  EXPECT_EQ(labels.term(tank.vehicle.outputs[1]), "state");
  EXPECT_EQ(labels.term(tank.vehicle.outputs[0]), "log(level)");
  const int product = graph[tank.vehicle.rates[0]].a;
  EXPECT_EQ(labels.term(product), "hole * outflow");
  EXPECT_EQ(labels.term(tank.vehicle.rates[0]), "-" + labels.word(product));
  EXPECT_EQ(labels.word(product), "n" + std::to_string(product));
}

TEST(NodeLabels, WriteEachOperation) {
  TankGraph tank;
  Graph& graph = *tank.vehicle.graph;
  const NodeLabels labels(tank.vehicle, tank.about);
  const int a = tank.vehicle.states[0], b = tank.vehicle.states[1];
  EXPECT_EQ(labels.term(graph.add(a, b)), "level + wheel");
  EXPECT_EQ(labels.term(graph.subtract(b, a)), "wheel - level");
  EXPECT_EQ(labels.term(graph.reciprocal(b)), "1 / wheel");
  EXPECT_EQ(labels.term(graph.power(b, 5)), "wheel^5");
  EXPECT_EQ(labels.term(graph.function(Operation::arc_tangent_2, a, b)), "atan2(level, wheel)");
  EXPECT_EQ(labels.term(graph.multiply(graph.constant(2.5), b)), "2.5 * wheel");
  EXPECT_EQ(labels.term(graph.constant(7.0)), "constant");
}

TEST(NodeLabels, GiveANameToWhatHasNone) {
  TankGraph tank;
  Graph& graph = *tank.vehicle.graph;
  NodeLabels labels(tank.vehicle, tank.about);
  const int sum = graph.add(tank.vehicle.states[0], tank.vehicle.states[1]);
  labels.add(sum, "d level' / d u");
  labels.add(sum, "second");
  labels.add(tank.vehicle.states[0], "third");
  EXPECT_EQ(labels.name(sum), "d level' / d u");
  EXPECT_EQ(labels.word(sum), "n" + std::to_string(sum));  // "d level' / d u * wheel" would be read otherwise
  EXPECT_EQ(labels.name(tank.vehicle.states[0]), "level");
}

}  // namespace node_labels_test
}  // namespace rhec::sim
