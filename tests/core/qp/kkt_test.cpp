#include "rhec/core/qp/kkt.hpp"
#include "rhec/core/qp/stage_qp_views.hpp"

#include <gtest/gtest.h>

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
