#include "solvers/sparse_sqp/row_costs.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>

#include "rhec/core/base/infinity.hpp"
#include "support/cart.hpp"
#include "support/limited_ocp.hpp"

namespace rhec::sparse_sqp {
namespace row_costs_test {

using rhec::testing::cart_control;
using rhec::testing::Limit;
using rhec::testing::LimitedOcp;

TEST(RowCosts, WithoutLimitsAreThoseOfDefects) {
  const auto cart = cart_control(3);
  SparseNlp nlp;
  nlp.take_structure(*cart);
  RowCosts costs;
  costs.take_structure(*cart, nlp);
  EXPECT_FALSE(costs.has_limits());
  EXPECT_TRUE(costs.take_limits(*cart, nlp));
  std::vector<double> c(nlp.constraints(), 0.0), stages(4, 1.0);
  c[0] = -2.0;
  c.back() = 0.5;
  EXPECT_EQ(costs.defect(c), 2.5);
  EXPECT_EQ(costs.slack_cost(c), 0.0);
  EXPECT_EQ(costs.merit(c, 10.0, stages), 25.0);
  EXPECT_EQ(stages, (std::vector<double>{21.0, 1.0, 6.0, 1.0}));
  EXPECT_EQ(costs.largest_price(c), 2.0);
}

TEST(RowCosts, HaveHardLimitsAmongDefectsAndPricesOfSoftOnes) {
  const auto cart = cart_control(2);
  LimitedOcp limited(*cart, 2);
  limited.add(1, {Limit::Kind::linear, {0}, {1.0}, -1.0, 1.0});
  limited.add(1, {Limit::Kind::linear, {0}, {1.0}, -1.0, 1.0, 3.0, 8.0});
  limited.add(2, {Limit::Kind::linear, {1}, {1.0}, 2.0});
  SparseNlp nlp;
  nlp.take_structure(limited);
  RowCosts costs;
  costs.take_structure(limited, nlp);
  ASSERT_TRUE(costs.take_limits(limited, nlp));
  ASSERT_EQ(costs.limits().rows.size(), 3);
  std::vector<double> c(nlp.constraints(), 0.0), stages(3, 0.0);
  const int at_1 = nlp.limit_start(1), at_2 = nlp.limit_start(2);
  c[0] = 0.25;         // a defect on interval 0
  c[at_1] = 1.5;       // hard, by a half
  c[at_1 + 1] = -1.5;  // soft, by a half
  c[at_2] = 1.0;       // hard, by one
  EXPECT_EQ(costs.stage_of(0), 0);
  EXPECT_EQ(costs.stage_of(at_1), 1);
  EXPECT_EQ(costs.stage_of(at_2), 2);
  EXPECT_EQ(costs.defect(c), 1.75);
  EXPECT_EQ(costs.slack_cost(c), 3.0 * 0.5 + 0.5 * 8.0 * 0.25);
  EXPECT_EQ(costs.merit(c, 10.0, stages), 17.5 + 2.5);
  EXPECT_EQ(stages, (std::vector<double>{2.5, 7.5, 10.0}));
  EXPECT_EQ(costs.largest_price(c), 1.5) << "soft ones have prices of their own";
  c[at_1 + 1] = std::nan("");
  EXPECT_TRUE(std::isnan(costs.merit(c, 10.0, stages)));

  limited.clear_limits();
  limited.add(1, {Limit::Kind::linear, {0}, {1.0}, 1.0, 1.0});
  limited.add(1, {Limit::Kind::linear, {0}, {1.0}, 1.0, -1.0, 3.0, 8.0});
  limited.add(2, {Limit::Kind::linear, {1}, {1.0}, 2.0});
  EXPECT_FALSE(costs.take_limits(limited, nlp)) << "sides that have crossed";
}

}  // namespace row_costs_test
}  // namespace rhec::sparse_sqp
