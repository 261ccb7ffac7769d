#include "solvers/ipopt/limit_variables.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "rhec/core/base/infinity.hpp"
#include "support/cart.hpp"
#include "support/limited_ocp.hpp"

namespace rhec::ipopt {
namespace limit_variables_test {

using rhec::testing::cart_control;
using rhec::testing::Limit;
using rhec::testing::LimitedOcp;
using ::testing::Each;
using ::testing::ElementsAre;
using Vector = std::vector<double>;

/// Four limits at node 1: hard, soft on both sides, soft above, soft without a linear weight; the last rows of c.
struct Limited {
  Limited() {
    const auto add = [&](double lower, double upper, double linear, double quadratic) {
      limited.add(1, {Limit::Kind::linear, {0}, {1.0}, lower, upper, linear, quadratic});
    };
    add(-1.0, 1.0, infinity, 0.0);
    add(-1.0, 1.0, 5.0, 2.0);
    add(-infinity, 1.0, 7.0, 0.0);
    add(-1.0, 1.0, 0.0, 8.0);
    nlp.take_structure(limited);
    variables.take(limited, nlp);
  }
  std::unique_ptr<RhcProblem> cart = cart_control(1);
  LimitedOcp limited{*cart, 4};
  SparseNlp nlp;
  LimitVariables variables;
};

TEST(LimitVariables, MakeEquationsOfLimits) {
  const Limited of;
  ASSERT_EQ(of.nlp.constraints(), 8);  // behind the defects of two states and two parameters
  ASSERT_EQ(of.variables.count(), 7);
  Vector lower(7), upper(7);
  of.variables.bounds(lower.data(), upper.data());
  EXPECT_THAT(lower, ElementsAre(-1.0, -1.0, 0.0, 0.0, -infinity, 0.0, -infinity));
  EXPECT_THAT(upper, ElementsAre(1.0, 1.0, infinity, infinity, 1.0, infinity, infinity));
  std::vector<int> rows(7), columns(7);
  of.variables.jacobian_pattern(10, rows.data(), columns.data());
  EXPECT_THAT(rows, ElementsAre(4, 5, 5, 5, 6, 6, 7));
  EXPECT_THAT(columns, ElementsAre(10, 11, 12, 13, 14, 15, 16));
  Vector entries(7);
  of.variables.jacobian(entries.data());
  EXPECT_THAT(entries, ElementsAre(-1.0, -1.0, 1.0, -1.0, -1.0, -1.0, -1.0));
  of.variables.hessian_pattern(10, rows.data(), columns.data());
  EXPECT_THAT(rows, ElementsAre(10, 11, 12, 13, 14, 15, 16));
  EXPECT_EQ(rows, columns);
  const Vector within(7, 0.5), beyond(7, 1.5);
  of.variables.hessian(within.data(), entries.data());
  EXPECT_THAT(entries, ElementsAre(0.0, 0.0, 2.0, 2.0, 0.0, 0.0, 0.0));
  of.variables.hessian(beyond.data(), entries.data());
  EXPECT_THAT(entries, ElementsAre(0.0, 0.0, 2.0, 2.0, 0.0, 0.0, 8.0));
}

TEST(LimitVariables, StartWhereTheEquationsHoldAndCostWhatTheLimitsCost) {
  const Limited of;
  for (const double g : {-1.5, 0.25, 1.5}) {
    const Vector c{0.0, 0.0, 0.0, 0.0, g, g, g, g};
    Vector values(7), equations = c;
    of.variables.start(c.data(), nullptr, values.data(), nullptr);
    of.variables.add_to(values.data(), equations.data());
    EXPECT_THAT(equations, Each(0.0)) << g;
    EXPECT_EQ(of.variables.cost(values.data()), limit_costs(of.limited, 1, c.data() + 4).slack) << g;
    Vector derivatives(7);
    of.variables.gradient(values.data(), derivatives.data());
    for (int k = 0; k < 7; ++k) {
      Vector more = values, less = values;
      more[k] += 1e-6;
      less[k] -= 1e-6;
      EXPECT_NEAR(derivatives[k], (of.variables.cost(more.data()) - of.variables.cost(less.data())) / 2e-6, 1e-8);
    }
  }
}

TEST(LimitVariables, MultipliersOfTheirBoundsFollowFromThoseOfTheLimits) {
  const Limited of;
  // At the upper side: below its weight, violated by a quarter, violated, violated by a half.
  const Vector c{0.0, 0.0, 0.0, 0.0, 1.0, 1.25, 1.5, 1.5}, multipliers{0.0, 0.0, 0.0, 0.0, 3.0, 5.5, 6.0, 4.0};
  Vector values(7), bounds(7);
  of.variables.start(c.data(), multipliers.data(), values.data(), bounds.data());
  EXPECT_THAT(values, ElementsAre(1.0, 1.0, 0.0, 0.25, 1.0, 0.5, 1.5));
  // Stationarity in a slack: its weights, less or plus the limit's multiplier, and that of its own bound, are zero.
  EXPECT_THAT(bounds, ElementsAre(3.0, 5.5, -10.5, 0.0, 6.0, -1.0, 0.0));
}

}  // namespace limit_variables_test
}  // namespace rhec::ipopt
