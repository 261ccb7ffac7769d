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

}  // namespace rhec::testing
