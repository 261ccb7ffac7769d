#pragma once

#include <vector>

#include "rhec/core/horizon/rhe_problem.hpp"
#include "rhec/core/ocp/solver.hpp"
#include "rhec/core/qp/stage_qp.hpp"

namespace rhec {

/// What is done where the solution of a window did not converge: it may have had a bad guess, which would persist from
/// sample to sample. Allocates in its constructor only.
class PriorRestart {
 public:
  explicit PriorRestart(const RheProblem& problem);

  /// Whether a solution that has not converged explains the measurements so well, by a chi-square test of its
  /// objective, that no other could do better by more than noise. It then need not be reconsidered.
  static bool is_convincing(const RheProblem& problem, const Report& report) noexcept;

  /// `prior` is the window's prior, simulated. If it explains the measurements better than `point`, the result of a
  /// solve with this report, the window is solved again from there. Leaves the best of the three in `point`, and what
  /// is known of it in `report`. Returns whether it is a solver's, and not the prior. `qp` has the problem's capacity.
  bool reconsider(const RheProblem& problem, Solver& solver, const Iterate& prior, StageQp& qp, Iterate& point,
                  Report& report, Clock::time_point deadline) noexcept;

 private:
  double objective_from_start(const RheProblem& problem, const Iterate& iterate) noexcept;

  Iterate simulated_;
  std::vector<double> scratch_;
};

}  // namespace rhec
