#pragma once

#include <vector>

#include "rhec/core/horizon/horizon_problem.hpp"
#include "rhec/core/ocp/solver.hpp"
#include "rhec/core/qp/riccati.hpp"

namespace rhec {

/// The covariance of the state of one node of a window, from the solver if it has it, else by a factorisation of its
/// own. Allocates in its constructor only.
class NodeCovariance {
 public:
  explicit NodeCovariance(const HorizonProblem& problem);

  /// Capacity's states squared, column-major; null if it is not finite.
  const double* find(const HorizonProblem& problem, Solver& solver, const Iterate& point, int node) noexcept;
  /// A QP of the problem's capacity, free between calls.
  StageQp& qp() noexcept { return qp_; }

 private:
  StageQp qp_;
  Riccati riccati_;
  ActiveSet no_active_bounds_;
  std::vector<double> covariances_, scratch_;
};

}  // namespace rhec
