#pragma once

#include <cstdint>
#include <vector>

#include "rhec/core/base/clock.hpp"
#include "rhec/core/qp/dual_active_set.hpp"
#include "rhec/core/qp/riccati.hpp"

namespace rhec {

/// Solves a StageQp with all its bounds, exactly.
///
/// It starts from the active set that the last sample's multipliers claim and corrects it by a dual active-set method
/// (DualActiveSet); where a few bounds of states make up the claim, that is first tried as it is, inside one
/// factorisation. Should the dual method have too much to do, the set is corrected by the primal-dual rule
/// (Hintermueller, Ito & Kunisch 2002: what is violated is added, what pulls the wrong way is dropped) for a few rounds
/// of factorisations; and should that not settle, a primal-dual interior-point method takes over, whose active set is
/// then polished to the exact solution. The last also has the last word on whether there is a solution.
class RHEC_EXPORT StageQpSolver {
 public:
  enum class Outcome {
    active_set,      ///< exact, by active sets alone
    interior_point,  ///< the interior-point method was needed; exact after polishing, or to its tolerance
    infeasible,      ///< the bounds cannot be satisfied
    out_of_time      ///< the deadline came first; `step` is of no use
  };
  /// When the interior-point method stops: complementarity relative to the gradient, and violation of the bounds.
  struct Accuracy {
    double gap, infeasibility;
  };
  StageQpSolver() = default;
  explicit StageQpSolver(const Capacity& capacity);

  /// The active set that an iterate's bound multipliers claim.
  void guess_from(const StageQp& qp, const Iterate& iterate) noexcept;
  /// Factorises with the guess, so that `solve` needs no factorisation if the guess is right.
  void prepare(const StageQp& qp) noexcept;

  /// The minimiser goes to `step`: primal steps, new costates and bound multipliers. Where the reduced Hessian is not
  /// positive definite it is that of a copy of the QP whose R is convexified (`was_convexified`).
  /// The deadline is looked at between factorisations, of which the first is always made.
  Outcome solve(const StageQp& qp, Iterate& step, Clock::time_point deadline = Clock::time_point::max()) noexcept;
  /// The robust path alone: convexify, interior point, polish.
  Outcome solve_by_interior_point(const StageQp& qp, Iterate& step,
                                  Clock::time_point deadline = Clock::time_point::max()) noexcept;

  /// The control of stage i that the last solution's policy chooses for a stage-state step. After `prepare_feedback`;
  /// `qp` is the one that was solved, unchanged.
  void prepare_feedback(const StageQp& qp) noexcept {
    if (is_dual_) dual_.complete_policy(solved(qp), riccati_);
  }
  void feedback(const StageQp& qp, int i, const double* state_step, double* control_step) noexcept {
    riccati_.feedback(solved(qp), i, state_step, control_step);
  }
  /// Covariances by the QP's Hessian without any bounds (Riccati::covariances), of all nodes or the last one;
  /// false where it is not positive definite.
  bool covariances(const StageQp& qp, double* all, double* last) noexcept;
  /// The QP that the last solution is of: the one that `solve` was given, or its convexified copy.
  const StageQp& solved(const StageQp& qp) const noexcept { return is_convexified_ ? convexified_ : qp; }
  /// True where the curvature had to be convexified since the last `guess_from`.
  bool was_convexified() const noexcept { return was_convexified_ || riccati_.was_convexified(); }
  int factorisations() const noexcept { return factorisations_; }
  void reset() noexcept;

 private:
  struct Violations {
    int count = 0;
    bool finite = true, cross = false;
  };
  void factor(const StageQp& qp) noexcept;
  bool claim_is_likely(const StageQp& qp) const noexcept;
  void prepare_changes(const StageQp& qp) noexcept;
  DualActiveSet::Outcome solve_from_guess(const StageQp& qp, Iterate& step, Clock::time_point deadline) noexcept;
  Violations correct_active_set(const StageQp& qp, const Iterate& step) noexcept;
  bool try_active_sets(const StageQp& qp, Iterate& step, int rounds, Clock::time_point deadline) noexcept;
  Outcome solve_robustly(const StageQp& qp, Iterate& step, Clock::time_point deadline) noexcept;
  bool interior_point(const StageQp& qp, Iterate& step, const Accuracy& wanted, Clock::time_point deadline) noexcept;
  const StageQp& convexify(const StageQp& qp) noexcept;

  /// One bounded variable in the interior-point method: slacks and multipliers of its two sides.
  struct Side {
    double slack = 0.0, multiplier = 0.0, slack_step = 0.0, multiplier_step = 0.0, correction = 0.0;
  };
  struct Bounded {
    bool is_state = false;
    int stage = 0, component = 0;
    double lower = 0.0, upper = 0.0, value = 0.0;
    Side below, above;
  };
  void collect_bounded(const StageQp& qp) noexcept;
  void barrier_terms(const StageQp& qp, double target) noexcept;

  Capacity capacity_;
  Riccati riccati_;
  ActiveSet active_, no_bounds_;
  DualActiveSet dual_;
  StageQp convexified_;
  bool factored_ = false;
  bool is_convexified_ = false;   ///< the QP is not convex, and `convexified_` takes its place
  bool was_convexified_ = false;  ///< since `guess_from`
  bool prepared_ = false;         ///< for the active set as it was guessed
  bool is_dual_ = false;          ///< the last solution is by `dual_`
  bool out_of_time_ = false;
  bool any_active_ = true;  ///< false: no bound is active, for certain
  int factorisations_ = 0;
  double gradient_scale_ = 1.0;      ///< of the last interior-point solution: what a slack of one weighs
  std::vector<std::uint8_t> marks_;  ///< stages at which a bound may be active
  std::vector<Bounded> bounded_;
  std::vector<double> diagonal_, h_;  ///< rows of the QP's stride: barrier terms
};

}  // namespace rhec
