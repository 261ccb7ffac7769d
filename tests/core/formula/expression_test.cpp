#include "rhec/core/formula/expression.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "support/error_of.hpp"
#include "support/every_function.hpp"

namespace rhec {
namespace expression_test {

double value(Graph& graph, const Expression& of, const std::vector<int>& inputs, const std::vector<double>& values) {
  const int node = of.node_in(graph);
  return graph.evaluate({&node, 1}, inputs, values)[0];
}

TEST(Expression, RecordsAFormulaThatIsWrittenForAnyNumber) {
  Graph graph;
  std::vector<Expression> x, u, p;
  std::vector<int> inputs;
  for (auto* list : {&x, &u, &p})
    for (int k = 0; k < 3; ++k) {
      list->push_back(Expression::input(graph, "v"));
      inputs.push_back(list->back().node_in(graph));
    }
  const std::vector<double> at{0.3, -0.2, 0.6, 1.1, 0.0, 0.0, 0.4, -0.7, 0.0};
  const EveryFunction<double> of_doubles;
  const EveryFunction<Expression> formula;
  std::vector<Expression> rates(3), outputs(11);
  formula.dynamics(x.data(), u.data(), p.data(), rates.data());
  formula.outputs(x.data(), outputs.data());
  double expected_rates[3], expected_outputs[11];
  of_doubles.dynamics(at.data(), at.data() + 3, at.data() + 6, expected_rates);
  of_doubles.outputs(at.data(), expected_outputs);
  for (int k = 0; k < 3; ++k) EXPECT_NEAR(value(graph, rates[k], inputs, at), expected_rates[k], 1e-14) << k;
  for (int k = 0; k < 11; ++k) EXPECT_NEAR(value(graph, outputs[k], inputs, at), expected_outputs[k], 1e-14) << k;
}

TEST(Expression, TakesNumbersOnEitherSide) {
  Graph graph;
  const Expression x = Expression::input(graph, "x");
  const int node = x.node_in(graph);
  const auto at = [&](const Expression& of) { return value(graph, of, {node}, {0.5}); };
  EXPECT_EQ(at(2 * x + 1.0 - x / 4), 2 * 0.5 + 1.0 - 0.5 / 4);
  EXPECT_EQ(at(1 / x), 2.0);
  EXPECT_EQ(at(-x - 3), -3.5);
  EXPECT_EQ(at(pow(x, 3) + pow(x, -1)), 0.125 + 2.0);
  EXPECT_NEAR(at(pow(x, Expression(1.5))), std::pow(0.5, 1.5), 1e-15);
  EXPECT_EQ(at(hypot(x, 1.2)), std::sqrt(0.25 + 1.2 * 1.2));
  Expression sum = x;
  sum += 1;
  sum *= x;
  sum -= 0.25;
  sum /= 2.0;
  EXPECT_EQ(at(sum), 0.25);
}

TEST(Expression, ConstantsNeedNoGraph) {
  Graph graph;
  const Expression a = 2.0, b = 3;
  EXPECT_TRUE(graph.is_constant((a * b + 1).node_in(graph), 7.0));
  EXPECT_TRUE(graph.is_constant((a / b).node_in(graph), 2.0 / 3.0));
  EXPECT_TRUE(graph.is_constant(pow(a, 10).node_in(graph), 1024.0));
  EXPECT_TRUE(graph.is_constant(sin(a).node_in(graph), std::sin(2.0)));
}

TEST(Expression, RefusesWhatWasNotSetAndTwoGraphs) {
  Graph one, other;
  const Expression x = Expression::input(one, "x"), y = Expression::input(other, "y"), none;
  EXPECT_CONTAINS(error_of([&] { x* none; }), "a number that it has not set");
  EXPECT_CONTAINS(error_of([&] { sin(none); }), "a number that it has not set");
  EXPECT_CONTAINS(error_of([&] { x + y; }), "mixes numbers of two graphs");
}

TEST(Expression, IsNamed) {
  Graph graph;
  const Expression x = Expression::input(graph, "x");
  const Expression slip = named(x - 1.0, "slip angle");
  EXPECT_EQ(graph.name_of(slip.node_in(graph)), "slip angle");
  EXPECT_EQ(named(0.5, "slip angle"), 0.5);
}

// Smooth forms are as far from the sharp ones as their width says, for numbers as for graphs.
TEST(Smooth, IsAsFarAsTheWidthSays) {
  Graph graph;
  const Expression x = Expression::input(graph, "x");
  const int node = x.node_in(graph);
  for (const double at : {-3.0, -0.2, 0.0, 0.1, 5.0}) {
    const double width = 0.4;
    EXPECT_NEAR(value(graph, smooth_abs(x, width), {node}, {at}), smooth_abs(at, width), 1e-15);
    EXPECT_NEAR(value(graph, smooth_max(x, 1.0, width), {node}, {at}), smooth_max(at, 1.0, width), 1e-15);
    EXPECT_NEAR(value(graph, smooth_min(x, 1.0, width), {node}, {at}), smooth_min(at, 1.0, width), 1e-15);
    EXPECT_GE(smooth_abs(at, width), std::abs(at));
    EXPECT_LE(smooth_abs(at, width), std::abs(at) + width);
    EXPECT_GE(smooth_max(at, 1.0, width), std::max(at, 1.0));
    EXPECT_LE(smooth_max(at, 1.0, width), std::max(at, 1.0) + width / 2 + 1e-15);
    EXPECT_LE(smooth_min(at, 1.0, width), std::min(at, 1.0));
  }
  EXPECT_EQ(smooth_abs(0.0, 0.4), 0.4);
  EXPECT_EQ(smooth_max(2.0, 2.0, 0.4), 2.2);
  EXPECT_EQ(smooth_min(2.0, 2.0, 0.4), 1.8);
}

}  // namespace expression_test
}  // namespace rhec
