#include "rhec/core/qp/kkt.hpp"
#include "rhec/core/base/infinity.hpp"
#include "rhec/core/qp/stage_qp_views.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "support/random_qp.hpp"

namespace rhec {
namespace kkt_test {

using testing::RandomQp;

/// A QP without defects, linearised at a stationary point.
struct Stationary {
  explicit Stationary(bool given, unsigned seed) : qp(RandomQp(seed).make(5, 3, 2, given)), point(qp.capacity()) {
    for (int i = 0; i <= 5; ++i) {
      for (int j = 0; j < 3; ++j) qp.b(i)[j] = 0.0;
      for (int j = 0; j < qp.controls(i); ++j) qp.r(i)[j] = 0.0;
    }
    for (int j = 0; j < 3; ++j) qp.initial_step()[j] = 0.0;
    set_costates(qp, point);
    // Controls with zero gradient.
    for (int i = 0; i < 5; ++i)
      for (int j = 0; j < qp.controls(i); ++j)
        for (int r = 0; r < 3; ++r) qp.r(i)[j] -= B_of(qp, i)(r, j) * point.costate(i + 1)[r];
    // And a free initial state at its optimum.
    if (!given)
      for (int j = 0; j < 3; ++j) {
        double pull = 0.0;
        for (int r = 0; r < 3; ++r) pull += A_of(qp, 0)(r, j) * point.costate(1)[r];
        qp.q(0)[j] = -pull;
      }
  }
  StageQp qp;
  Iterate point;
};

TEST(Kkt, CostatesByOneSweepMakeAPointStationary) {
  for (const bool given : {false, true}) {
    for (unsigned seed = 1; seed < 6; ++seed) {
      const Stationary found(given, seed);
      EXPECT_GT(std::abs(found.point.costate(2)[0]), 1e-3);
      EXPECT_LT(kkt_residual(found.qp, found.point).largest(), 1e-14) << given << seed;
      if (!given) {
        for (int j = 0; j < 3; ++j) EXPECT_EQ(found.point.costate(0)[j], 0.0);
      }
    }
  }
}

TEST(Kkt, EachTermSeesWhatItIsAbout) {
  const Stationary found(true, 7);
  const auto residual = [&](const auto& change) {
    Stationary changed = found;
    change(changed);
    return kkt_residual(changed.qp, changed.point);
  };
  const KktResidual pulled = residual([](Stationary& s) { s.qp.q(3)[1] += 0.5; });
  EXPECT_GT(pulled.stationarity, 0.01);
  EXPECT_LT(pulled.stationarity, 0.5) << "relative to the terms that it is a sum of";
  EXPECT_EQ(pulled.defect, 0.0);
  EXPECT_EQ(residual([](Stationary& s) { s.qp.b(2)[0] = -0.25; }).defect, 0.25);
  EXPECT_EQ(residual([](Stationary& s) { s.qp.initial_step()[2] = 0.125; }).defect, 0.125);
  // Bounds are distances from the point.
  EXPECT_EQ(residual([](Stationary& s) { s.qp.state_upper(4)[2] = -0.75; }).bound_violation, 0.75);
  EXPECT_EQ(residual([](Stationary& s) { s.qp.state_lower(4)[2] = 0.5; }).bound_violation, 0.5);
  const KktResidual idle = residual([](Stationary& s) {
    s.qp.state_upper(4)[2] = 2.0;
    s.point.state_bound(4)[2] = 0.1;
    set_costates(s.qp, s.point);
  });
  EXPECT_GT(idle.complementarity, 0.01) << "a multiplier whose bound is far";
  const KktResidual nowhere = residual([](Stationary& s) { s.point.state_bound(4)[2] = 0.1; });
  EXPECT_GT(nowhere.largest(), 0.01) << "a multiplier whose bound is nowhere";
}

/// The same with two limits at node 3: one hard and at its upper side, one soft and violated by a quarter below.
struct Limited {
  static constexpr int node = 3;
  explicit Limited(unsigned seed) : qp(with_limits(RandomQp(seed).make(5, 3, 2, true))), point(qp.capacity()) {
    qp.limit_upper(node)[0] = 0.0;
    qp.limit_lower(node)[0] = -infinity;
    qp.limit_linear(node)[0] = infinity;
    qp.limit_lower(node)[1] = 0.25;
    qp.limit_upper(node)[1] = 2.0;
    qp.limit_linear(node)[1] = 0.5;
    qp.limit_quadratic(node)[1] = 4.0;
    point.limit_bound(node)[0] = 0.75;
    point.limit_bound(node)[1] = -1.5;  // 0.5 + 4 * 0.25
    for (int r = 0; r < 2; ++r)
      for (int c = 0; c < 5; ++c) qp.G(node)[r * qp.stride() + c] = 0.1 * (r + 1) - 0.07 * c;
    for (int i = 0; i < 5; ++i) std::fill_n(qp.b(i), 3, 0.0);
    std::fill_n(qp.initial_step(), 3, 0.0);
    set_costates(qp, point);
    for (int i = 0; i < 5; ++i)
      for (int j = 0; j < 2; ++j) {
        qp.r(i)[j] = 0.0;
        for (int r = 0; r < 3; ++r) qp.r(i)[j] -= B_of(qp, i)(r, j) * point.costate(i + 1)[r];
        for (int r = 0; r < qp.limits(i); ++r) qp.r(i)[j] -= qp.G(i)[r * qp.stride() + 3 + j] * point.limit_bound(i)[r];
      }
  }
  /// A copy with room for two limits a stage, and two at the node.
  static StageQp with_limits(const StageQp& from) {
    StageQp to({.intervals = 5, .states = 3, .controls = 2, .limits = 2});
    to.set_intervals(5);
    to.initial_state_is_given = true;
    for (int i = 0; i <= 5; ++i) {
      to.set_sizes(i, 3, i < 5 ? 2 : 0);
      std::copy_n(from.AB(i), 3 * from.stride(), to.AB(i));
      std::copy_n(from.H(i), 5 * from.stride(), to.H(i));
      std::copy_n(from.h(i), from.stride(), to.h(i));
    }
    to.set_limits(node, 2);
    return to;
  }
  StageQp qp;
  Iterate point;
};

TEST(Kkt, LimitsPullAsTheirMultipliersSay) {
  const Limited found(3);
  EXPECT_LT(kkt_residual(found.qp, found.point).largest(), 1e-14);
  const auto residual = [&](const auto& change) {
    Limited changed = found;
    change(changed);
    return kkt_residual(changed.qp, changed.point);
  };
  constexpr int node = Limited::node;
  EXPECT_GT(residual([](Limited& s) { s.qp.G(node)[1] += 0.5; }).stationarity, 0.01);
  EXPECT_GT(residual([](Limited& s) { s.qp.G(node)[3] += 0.5; }).stationarity, 0.01);
  EXPECT_EQ(residual([](Limited& s) { s.qp.limit_upper(node)[0] = -0.5; }).bound_violation, 0.5);
  EXPECT_EQ(residual([](Limited& s) { s.qp.limit_lower(node)[0] = 0.5; }).bound_violation, 0.5);
  EXPECT_GT(residual([](Limited& s) { s.qp.limit_upper(node)[0] = 0.5; }).complementarity, 0.01);
  EXPECT_GT(residual([](Limited& s) { s.qp.limit_upper(node)[0] = infinity; }).complementarity, 0.01)
      << "a multiplier whose limit is nowhere";
  const KktResidual more = residual([](Limited& s) { s.qp.limit_lower(node)[1] = 0.5; });
  EXPECT_EQ(more.bound_violation, 0.0) << "soft";
  EXPECT_GT(more.complementarity, 0.01) << "the multiplier is too small for this slack";
  const KktResidual less = residual([](Limited& s) { s.qp.limit_lower(node)[1] = 0.125; });
  EXPECT_GT(less.stationarity, 0.01) << "the multiplier is too large for this slack";
  EXPECT_FALSE(std::isfinite(residual([](Limited& s) { s.point.limit_bound(node)[1] = std::nan(""); }).stationarity));
}

TEST(Kkt, LargestIsTheLargestOfAll) {
  KktResidual residual;
  EXPECT_EQ(residual.largest(), 0.0);
  residual.complementarity = 3.0;
  residual.defect = 4.0;
  EXPECT_EQ(residual.largest(), 4.0);
}

TEST(Kkt, TermsAddUpOverPieces) {
  Stationary found(false, 9);
  found.qp.q(4)[0] += 0.3;
  found.qp.b(1)[1] = 0.2;
  found.qp.state_upper(2)[0] = -0.1;
  const KktResidual whole = kkt_residual(found.qp, found.point);
  KktTerms pieces, others;
  pieces.add(found.qp, found.point, {0, 1});
  pieces.add(found.qp, found.point, {2, 3});
  others.add(found.qp, found.point, {4, 5});
  pieces.add(others);
  const KktResidual sum = pieces.residual();
  EXPECT_EQ(sum.stationarity, whole.stationarity);
  EXPECT_EQ(sum.defect, whole.defect);
  EXPECT_EQ(sum.bound_violation, whole.bound_violation);
  EXPECT_EQ(sum.complementarity, whole.complementarity);
}

TEST(Kkt, WhatIsNoNumberIsNotLost) {
  for (const int stage : {0, 3, 5}) {
    Stationary found(true, 11);
    found.qp.q(stage)[1] = std::nan("");
    EXPECT_FALSE(std::isfinite(kkt_residual(found.qp, found.point).stationarity)) << stage;
  }
  KktTerms terms, broken;
  terms.defect = 5.0;
  broken.defect = std::nan("");
  terms.add(broken);
  EXPECT_TRUE(std::isnan(terms.defect));
  terms.add(KktTerms{.defect = 7.0});
  EXPECT_TRUE(std::isnan(terms.defect));
}

}  // namespace kkt_test
}  // namespace rhec
