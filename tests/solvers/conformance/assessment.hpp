#pragma once

// What a solver did, assessed by the core and by an evaluation that shares as little as possible with it.

#include <string>
#include <vector>

#include "families.hpp"
#include "rhec/core/ocp/solver.hpp"

namespace rhec::conformance {

struct Assessment {
  Report report;
  double milliseconds = 0.0;
  Iterate point;
  KktResidual kkt;         ///< by the core
  double objective = 0.0;  ///< by the core, with the costs of slacks
  /// The Lagrangian less what its bound terms are at the bounds: the objective without what defects and violations
  /// within the tolerance gain. Near an optimum it is that of the optimum to second order.
  double corrected_objective = 0.0;
  std::vector<std::string> complaints;  ///< where report and point do not agree with what is found
};

/// Prepares and solves from a guess. `tolerance` is the solver's.
Assessment solve_and_assess(Solver& solver, const Ocp& problem, const Iterate& guess, double tolerance,
                            Clock::time_point deadline = Clock::time_point::max());

/// The KKT residual of a point.
KktResidual residual_at(const Ocp& problem, const Iterate& point);

/// All that the problem uses of two points is the same to the last bit; what it does not use is not compared.
bool same_bits(const Ocp& problem, const Iterate& a, const Iterate& b);

/// The states and controls of a point that the problem uses, each over its variable's scale.
std::vector<double> scaled_primal(const HorizonProblem& problem, const Iterate& point);

/// max |a - b| of what `scaled_primal` gives.
double distance(const std::vector<double>& a, const std::vector<double>& b);

}  // namespace rhec::conformance
