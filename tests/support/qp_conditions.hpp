#pragma once

#include "rhec/core/qp/stage_qp_views.hpp"
#include "support/random_qp.hpp"

namespace rhec::testing {

/// Largest violation of the QP's KKT conditions by a step and its multipliers.
double kkt_violation(const StageQp& qp, const Iterate& step);

/// A random strictly convex QP with bounds on all controls, the tighter the smaller `tightness`, and on the
/// states.
StageQp bounded_qp(RandomQp& random, bool given, double tightness);

/// A random QP whose bounds leave room around some trajectory, so that it has a solution; the less room, the more
/// bounds are active there.
StageQp feasible_qp(RandomQp& random, bool given, double room);

/// What the limits of a random QP are like. Shares are probabilities.
struct LimitFamily {
  double room = 0.5;        ///< beside a trajectory, of bounds and limits
  double soft = 0.0;        ///< share of soft rows; these may be out of reach
  double equalities = 0.0;  ///< share of rows whose sides coincide
  double dependent = 0.0;   ///< share of rows that are those before them
  bool has_state_bounds = false;
};
/// A random strictly convex QP with limits on states, on controls and on both; some rows are zero. Hard ones leave room
/// around some trajectory (as do bounds on states, but around another one).
StageQp limited_qp(RandomQp& random, bool given, const LimitFamily& family);

}  // namespace rhec::testing
