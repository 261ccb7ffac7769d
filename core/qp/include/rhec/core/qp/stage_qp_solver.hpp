#pragma once

#include <cstdint>
#include <vector>

#include "rhec/core/base/clock.hpp"
#include "rhec/core/qp/dual_active_set.hpp"
#include "rhec/core/qp/riccati.hpp"

namespace rhec {

/// Solves a StageQp exactly with all its bounds and limits (docs/method.md, section 7).
///
/// The solver is warm-started with the active set of the last sample's multipliers and corrects it by a dual active-set
/// method (DualActiveSet). If few bounds of states are in this set, it first tries the set as it is, inside one
/// factorisation. If the dual method needs too many changes, the primal-dual rule (Hintermueller, Ito & Kunisch 2002:
/// add violated bounds, drop those with the wrong sign) corrects the set for a few factorisations. If that does not
/// settle, a primal-dual interior-point method takes over, and its active set is polished to the exact solution. The
/// interior-point method also decides whether the QP is infeasible. With limits the dual method does all of it but
/// that: limits have no place inside a factorisation.
class RHEC_EXPORT StageQpSolver {
 public:
  enum class Outcome {
    active_set,      ///< exact, by active-set methods alone
    interior_point,  ///< the interior-point method was needed; exact after polishing, or to its tolerance
    infeasible,      ///< the bounds and hard limits cannot be satisfied
    out_of_time      ///< the deadline was reached; `step` is not usable
  };
  /// Termination of the interior-point method: complementarity relative to the gradient, and violation of the bounds.
  struct Accuracy {
    double gap, infeasibility;
  };
  StageQpSolver() = default;
  explicit StageQpSolver(const Capacity& capacity);

  /// Takes the active set from an iterate's bound multipliers.
  void guess_from(const StageQp& qp, const Iterate& iterate) noexcept;
  /// Factorises with this active set, so that `solve` needs no factorisation if the set is right.
  void prepare(const StageQp& qp) noexcept;

  /// Writes the minimiser to `step`: primal steps, new costates and bound multipliers. If the reduced Hessian is not
  /// positive definite, it solves a copy of the QP with convexified R (`was_convexified`). The deadline is checked
  /// between factorisations; the first one is always made.
  Outcome solve(const StageQp& qp, Iterate& step, Clock::time_point deadline = Clock::time_point::max()) noexcept;
  /// Only the robust path: convexify, interior point, polish.
  Outcome solve_by_interior_point(const StageQp& qp, Iterate& step,
                                  Clock::time_point deadline = Clock::time_point::max()) noexcept;

  /// With limits: takes rounding from a solution, or from another primal-dual step close to one, whatever set is
  /// active. Goes on until the KKT residual of the QP is at most `wanted`, or rounding is what is left of it; `step`
  /// becomes the best. Returns its residual; infinite, and `step` as it was, where nothing could be done.
  double refine(const StageQp& qp, Iterate& step, double wanted,
                Clock::time_point deadline = Clock::time_point::max()) noexcept;

  /// The control of stage i by the policy of the last solution for a stage-state step. After `prepare_feedback`, with
  /// the same, unchanged `qp`.
  void prepare_feedback(const StageQp& qp) noexcept {
    if (is_dual_) dual_.complete_policy(solved(qp), riccati_);
  }
  void feedback(const StageQp& qp, int i, const double* state_step, double* control_step) noexcept {
    if (is_refined_) return refined_feedback(i, state_step, control_step);
    riccati_.feedback(solved(qp), i, state_step, control_step);
  }
  /// Covariances from the QP's Hessian without bounds (Riccati::covariances), of all nodes or of the last one; false if
  /// it is not positive definite.
  bool covariances(const StageQp& qp, double* all, double* last) noexcept;
  /// The QP that was solved last: the one given to `solve`, or its convexified copy.
  const StageQp& solved(const StageQp& qp) const noexcept { return is_convexified_ ? convexified_ : qp; }
  /// True if the Hessian has been convexified since the last `guess_from`.
  bool was_convexified() const noexcept { return was_convexified_ || riccati_.was_convexified(); }
  int factorisations() const noexcept { return factorisations_; }
  /// With limits, whether QPs are consecutive ones of a controller, each of which has to be cheap: one that is not
  /// convex is convexified at once, unless augmenting the last one for its active limits has done, or many in a row
  /// were not. Rounding beyond bounds and limits is corrected in the step, but not in its costates.
  void set_cheap(bool cheap) noexcept { is_cheap_ = cheap, dual_.set_cheap(cheap && capacity_.limits > 0); }
  void reset() noexcept;

