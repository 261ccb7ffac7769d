#pragma once

#include <memory>
#include <vector>

#include "rhec/core/horizon/rhc_problem.hpp"
#include "rhec/core/horizon/rhe_problem.hpp"

namespace rhec::testing {

/// A cart with position and speed, driven by an acceleration and slowed by drag: x' = v, v' = gain a - drag v^2. Its
/// position is measured, and its speed squared.
std::shared_ptr<const Model> cart();

/// A controller's problem from a given start.
std::unique_ptr<RhcProblem> cart_control(int intervals, std::vector<int> blocked_inputs = {});

/// An estimator's problem with arbitrary measurements.
std::unique_ptr<RheProblem> cart_estimation(int intervals, RheProblem::Setup setup = {});

/// A point with a different number everywhere, not from a simulation.
Iterate scattered_point(const Ocp& ocp);

}  // namespace rhec::testing
