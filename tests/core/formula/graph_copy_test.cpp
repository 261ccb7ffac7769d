#include "rhec/core/formula/graph_copy.hpp"

#include <gtest/gtest.h>

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
  // In the order in which they are met.
  EXPECT_EQ(to.name_of(0), "x");
  EXPECT_EQ(to.name_of(1), "y");
  bool is_named = false;
  for (int node = 0; node < to.size(); ++node) is_named = is_named || to.name_of(node) == "speed";
  EXPECT_TRUE(is_named);
  const int inputs[] = {variable, y.node_in(from)}, inputs_there[] = {0, 1};
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

}  // namespace graph_copy_test
}  // namespace rhec
