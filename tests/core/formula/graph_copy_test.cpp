#include "rhec/core/formula/graph_copy.hpp"

#include <gtest/gtest.h>

#include <string>
#include <tuple>
#include <vector>

#include "rhec/core/formula/derivatives.hpp"
#include "rhec/core/formula/expression.hpp"

namespace rhec {
namespace graph_copy_test {

TEST(GraphCopy, HasWhatIsAskedForAndNothingElse) {
  Graph from, to;
  const Expression x = Expression::input(from, "x"), y = Expression::input(from, "y");
  const Expression speed = named(x * y, "speed"), wanted = pow(sin(speed) - 3.0 / y, 3) + atan2(x, speed);
  const int target = wanted.node_in(from), variable = x.node_in(from);
  jacobian(from, {&target, 1}, {&variable, 1});  // makes nodes that are not wanted
  const int needed = from.count_operations({&target, 1});
  const int copy = copy_nodes(from, {&target, 1}, to)[0];
  EXPECT_EQ(to.count_operations({&copy, 1}), needed);
  EXPECT_EQ(to.size(), static_cast<int>(from.reach({&target, 1}).size()));
  const auto named_there = [&](const std::string& name) {
    int found = -1;
    for (int node = 0; node < to.size(); ++node)
      if (to.name_of(node) == name) found = node;
    return found;
  };
  EXPECT_GE(named_there("speed"), 0);
  const int inputs[] = {variable, y.node_in(from)}, inputs_there[] = {named_there("x"), named_there("y")};
  const double values[] = {0.7, -1.3};
  EXPECT_EQ(to.evaluate({&copy, 1}, inputs_there, values), from.evaluate({&target, 1}, inputs, values));
}

TEST(GraphCopy, UsesWhatIsThereAlready) {
  Graph from, to;
  const Expression x = Expression::input(from, "x"), y = x * x + 1.0;
  const int target = y.node_in(from), known = x.node_in(from), there = to.input("z");
  const int copy = copy_nodes(from, {&target, 1}, to, {&known, 1}, {&there, 1})[0];
  const double value = 3.0;
  EXPECT_EQ(to.evaluate({&copy, 1}, {&there, 1}, {&value, 1})[0], 10.0);
}

// Compilers evaluate operands from the left or from the right; the copies are the same, node by node.
TEST(GraphCopy, HasAnOrderThatFollowsFromTheFormula) {
  const auto copied = [](bool from_the_left) {
    Graph from, to;
    const Expression x = Expression::input(from, "x"), y = Expression::input(from, "y");
    Expression left, right;
    if (from_the_left) left = sin(x) * y;
    right = cos(y) * x;
    if (!from_the_left) left = sin(x) * y;
    const int wanted[] = {(left + right).node_in(from), (left - right).node_in(from)};
    const int known[] = {x.node_in(from), y.node_in(from)};
    const int known_there[] = {to.input("x"), to.input("y")};
    copy_nodes(from, wanted, to, known, known_there);
    std::vector<std::tuple<Operation, int, int>> nodes;
    for (int node = 0; node < to.size(); ++node) nodes.emplace_back(to[node].operation, to[node].a, to[node].b);
    return nodes;
  };
  EXPECT_EQ(copied(true), copied(false));
}

}  // namespace graph_copy_test
}  // namespace rhec
