#include "rhec/core/qp/stage_qp_solver.hpp"

#include <algorithm>
#include <cmath>

#include "limit_checks.hpp"
#include "rhec/core/base/assertion.hpp"
#include "rhec/core/base/infinity.hpp"
#include "rhec/core/qp/stage_checks.hpp"
#include "tolerances.hpp"

namespace rhec {
namespace {

constexpr int claimed_rounds = 1;  // tries of the warm-started set if the QP is not convex
constexpr int warm_rounds = 8;     // corrections of the active set before the interior-point method
constexpr int polish_rounds = 6;   // the same, from the interior-point method's active set
constexpr int few_states = 2;
// The interior-point method stops well before rounding spoils its Newton systems; polishing does the rest.
constexpr StageQpSolver::Accuracy ready_to_polish{1e-8, 1e-7};
// With limits, rounding in the barrier terms of narrow feasible sets comes earlier.
constexpr StageQpSolver::Accuracy ready_with_limits{1e-6, 1e-5};
// If polishing does not settle, the interior-point method itself must be accurate.
constexpr StageQpSolver::Accuracy on_its_own{1e-12, 1e-10};
// The KKT residual that refining should reach, and what is enough.
constexpr double refined_residual = 1e-10, acceptable_residual = 1e-8;

/// Whether a QP is convexified before anything else: the last one was not convex, each has to be cheap, and it is not
/// the turn of an augmentation.
bool is_convexified_first(bool is_cheap, int not_convex, int wait) { return is_cheap && not_convex > 0 && wait > 1; }

}  // namespace

StageQpSolver::StageQpSolver(const Capacity& capacity)
    : capacity_(capacity),
      riccati_(capacity),
      active_(capacity),
      no_bounds_(capacity),
      dual_(capacity),
      convexified_(capacity) {
  const auto nodes = static_cast<std::size_t>(capacity.intervals) + 1;
  marks_.assign(nodes, 0);
  bounded_.reserve(nodes * (capacity.states + capacity.controls + capacity.limits));
  if (capacity.limits > 0) {
    barrier_ = StageQp(capacity);
    augmented_ = guessed_ = ActiveSet(capacity);
    increment_ = refined_ = interior_ = Iterate(capacity);
  }
  for (auto* v : {&diagonal_, &h_}) v->assign(nodes * capacity.row(), 0.0);
}

void StageQpSolver::reset() noexcept {
  active_.clear();
  dual_.reset();
  factored_ = prepared_ = has_fitted_ = false;
  factorisations_ = not_convex_ = wait_ = 0;
}

void StageQpSolver::guess_from(const StageQp& qp, const Iterate& iterate) noexcept {
  active_.clear();
  factored_ = prepared_ = was_convexified_ = false;
  factorisations_ = 0;
  const auto side = [](double multiplier, double lower, double upper) -> std::int8_t {
    if (is_equality(lower, upper)) return 1;
    if (multiplier > 0.0 && std::isfinite(upper)) return 1;
    if (multiplier < 0.0 && std::isfinite(lower)) return -1;
    return 0;
  };
  mark_bounds(qp, iterate, bound_tolerance, marks_.data());
  any_active_ = false;
  for (int i = 0; i <= qp.intervals(); ++i) {
    if (marks_[i] == 0) continue;
    any_active_ = true;
    if (i > 0 || !qp.initial_state_is_given)
      for (int j = 0; j < qp.states(i); ++j)
        active_.state(i)[j] = side(iterate.state_bound(i)[j], qp.state_lower(i)[j], qp.state_upper(i)[j]);
    for (int j = 0; j < qp.controls(i); ++j)
      active_.control(i)[j] = side(iterate.control_bound(i)[j], qp.control_lower(i)[j], qp.control_upper(i)[j]);
  }
  if (qp.has_limits()) any_active_ |= guess_limits(qp, iterate, active_);
}

void StageQpSolver::factor(const StageQp& qp) noexcept {
  riccati_.factor(qp, active_);
  factored_ = true;
  ++factorisations_;
}

/// Few active state bounds in estimation: these usually persist from sample to sample and are cheap inside the
/// factorisation. In control they move with the horizon, so that most samples need their sensitivities.
bool StageQpSolver::claim_is_likely(const StageQp& qp) const noexcept {
  if (!any_active_ || qp.initial_state_is_given || qp.has_limits()) return false;
  int states = 0;
  for (int i = 0; i <= qp.intervals(); ++i)
    for (int j = 0; j < qp.states(i); ++j) states += active_.state(i)[j] != 0;
  return states > 0 && states <= few_states;
}

void StageQpSolver::prepare(const StageQp& qp) noexcept {
  if (claim_is_likely(qp)) {
    factor(qp);
  } else if (!qp.has_limits() || !is_convexified_first(is_cheap_, not_convex_, wait_)) {
    prepare_changes(qp);
  }
}

void StageQpSolver::prepare_changes(const StageQp& qp, bool is_factored) noexcept {
  dual_.prepare(qp, riccati_, any_active_ ? &active_ : nullptr, is_factored);
  prepared_ = true;
}

StageQpSolver::Violations StageQpSolver::correct_active_set(const StageQp& qp, const Iterate& step) noexcept {
  Violations found;
  const StepCheck check = check_step(qp, step, bound_tolerance);
  found.finite = check.is_finite;
  if (!found.finite || (!check.violates && !any_active_)) return found;
  any_active_ = true;
  const auto hold_violated = [&](int stage, int j) {
    const double value = step.row(stage)[j], lower = qp.lower(stage)[j], upper = qp.upper(stage)[j];
    std::int8_t& side = active_.row(stage)[j];
    if (side != 0) return;
    if (value < lower - bound_tolerance * (1.0 + std::abs(lower))) side = -1;
    if (value > upper + bound_tolerance * (1.0 + std::abs(upper))) side = 1;
    found.count += side != 0;
  };
  for (int i = 0; check.violates && i <= qp.intervals(); ++i) {
    for (int j = 0; (i > 0 || !qp.initial_state_is_given) && j < qp.states(i); ++j) hold_violated(i, j);
    for (int j = 0; j < qp.controls(i); ++j) hold_violated(i, capacity_.states + j);
  }
  // Multipliers of bounds that were already active may have the wrong sign; new ones have none yet.
  const double pull_tolerance = multiplier_tolerance * (1.0 + check.largest_costate);
  active_.for_each([&](int stage, int j, std::int8_t side) {
    const double lower = qp.lower(stage)[j], upper = qp.upper(stage)[j];
    // The value is at one bound, regardless of the other one.
    found.cross |= !(lower - upper <= bound_tolerance * (1.0 + std::abs(lower)));
    if (!(side * step.bound_row(stage)[j] < -pull_tolerance) || is_equality(lower, upper)) return;
    active_.row(stage)[j] = 0;
    ++found.count;
  });
  return found;
}

bool StageQpSolver::try_active_sets(const StageQp& qp, Iterate& step, int rounds, Clock::time_point deadline) noexcept {
  for (int round = 0; round < rounds; ++round) {
    out_of_time_ = round > 0 && is_past(deadline);
    if (out_of_time_) return false;
    if (!factored_) factor(qp);
    if (riccati_.solve(qp, active_, step) != Riccati::Outcome::done) return false;
    const Violations violations = correct_active_set(qp, step);
    if (!violations.finite || violations.cross) return false;
    if (violations.count == 0) return true;
    factored_ = false;
  }
  return false;
}

StageQpSolver::Outcome StageQpSolver::solve(const StageQp& qp, Iterate& step, Clock::time_point deadline) noexcept {
  RHEC_ASSERT(qp.capacity() == capacity_ && step.capacity() == capacity_, "a QP and a step of the capacity");
  is_dual_ = is_convexified_ = is_refined_ = false;
  if (qp.has_limits()) return solve_limited(qp, step, deadline);
  if (!factored_ && !prepared_) prepare(qp);
  if (factored_) {
    if (try_active_sets(qp, step, 1, deadline)) return Outcome::active_set;
    factored_ = false;
    if (any_active_ && mark_bounds(qp, step, bound_tolerance, marks_.data())) return Outcome::infeasible;
    if (is_past(deadline)) return Outcome::out_of_time;
  }
  auto outcome = solve_from_guess(qp, step, deadline);
  if (outcome != DualActiveSet::Outcome::solved && mark_bounds(qp, step, bound_tolerance, marks_.data()))
    return Outcome::infeasible;
  if (outcome == DualActiveSet::Outcome::not_convex) {
    // Active state bounds may give the QP a minimiser that it does not have without them.
    if (try_active_sets(qp, step, claimed_rounds, deadline)) return Outcome::active_set;
    if (out_of_time_) return Outcome::out_of_time;
    const StageQp& convex = convexify(qp);
    prepared_ = false;
    outcome = solve_from_guess(convex, step, deadline);
  }
  factored_ = false;
  if (outcome == DualActiveSet::Outcome::solved) return Outcome::active_set;
  if (outcome == DualActiveSet::Outcome::out_of_time) return Outcome::out_of_time;
  if (outcome == DualActiveSet::Outcome::too_much && try_active_sets(solved(qp), step, warm_rounds, deadline))
    return Outcome::active_set;
  return out_of_time_ ? Outcome::out_of_time : solve_robustly(qp, step, deadline);
}

StageQpSolver::Outcome StageQpSolver::solve_limited(const StageQp& qp, Iterate& step,
                                                    Clock::time_point deadline) noexcept {
  out_of_time_ = false;
  if (mark_bounds(qp, step, bound_tolerance, marks_.data()) || limits_cross(qp, bound_tolerance))
    return Outcome::infeasible;
  const bool is_first = is_convexified_first(is_cheap_, not_convex_, wait_);
  auto outcome = is_first ? DualActiveSet::Outcome::not_convex : solve_from_guess(qp, step, deadline);
  if (!is_first) not_convex_ = outcome == DualActiveSet::Outcome::not_convex ? not_convex_ + 1 : 0;
  if (outcome == DualActiveSet::Outcome::not_convex) {
    if (!is_first && is_past(deadline)) return Outcome::out_of_time;
    if (!is_first && may_augment() && solve_augmented(qp, step, deadline)) return Outcome::active_set;
    if (out_of_time_) return Outcome::out_of_time;
    bool is_factored = false;
    const StageQp& convex = convexify_limited(qp, is_factored);
    if (is_first) {
      not_convex_ = is_convexified_ ? not_convex_ + 1 : 0;
      --wait_;
    }
    prepare_changes(convex, is_factored);
    outcome = solve_from_guess(convex, step, deadline);
  }
  if (outcome == DualActiveSet::Outcome::solved) {
    // Over long unstable horizons what the dual method leaves is more than rounding.
    if (!is_cheap_) refine(solved(qp), step, acceptable_residual, deadline);
    return Outcome::active_set;
  }
  if (outcome == DualActiveSet::Outcome::out_of_time) return Outcome::out_of_time;
  return solve_robustly(qp, step, deadline);
}

DualActiveSet::Outcome StageQpSolver::solve_from_guess(const StageQp& qp, Iterate& step,
                                                       Clock::time_point deadline) noexcept {
  if (!prepared_) prepare_changes(qp);
  prepared_ = false;
  // If the QP was convex only with all its claims held, it rarely is once some of them are released.
  const bool is_open = is_cheap_ && qp.has_limits() && !is_convexified_ && dual_.needs_all_held();
  const auto outcome =
      is_open ? DualActiveSet::Outcome::not_convex : dual_.solve(qp, riccati_, active_, step, deadline);
  is_dual_ = outcome == DualActiveSet::Outcome::solved;
  factorisations_ += dual_.factorisations();
  return outcome;
}

StageQpSolver::Outcome StageQpSolver::solve_by_interior_point(const StageQp& qp, Iterate& step,
                                                              Clock::time_point deadline) noexcept {
  is_dual_ = is_convexified_ = is_refined_ = false;
  return solve_robustly(qp, step, deadline);
}

StageQpSolver::Outcome StageQpSolver::solve_robustly(const StageQp& given, Iterate& step,
                                                     Clock::time_point deadline) noexcept {
  // From here on the QP is fixed and convex.
  const StageQp& qp = convexify(given);
  if (!interior_point(qp, step, qp.has_limits() ? ready_with_limits : ready_to_polish, deadline)) {
    active_.clear();
    factored_ = false;
    return out_of_time_ ? Outcome::out_of_time : Outcome::infeasible;
  }
  // The active set of the interior-point method, kept only if it leads to the exact solution.
  take_interior_set();
  factored_ = false;
  if (qp.has_limits()) interior_ = step;
  if (polish(qp, step, deadline) &&
      (!qp.has_limits() || refine(qp, step, refined_residual, deadline) <= acceptable_residual))
    return Outcome::interior_point;
  // Sets that are too large for the dual method, and those that depend on each other, are refined.
  double residual = infinity;
  if (qp.has_limits() && !out_of_time_) {
    std::swap(step, interior_);
    residual = refine(qp, step, refined_residual, deadline);
    if (residual <= acceptable_residual) return Outcome::interior_point;
    interior_ = step;
  }
  // Polishing has overwritten the step. If rounding prevents the higher accuracy, repeat the first run.
  factored_ = false;
  bool is_accurate = true;
  if (!out_of_time_ && !interior_point(qp, step, on_its_own, deadline) && !out_of_time_)
    is_accurate = interior_point(qp, step, ready_to_polish, deadline);
  if (!is_accurate && !out_of_time_ && qp.has_limits()) interior_point(qp, step, ready_with_limits, deadline);
  if (qp.has_limits() && !out_of_time_ && !(refine(qp, step, refined_residual, deadline) < residual)) step = interior_;
  return out_of_time_ ? Outcome::out_of_time : Outcome::interior_point;
}

bool StageQpSolver::polish(const StageQp& qp, Iterate& step, Clock::time_point deadline) noexcept {
  if (!qp.has_limits()) return try_active_sets(qp, step, polish_rounds, deadline);
  prepared_ = false;
  const auto outcome = solve_from_guess(qp, step, deadline);
  out_of_time_ = outcome == DualActiveSet::Outcome::out_of_time;
  return outcome == DualActiveSet::Outcome::solved;
}

void StageQpSolver::take_interior_set() noexcept {
  active_.clear();
  any_active_ = true;
  for (const Bounded& v : bounded_) {
    std::int8_t& side = v.row        ? active_.limit(v.stage)[v.component]
                        : v.is_state ? active_.state(v.stage)[v.component]
                                     : active_.control(v.stage)[v.component];
    const bool at_lower = std::isfinite(v.lower) && v.below.multiplier > gradient_scale_ * v.below.slack;
    const bool at_upper = std::isfinite(v.upper) && v.above.multiplier > gradient_scale_ * v.above.slack;
    side = at_lower && (!at_upper || v.below.multiplier > v.above.multiplier) ? std::int8_t{-1}
           : at_upper                                                         ? std::int8_t{1}
                                                                              : std::int8_t{0};
    const Side& active = side < 0 ? v.below : v.above;
    if (v.is_soft && side != 0 && gradient_scale_ * active.excess > active.rest)
      side = static_cast<std::int8_t>(2 * side);
  }
}

const StageQp& StageQpSolver::convexify(const StageQp& qp) noexcept {
  const StageQp& now = solved(qp);
  riccati_.factor(now, no_bounds_);
  ++factorisations_;
  if (!riccati_.was_convexified()) return now;
  if (!is_convexified_) convexified_.take_stages(qp);
  riccati_.write_convexified(convexified_);
  is_convexified_ = was_convexified_ = true;
  return convexified_;
}

/// The same for a QP with limits, in a fraction of the time. Tells whether the result is factorised already.
const StageQp& StageQpSolver::convexify_limited(const StageQp& qp, bool& is_factored) noexcept {
  if (!is_convexified_) convexified_.take_stages(qp);
  ++factorisations_;
  if (!riccati_.convexify(convexified_, no_bounds_)) return convexify(qp);
  is_factored = qp.initial_state_is_given;
  if (!riccati_.was_convexified()) return solved(qp);
  is_convexified_ = was_convexified_ = true;
  return convexified_;
}

bool StageQpSolver::covariances(const StageQp& qp, double* all, double* last) noexcept {
  // Kernels are compiled for the sizes of few states, whose factorisation is the shorter way.
  constexpr int few_states = 8;
  if (!all && last && qp.capacity().states > few_states && riccati_.filter_covariance(qp, last)) return true;
  riccati_.factor_for_covariances(qp, no_bounds_);
  factored_ = prepared_ = is_dual_ = false;
  if (riccati_.was_convexified()) return false;
  riccati_.covariances(qp, all, last);
  return true;
}

}  // namespace rhec