 private:
  struct Violations {
    int count = 0;
    bool finite = true, cross = false;
  };
  void factor(const StageQp& qp) noexcept;
  bool claim_is_likely(const StageQp& qp) const noexcept;
  void prepare_changes(const StageQp& qp, bool is_factored = false) noexcept;
  DualActiveSet::Outcome solve_from_guess(const StageQp& qp, Iterate& step, Clock::time_point deadline) noexcept;
  Violations correct_active_set(const StageQp& qp, const Iterate& step) noexcept;
  bool try_active_sets(const StageQp& qp, Iterate& step, int rounds, Clock::time_point deadline) noexcept;
  Outcome solve_limited(const StageQp& qp, Iterate& step, Clock::time_point deadline) noexcept;
  template <class OfState, class OfLimit>
  void for_each_augmented(const StageQp& qp, double relative, const OfState& of_state,
                          const OfLimit& of_limit) const noexcept;
  void augment(const StageQp& qp, double relative) noexcept;
  bool augmentation_fits(const StageQp& qp, double relative) const noexcept;
  void shift_multipliers(const StageQp& qp, double relative, Iterate& step) const noexcept;
  bool may_augment() noexcept;
  void augment_rows(const StageQp& qp, const Iterate& at, double relative_weight) noexcept;
  void refined_feedback(int i, const double* state_step, double* control_step) noexcept;
  void add_increment(const StageQp& qp, double relative_weight, Iterate& to) const noexcept;
  bool solve_augmented(const StageQp& qp, Iterate& step, Clock::time_point deadline) noexcept;
  void take_interior_set() noexcept;
  bool polish(const StageQp& qp, Iterate& step, Clock::time_point deadline) noexcept;
  Outcome solve_robustly(const StageQp& qp, Iterate& step, Clock::time_point deadline) noexcept;
  bool interior_point(const StageQp& qp, Iterate& step, const Accuracy& wanted, Clock::time_point deadline) noexcept;
  const StageQp& convexify(const StageQp& qp) noexcept;
  const StageQp& convexify_limited(const StageQp& qp, bool& is_factored) noexcept;

  /// One bounded variable or limit in the interior-point method: slacks and multipliers of its two sides. A soft side
  /// has the slack of its violation too, with a multiplier of its own; it is eliminated from the Newton system.
  struct Side {
    double slack = 0.0, multiplier = 0.0, slack_step = 0.0, multiplier_step = 0.0, correction = 0.0;
    double excess = 0.0, rest = 0.0, excess_step = 0.0, rest_step = 0.0, excess_correction = 0.0;
  };
  struct Bounded {
    bool is_state = false;
    const double* row = nullptr;  ///< of a limit
    double linear = 0.0, quadratic = 0.0;
    bool is_soft = false;
    int stage = 0, component = 0;
    double lower = 0.0, upper = 0.0, value = 0.0;
    Side below, above;
  };
  void collect_bounded(const StageQp& qp) noexcept;
  /// A side's multiplier after a Newton step is pull - weight (distance of the new value from the bound).
  struct Barrier {
    double weight, pull;
  };
  static Barrier barrier_of(const Bounded& v, const Side& side, double target) noexcept;
  void set_steps(const Bounded& v, Side& side, double distance, double target) const noexcept;
  double value_of(const Bounded& v, const Iterate& step) const noexcept;
  void barrier_terms(const StageQp& qp, double target) noexcept;

  Capacity capacity_;
  Riccati riccati_;
  ActiveSet active_, no_bounds_;
  DualActiveSet dual_;
  ActiveSet augmented_, guessed_;  ///< with limits: the set for which the QP was augmented, and the first one
  StageQp convexified_;
  StageQp barrier_;  ///< with limits: the QP plus their barrier terms
  Iterate increment_, refined_, interior_;
  bool is_refined_ = false;  ///< the last solution is `refined_`
  bool factored_ = false;
  bool is_convexified_ = false;   ///< the QP is not convex and `convexified_` replaces it
  bool was_convexified_ = false;  ///< since `guess_from`
  bool prepared_ = false;         ///< for the active set of the warm start
  bool is_dual_ = false;          ///< the last solution is from `dual_`
  bool out_of_time_ = false;
  bool is_cheap_ = false, has_fitted_ = false;  ///< the augmentation for the last QP that was not convex
  int not_convex_ = 0, wait_ = 0;  ///< consecutive QPs that were not, and those before the augmentation is tried
  bool any_active_ = true;         ///< false: certainly no bound is active
  int factorisations_ = 0;
  double gradient_scale_ = 1.0;      ///< of the last interior-point solution: scale of a slack of one
  std::vector<std::uint8_t> marks_;  ///< stages at which a bound may be active
  std::vector<Bounded> bounded_;
  std::vector<double> diagonal_, h_;  ///< rows of the QP's stride: barrier terms
};

}  // namespace rhec
