#include "rhec/core/formula/derivatives.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>
#include <string>
#include <vector>

#include "rhec/core/formula/expression.hpp"

namespace rhec {
namespace derivatives_test {

using Formula = std::function<Expression(const Expression&, const Expression&)>;
struct Case {
  std::string name;
  Formula formula;
};
const std::vector<Case>& cases() {
  static const std::vector<Case> all = {
      {"sum", [](const auto& x, const auto& y) { return 3 * x - y + 1; }},
      {"product", [](const auto& x, const auto& y) { return x * y * x; }},
      {"quotient", [](const auto& x, const auto& y) { return (x + 1) / (y * y + 2); }},
      {"power", [](const auto& x, const auto& y) { return pow(x, 5) * pow(y + 2, -3); }},
      {"sqrt", [](const auto& x, const auto& y) { return sqrt(x * x + y + 2); }},
      {"exp", [](const auto& x, const auto& y) { return exp(x * y); }},
      {"log", [](const auto& x, const auto& y) { return log(x * x + y * y + 0.3); }},
      {"sin", [](const auto& x, const auto& y) { return sin(x * y) * cos(x - y); }},
      {"tan", [](const auto& x, const auto& y) { return tan(0.5 * x + 0.1 * y); }},
      {"asin", [](const auto& x, const auto& y) { return asin(0.6 * x * y) - acos(0.3 * (x + y)); }},
      {"atan", [](const auto& x, const auto& y) { return atan(4 * x * y); }},
      {"atan2", [](const auto& x, const auto& y) { return atan2(x + 0.2, y - 0.4); }},
      {"tanh", [](const auto& x, const auto& y) { return tanh(3 * x) * y; }},
      {"shared",
       [](const auto& x, const auto& y) {
         const auto s = sin(x) + y;
         return s * s / (1 + s * s);
       }},
      {"smooth", [](const auto& x, const auto& y) { return smooth_max(x, y, 0.2) + smooth_abs(x, 0.1); }},
  };
  return all;
}

class Derivatives : public testing::TestWithParam<Case> {
 protected:
  Graph g_;
  const Expression x_ = Expression::input(g_, "x"), y_ = Expression::input(g_, "y");
  const std::vector<int> variables_{x_.node_in(g_), y_.node_in(g_)};
  const int target_ = GetParam().formula(x_, y_).node_in(g_);

  double value(int node, const std::vector<double>& at) { return g_.evaluate({&node, 1}, variables_, at)[0]; }
  /// By five points, whose error is of the fourth order.
  double difference(int node, std::vector<double> at, int variable) {
    const double h = 1e-3, origin = at[variable];
    const auto f = [&](double step) {
      at[variable] = origin + step;
      return value(node, at);
    };
    return (8 * (f(h) - f(-h)) - (f(2 * h) - f(-2 * h))) / (12 * h);
  }
  template <class Check>
  void at_random_points(Check check) {
    std::mt19937 random(3);
    std::uniform_real_distribution<double> uniform(-0.9, 0.9);
    for (int k = 0; k < 20; ++k) check(std::vector<double>{uniform(random), uniform(random)});
  }
};
INSTANTIATE_TEST_SUITE_P(All, Derivatives, testing::ValuesIn(cases()), [](const auto& c) { return c.param.name; });

TEST_P(Derivatives, FirstOnesAreThoseOfTheValues) {
  const NodeMatrix along = jacobian(g_, {&target_, 1}, variables_, Accumulation::forward),
                   back = jacobian(g_, {&target_, 1}, variables_, Accumulation::reverse);
  at_random_points([&](const std::vector<double>& at) {
    for (int c = 0; c < 2; ++c) {
      const double expected = difference(target_, at, c), tolerance = 1e-7 * (1 + std::abs(expected));
      EXPECT_NEAR(value(along.at(0, c), at), expected, tolerance);
      EXPECT_NEAR(value(back.at(0, c), at), value(along.at(0, c), at), 1e-12 * (1 + std::abs(expected)));
    }
  });
}

TEST_P(Derivatives, SecondOnesAreThoseOfTheFirst) {
  const int weight = g_.constant(1.7);
  const NodeMatrix hessian = weighted_hessian(g_, {&target_, 1}, {&weight, 1}, variables_);
  const std::vector<int> gradient = weighted_gradient(g_, {&target_, 1}, {&weight, 1}, variables_);
  at_random_points([&](const std::vector<double>& at) {
    for (int r = 0; r < 2; ++r)
      for (int c = 0; c < 2; ++c) {
        const double expected = difference(gradient[r], at, c);
        EXPECT_NEAR(value(hessian.at(r, c), at), expected, 3e-7 * (1 + std::abs(expected)));
        EXPECT_EQ(hessian.at(r, c), hessian.at(c, r));
      }
  });
}

TEST(Jacobian, ZerosAreKnown) {
  Graph g;
  const Expression x = Expression::input(g, "x"), y = Expression::input(g, "y");
  const std::vector<int> variables{x.node_in(g), y.node_in(g)},
      targets{sin(x).node_in(g), (y + 0 * x).node_in(g), g.constant(3.0)};
  const NodeMatrix slopes = jacobian(g, targets, variables);
  EXPECT_TRUE(g.is_constant(slopes.at(0, 1), 0.0));
  EXPECT_TRUE(g.is_constant(slopes.at(1, 0), 0.0));
  EXPECT_TRUE(g.is_constant(slopes.at(1, 1), 1.0));
  EXPECT_TRUE(g.is_constant(slopes.at(2, 0), 0.0));
}

// A derivative by a node in the middle: what it is computed from does not count.
TEST(Jacobian, IsPartialByInnerNodes) {
  Graph g;
  const Expression x = Expression::input(g, "x"), s = sin(x), f = s * s + x;
  const int inner = s.node_in(g), target = f.node_in(g);
  const NodeMatrix by_inner = jacobian(g, {&target, 1}, {&inner, 1});
  EXPECT_EQ(by_inner.at(0, 0), (2 * s).node_in(g));
}

// Forward takes one pass for each variable, reverse one for each target: many of one and few of the other decide.
TEST(Jacobian, TakesTheAccumulationOfFewerOperations) {
  Graph g;
  std::vector<Expression> x;
  std::vector<int> variables;
  Expression product = 1.0;
  for (int k = 0; k < 12; ++k) {
    x.push_back(Expression::input(g, "x"));
    variables.push_back(x.back().node_in(g));
    product *= sin(x.back());
  }
  const int target = product.node_in(g);
  const auto operations = [&](Accumulation how) {
    return g.count_operations(jacobian(g, {&target, 1}, variables, how).nodes);
  };
  EXPECT_LT(operations(Accumulation::reverse), operations(Accumulation::forward));
  EXPECT_EQ(operations(Accumulation::by_count), operations(Accumulation::reverse));

  Graph h;
  const Expression t = Expression::input(h, "t");
  const int variable = t.node_in(h);
  std::vector<int> targets;
  Expression chain = t;
  for (int k = 0; k < 12; ++k) targets.push_back((chain = sin(chain)).node_in(h));
  const auto count = [&](Accumulation how) {
    return h.count_operations(jacobian(h, targets, {&variable, 1}, how).nodes);
  };
  EXPECT_LT(count(Accumulation::forward), count(Accumulation::reverse));
  EXPECT_EQ(count(Accumulation::by_count), count(Accumulation::forward));
}

}  // namespace derivatives_test
}  // namespace rhec
