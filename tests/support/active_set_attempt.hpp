#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "rhec/core/qp/dual_active_set.hpp"
#include "rhec/core/qp/stage_qp_views.hpp"
#include "support/qp_conditions.hpp"

namespace rhec::testing {

constexpr Clock::time_point never = Clock::time_point::max();

inline int count_active(const StageQp& qp, const ActiveSet& active) {
  int count = 0;
  for (int i = 0; i <= qp.intervals(); ++i) {
    for (int j = 0; j < qp.states(i); ++j) count += active.state(i)[j] != 0;
    for (int j = 0; j < qp.controls(i); ++j) count += active.control(i)[j] != 0;
  }
  return count;
}

inline double distance(const StageQp& qp, const Iterate& a, const Iterate& b) {
  double largest = 0.0;
  for (int i = 0; i <= qp.intervals(); ++i) {
    for (int j = 0; j < qp.states(i); ++j) largest = std::max(largest, std::abs(a.state(i)[j] - b.state(i)[j]));
    for (int j = 0; j < qp.controls(i); ++j) largest = std::max(largest, std::abs(a.control(i)[j] - b.control(i)[j]));
  }
  return largest;
}

/// Everything needed to solve one QP.
struct Attempt {
  Riccati riccati;
  DualActiveSet method;
  ActiveSet active;
  Iterate step;
  DualActiveSet::Outcome outcome;

  Attempt(const StageQp& qp, const ActiveSet* claimed, Clock::time_point deadline = never)
      : riccati(qp.capacity()), method(qp.capacity()), active(qp.capacity()), step(qp.capacity()) {
    if (claimed) active = *claimed;
    method.prepare(qp, riccati, claimed);
    outcome = method.solve(qp, riccati, active, step, deadline);
  }
};

/// s+ = s + w with cost (s - target)^2 / 2 + w^2 / 2 at every node.
inline StageQp integrator(int intervals, double target) {
  StageQp qp({intervals, 1, 1});
  qp.set_intervals(intervals);
  qp.initial_state_is_given = true;
  qp.initial_step()[0] = 0.0;
  for (int i = 0; i <= intervals; ++i) {
    qp.set_sizes(i, 1, i < intervals ? 1 : 0);
    Q_of(qp, i)(0, 0) = 1.0;
    qp.q(i)[0] = -target;
    if (i == intervals) break;
    R_of(qp, i)(0, 0) = 1.0;
    qp.AB(i)[0] = qp.AB(i)[1] = 1.0;
  }
  return qp;
}

}  // namespace rhec::testing
