#include "core/model/radau_plan.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "rhec/core/base/aligned.hpp"

namespace rhec {
namespace radau_plan_test {

/// Two positions that are driven by a state, and three states that push each other.
const RatesStructure vehicle{.nx = 5,
                             .np = 1,
                             .nu = 1,
                             .slopes = {{0, 2}, {0, 5}, {1, 2}, {1, 3}, {2, 3}, {2, 6}, {3, 4}, {3, 2}, {4, 4}, {4, 6}},
                             .bends = {{2, 2}, {5, 2}}};

TEST(RadauMethod, IsACollocationOfOrderFive) {
  const RadauMethod method;
  // A times the inverse, by the conditions sum_t a_st c_t^(k-1) = c_s^k / k of a collocation: with the inverse,
  // sum_t (A^-1)_st c_t^k / k = c_s^(k-1).
  for (std::size_t s = 0; s < 3; ++s) {
    for (int k = 1; k <= 3; ++k) {
      double sum = 0.0;
      for (std::size_t t = 0; t < 3; ++t) sum += method.inverse[s][t] * std::pow(method.nodes[t], k) / k;
      EXPECT_NEAR(sum, std::pow(method.nodes[s], k - 1), 1e-13) << s << " " << k;
    }
    EXPECT_NEAR(method.sums[s], method.inverse[s][0] + method.inverse[s][1] + method.inverse[s][2], 1e-14);
  }
  EXPECT_EQ(method.nodes[2], 1.0);
}

/// M with arbitrary slopes, factored and solved, both ways.
TEST(RadauPlan, FactorsAndSolves) {
  const RadauPlan plan(vehicle, false, true);
  const RadauPlaces& at = plan.places();
  const int n = plan.unknowns();
  AlignedDoubles memory(static_cast<std::size_t>(at.count) * 8, NAN);
  const auto place = [&](std::uint32_t which) { return memory.data() + static_cast<std::size_t>(which) * 8; };
  const auto set = [&](std::uint32_t which, double value) { std::fill_n(place(which), 8, value); };
  const TapeKernels& kernels = *runnable_tape_kernels().back();
  const double h = 0.3;
  set(at.one, 1.0);
  set(at.h, h);
  set(at.minus_h, -h);
  for (std::uint32_t s = 0; s < 3; ++s) {
    set(at.sums + s, plan.method().sums[s]);
    for (std::uint32_t t = 0; t < 3; ++t) set(at.inverse + 3 * s + t, plan.method().inverse[s][t]);
  }
  Eigen::MatrixXd M = Eigen::MatrixXd::Zero(n, n);
  const auto where = [&](int state, int s) {
    for (int q = 0; q < n; q += 3)
      if (plan.state_of(q) == state) return q + s;
    return -1;
  };
  for (int i = 0; i < vehicle.nx; ++i)
    for (int s = 0; s < 3; ++s)
      for (int t = 0; t < 3; ++t)
        M(where(i, s), where(i, t)) = plan.method().inverse[static_cast<std::size_t>(s)][static_cast<std::size_t>(t)];
  for (int s = 0; s < 3; ++s) {
    for (std::size_t e = 0; e < vehicle.slopes.size(); ++e) {
      const auto& [r, c] = vehicle.slopes[e];
      const double slope = r == c ? -40.0 : std::sin(3.0 * static_cast<double>(e) + s);
      set(at.slopes[static_cast<std::size_t>(s)] + static_cast<std::uint32_t>(e), slope);
      if (c < vehicle.nx) M(where(r, s), where(c, s)) -= h * slope;
    }
  }
  kernels.add_products(plan.matrix(), memory.data());
  for (int q = 0; q < n; ++q) {
    const double pivot = place(plan.diagonal(q))[0];
    set(at.pivots + static_cast<std::uint32_t>(q), 1.0 / pivot);
    set(at.minus_pivots + static_cast<std::uint32_t>(q), -1.0 / pivot);
    kernels.add_products(plan.eliminate(q), memory.data());
  }
  Eigen::VectorXd right(n), weights = Eigen::VectorXd::Zero(n);
  for (int q = 0; q < n; ++q) {
    right[q] = std::cos(q);
    set(at.residual + static_cast<std::uint32_t>(q), right[q]);
  }
  for (int i = 0; i < vehicle.nx; ++i) {
    weights[where(i, 2)] = 1.0 + i;
    set(at.weights + static_cast<std::uint32_t>(i), 1.0 + i);
  }
  kernels.add_products(plan.solve(), memory.data());
  kernels.add_products(plan.adjoints(), memory.data());
  const Eigen::VectorXd solution = M.lu().solve(right), adjoint = M.transpose().lu().solve(weights);
  for (int q = 0; q < n; ++q) {
    EXPECT_NEAR(place(at.newton + static_cast<std::uint32_t>(q))[7], solution[q], 1e-13) << q;
    EXPECT_NEAR(place(at.adjoints + static_cast<std::uint32_t>(q))[7], adjoint[q], 1e-13) << q;
  }
}

TEST(RadauPlan, WhatMovesNothingComesFirstAndFillsNothing) {
  const RadauPlan plan(vehicle, false, true);
  EXPECT_LT(plan.state_of(0), 2);
  EXPECT_LT(plan.state_of(3), 2);
  // Three by three for each state, and an entry for each stage where one moves another.
  EXPECT_LT(plan.places().matrix_size, 3u * 3u * 5u * 5u / 2u);
}

TEST(RadauPlan, KnowsWhatIsAlwaysZero) {
  for (const bool single : {false, true}) {
    const RadauPlan plan(vehicle, false, single);
    const auto moved = [&](int r, int c) { return plan.moved()[static_cast<std::size_t>(r * plan.nz() + c)]; };
    EXPECT_EQ(moved(0, 1), plan.places().zero);
    EXPECT_EQ(moved(2, 0), plan.places().zero);
    EXPECT_EQ(moved(2, 5), plan.places().zero) << "no parameter moves it";
    EXPECT_NE(moved(0, 0), plan.places().zero);
    EXPECT_NE(moved(0, 6), plan.places().zero);
    const auto bent = [&](int r, int c) { return plan.hessian()[static_cast<std::size_t>(r * plan.nz() + c)]; };
    EXPECT_EQ(bent(0, 0), plan.places().zero);
    EXPECT_NE(bent(2, 5), plan.places().zero);
    EXPECT_EQ(bent(2, 5), bent(5, 2));
  }
  EXPECT_GT(RadauPlan(vehicle, true, false).sensitivity_operations(),
            RadauPlan(vehicle, false, true).sensitivity_operations());
}

}  // namespace radau_plan_test
}  // namespace rhec
