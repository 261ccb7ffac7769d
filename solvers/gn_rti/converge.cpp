// Mode `converge`: steps with a line search on an l1 merit function.
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "gn_rti.hpp"
#include "rhec/core/ocp/iterate_checks.hpp"
#include "rhec/core/qp/kkt.hpp"
#include "step_costs.hpp"

namespace rhec::gn_rti {
namespace {

constexpr double sufficient_decrease = 1e-4;
constexpr double shortest_step = 1e-6;
// Below this KKT residual Newton's method is trusted more than the merit function.
constexpr double near_solution = 1e-3;
// Relative differences of the merit below this are rounding.
constexpr double merit_rounding = 1e-13;
// If no step can remove even this share of the defects and violations, there is no solution nearby.
constexpr double least_asked_share = 0.1;
// Prices of violated limits, relative to the gradient. A step along which a higher price removes little more of the
// violation has the right one; one that leaves more than the last share of it makes no progress.
constexpr double first_price = 1e2, next_price = 1e2, highest_price = 1e8;
constexpr double low_share = 0.1, little_less = 0.9, stuck = 0.999;
// If so many priced steps in a row together leave more than this share of the violation, no point nearby meets the
// limits.
constexpr int most_futile = 15;
constexpr double most_left = 0.9;
// Steps shorter than this, so many of them in a row, make little progress.
constexpr double short_step = 0.2, halved = 0.5;
constexpr int most_short_steps = 8;
// How often steps at a price begin at the guess.
constexpr int most_attempts = 2;
// Where a step changes less than this share of the merit, and the residual stays above the second share of what it was,
// it is rounding that keeps it there.
constexpr double settled_merit = 1e-10, little_progress = 0.1;
constexpr int most_refinements = 5, most_rounds = 5;
// What a QP is refined to, relative to the tolerance.
constexpr double enough_refined = 1e-2;
// How often penalties fall.
constexpr int most_penalty_cuts = 20;

}  // namespace

/// Applies the step as a feedback policy in a simulation: controls move by the given step length and react to the
/// deviation of the simulated from the linearised states, so the result has no defects. Far from the solution this
/// makes much more progress than the linearised states do.
void GnRti::roll_out_step(const Iterate& from, double length, Iterate& to) noexcept {
  add_step(from, length, to);
  qp_solver_.prepare_feedback(*qp_);
  double deviation[Riccati::max_width], policy[Riccati::max_width];
  for (int i = 0; i < ocp_->intervals(); ++i) {
    const int n = ocp_->state_count(i), m = ocp_->control_count(i);
    // The feedforward part of the policy is scaled by the step length; its feedback on the deviation is not.
    for (int j = 0; j < n; ++j)
      deviation[j] = step_.state(i)[j] + (to.state(i)[j] - from.state(i)[j] - length * step_.state(i)[j]);
    qp_solver_.feedback(*qp_, i, deviation, policy);
    for (int j = 0; j < m; ++j) {
      const double value = from.control(i)[j] + length * step_.control(i)[j] + (policy[j] - step_.control(i)[j]);
      to.control(i)[j] = std::min(std::max(value, ocp_->control_lower(i)[j]), ocp_->control_upper(i)[j]);
    }
    ocp_->simulate_interval(i, to, scratch_);
  }
}

double GnRti::merit(const Iterate& iterate) noexcept {
  const double objective = ocp_->evaluate(iterate, defects_.data(), scratch_);
  double defect = 0.0;
  for (int i = 0; i < ocp_->intervals(); ++i)
    for (int j = 0; j < ocp_->state_count(i + 1); ++j) defect += std::abs(defects_[i * ocp_->capacity().states + j]);
  const double without = objective + defect_penalty_ * defect + bound_penalty_ * total_violation(*ocp_, iterate);
  if (limits_.empty()) return without;
  const LimitCosts limits = costs_of_limits(iterate);
  return without + limits.slack + (is_priced_ ? price_ : bound_penalty_) * limits.violation;
}

LimitCosts GnRti::costs_of_limits(const Iterate& iterate) noexcept {
  LimitCosts all;
  ocp_->evaluate_limits(iterate, limits_.data(), scratch_);
  for (int i = 0; i <= ocp_->intervals(); ++i) {
    const LimitCosts of_stage =
        limit_costs(*ocp_, i, limits_.data() + static_cast<std::ptrdiff_t>(i) * ocp_->capacity().limit_row());
    all.slack += of_stage.slack;
    all.violation += of_stage.violation;
  }
  return all;
}

/// Raises a penalty to what a step's multipliers ask for. These can be huge far from the solution, and a penalty that
/// stayed that large would shorten every later step: it falls, too, some times.
void GnRti::raise(double& penalty, double least) noexcept {
  if (penalty > 4.0 * least && penalty_cuts_left_ > 0 && (limits_.empty() || !is_elastic_)) {
    penalty = 2.0 * least;
    --penalty_cuts_left_;
  }
  penalty = std::max(penalty, least);
}

/// Second-order correction (Nocedal & Wright 2006, section 18.3): the step with the values that limits and
/// dynamics have at its end, in `trial_`, by a QP in `trial_qp_`. False if there is none. The step itself is kept in
/// `first_step_`.
bool GnRti::correct_step(const StageQp& first, Report& report, Clock::time_point deadline) noexcept {
  ocp_->evaluate_limits(trial_, limits_.data(), scratch_);
  trial_qp_ = first;
  first_step_ = step_;
  if (!std::isfinite(ocp_->evaluate(trial_, defects_.data(), scratch_))) return false;
  for (int i = 0; i <= trial_qp_.intervals(); ++i) {
    const double* values = limits_.data() + static_cast<std::ptrdiff_t>(i) * ocp_->capacity().limit_row();
    for (int r = 0; r < trial_qp_.limits(i); ++r) {
      const double* row = trial_qp_.G(i) + static_cast<std::ptrdiff_t>(r) * trial_qp_.stride();
      double along = 0.0;
      for (int j = 0; j < trial_qp_.capacity().states + trial_qp_.controls(i); ++j) along += row[j] * step_.row(i)[j];
      if (!std::isfinite(values[r] - along)) return false;
      trial_qp_.limit_lower(i)[r] = ocp_->limit_lower(i)[r] - values[r] + along;
      trial_qp_.limit_upper(i)[r] = ocp_->limit_upper(i)[r] - values[r] + along;
    }
    for (int j = 0; i < trial_qp_.intervals() && j < trial_qp_.states(i + 1); ++j)
      trial_qp_.b(i)[j] += defects_[static_cast<std::ptrdiff_t>(i) * ocp_->capacity().states + j];
  }
  qp_solver_.guess_from(trial_qp_, step_);
  const auto outcome = solve_qp(report, deadline);
  return (outcome == StageQpSolver::Outcome::active_set || outcome == StageQpSolver::Outcome::interior_point) &&
         is_finite(*ocp_, step_);
}

/// Line search along the step from `best_` on the l1 merit function; the accepted iterate goes to `trial_`. False if no
/// step length is acceptable.
bool GnRti::search_along_step(Report& report, double residual, double& merit_after,
                              Clock::time_point deadline) noexcept {
  was_elastic_ = is_elastic_;
  raise(defect_penalty_, 1.5 * largest_costate(*ocp_, step_));
  raise(bound_penalty_, 1.5 * largest_bound_multiplier(*ocp_, step_));
  const double before = merit(best_);
  double defect = 0.0, slope = 0.0;
  for (int i = 0; i <= ocp_->intervals(); ++i) {
    for (int j = 0; j < ocp_->state_count(i); ++j) slope += qp_->q(i)[j] * step_.state(i)[j];
    if (i == ocp_->intervals()) break;
    for (int j = 0; j < ocp_->state_count(i + 1); ++j) defect += std::abs(qp_->b(i)[j]);
    for (int j = 0; j < ocp_->control_count(i); ++j) slope += qp_->r(i)[j] * step_.control(i)[j];
  }
  slope -= defect_penalty_ * defect + bound_penalty_ * asked_share_ * total_violation(*ocp_, best_);
  if (!limits_.empty()) {
    // The slack costs are convex in the step: their change over the full step bounds their slope.
    slope += slack_costs_after(*qp_, step_) - slack_costs(*qp_, all_stages(*ocp_));
    // Where hard limits have a price in the QP, their violation is among these costs.
    if (!is_elastic_) slope -= bound_penalty_ * asked_share_ * costs_of_limits(best_).violation;
  }
  slope_ = slope;
  const auto acceptable = [&](double length) {
    merit_after = merit(trial_);
    const double allowed =
        before + sufficient_decrease * length * std::min(slope, 0.0) + merit_rounding * (1.0 + std::abs(before));
    return std::isfinite(merit_after) && merit_after <= allowed;
  };
  // Control starts from a given state and follows the policy. Estimation has measurements at every node and takes the
  // linearised states; it tries the policy only if they are not acceptable.
  const bool policy_first = ocp_->can_roll_out();
  const auto take = [&](double length) {
    policy_first ? roll_out_step(best_, length, trial_) : add_step(best_, length, trial_);
  };
  for (double length = 1.0; length >= std::max(shortest_step, shortest_length_); length *= 0.5) {
    step_length_ = length;
    take(length);
    if (acceptable(length)) return true;
    // Near the solution the merit function may reject a good Newton step.
    if (length == 1.0 && residual < near_solution && std::isfinite(merit_after)) {
      ocp_->linearise(all_stages(*ocp_), trial_, Hessian::gauss_newton, trial_qp_, scratch_);
      if (kkt_residual(trial_qp_, trial_).largest() < 0.5 * residual) return true;
    }
    if (!policy_first) {
      roll_out_step(best_, length, trial_);
      if (acceptable(length)) return true;
    }
    // A full step may be rejected because limits curve (Maratos' effect), however near the solution is.
    if (length < 1.0 || limits_.empty()) continue;
    take(length);
    const StageQp* const first = std::exchange(qp_, &trial_qp_);
    if (correct_step(*first, report, deadline)) {
      take(length);
      if (acceptable(length)) return true;
    }
    // Shorter steps are those of the QP as it was, and so is their policy.
    qp_ = first;
    qp_solver_.guess_from(*qp_, first_step_);
    if (const auto outcome = solve_qp(report, deadline);
        outcome == StageQpSolver::Outcome::infeasible || outcome == StageQpSolver::Outcome::out_of_time)
      return false;
  }
  return false;
}

/// Powell's relaxation: scales the defects and violated bounds and hard limits that the step must remove by `share`. At
/// a share of 0 the QP is feasible: the zero step satisfies it.
void GnRti::relax_qp(double share) noexcept {
  relaxed_qp_ = qp_solver_.solved(*qp_);
  qp_ = &relaxed_qp_;
  asked_share_ *= share;
  const auto relax = [share](double* lower, double* upper, int count) {
    for (int j = 0; j < count; ++j) {
      if (lower[j] > 0.0) lower[j] *= share;
      if (upper[j] < 0.0) upper[j] *= share;
    }
  };
  for (int i = 0; i <= relaxed_qp_.intervals(); ++i) {
    relax(relaxed_qp_.state_lower(i), relaxed_qp_.state_upper(i), relaxed_qp_.states(i));
    for (int r = 0; relaxed_qp_.has_limits() && r < relaxed_qp_.limits(i); ++r)
      if (std::isinf(relaxed_qp_.limit_linear(i)[r]))
        relax(relaxed_qp_.limit_lower(i) + r, relaxed_qp_.limit_upper(i) + r, 1);
    if (i == relaxed_qp_.intervals()) break;
    relax(relaxed_qp_.control_lower(i), relaxed_qp_.control_upper(i), relaxed_qp_.controls(i));
    for (int j = 0; j < relaxed_qp_.states(i + 1); ++j) relaxed_qp_.b(i)[j] *= share;
  }
}

/// Where a QP has no solution: asks for less until it has.
StageQpSolver::Outcome GnRti::relax_until_feasible(StageQpSolver::Outcome outcome, Report& report,
                                                   Clock::time_point deadline) noexcept {
  for (asked_share_ = 1.0; outcome == StageQpSolver::Outcome::infeasible && asked_share_ > least_asked_share;) {
    relax_qp(0.5);
    outcome = solve_qp(report, deadline);
  }
  return outcome;
}

/// Solves the QP of `best_` with a price on the violation of hard limits, an l1 penalty (Nocedal & Wright 2006, section
/// 18.5), and tells that violation `before` and `after` the step, as far as the linearisation knows.
StageQpSolver::Outcome GnRti::solve_at_prices(Report& report, double& before, double& after,
                                              Clock::time_point deadline) noexcept {
  const StageQp& given = linearisation_->qp();
  const double unit = 1.0 + largest_gradient(given);
  after = before = costs_of_limits(best_).violation;
  auto outcome = StageQpSolver::Outcome::infeasible;
  is_elastic_ = true;
  asked_share_ = 1.0;
  report.fallback_used = true;
  for (double price = first_price * unit; price <= highest_price * unit; price *= next_price) {
    relaxed_qp_ = given;
    for (int i = 0; i <= given.intervals(); ++i)
      for (int r = 0; r < given.limits(i); ++r)
        if (!std::isfinite(given.limit_linear(i)[r])) relaxed_qp_.limit_linear(i)[r] = price;
    qp_ = &relaxed_qp_;
    qp_solver_.guess_from(*qp_, best_);
    outcome = solve_qp(report, deadline);
    if (outcome == StageQpSolver::Outcome::infeasible || outcome == StageQpSolver::Outcome::out_of_time) return outcome;
    const double last = std::exchange(after, violation_after(given, step_));
    if (after <= low_share * before || (after < stuck * before && after > little_less * last)) break;
  }
  return outcome;
}

/// Infeasible if no step reduces the violation.
StageQpSolver::Outcome GnRti::solve_elastic(Report& report, Clock::time_point deadline) noexcept {
  double before = 0.0, after = 0.0;
  const auto outcome = solve_at_prices(report, before, after, deadline);
  return after < stuck * before ? outcome : StageQpSolver::Outcome::infeasible;
}

/// Looks at an accepted step from `best_`: whether so many priced ones have removed so little that the limits cannot be
/// met.
bool GnRti::is_futile() noexcept {
  if (!was_elastic_ || limits_.empty()) {
    futile_ = 0;
    return false;
  }
  const double violation = costs_of_limits(best_).violation;
  if (futile_ == 0 || violation < most_left * violation_before_) {
    violation_before_ = violation;
    futile_ = 0;
  }
  return ++futile_ > most_futile;
}

/// Where limits seem impossible to meet: looks for a point that violates less, from the last one and from the guess.
/// Without one that claim is as good as it gets.
/// From a point that meets all, where steps have come to a halt, the same goes on without the multipliers that led
/// there.
bool GnRti::find_other_start(const Iterate& guess, bool is_feasible, Clock::time_point deadline) noexcept {
  if (limits_.empty()) return false;
  if (is_feasible) {
    if (!search_.take_start()) return false;
    other_start_ = best_;
    other_start_.clear_multipliers();
    return true;
  }
  return search_.find_other(*ocp_, guess, best_, deadline, scratch_, other_start_);
}

/// Where steps no longer change the merit, and rounding in the QP's solution is what is left of the residual: takes it
/// from the multipliers, and from the step that they lead to. False if that does not halve the residual of `best_`.
bool GnRti::refine(Report& report, double residual, Clock::time_point deadline) noexcept {
  bool has_refined = false;
  for (int round = 0; round < most_rounds && residual > options_.tolerance && !is_past(deadline); ++round) {
    step_ = best_;
    for (int i = 0; i <= ocp_->intervals(); ++i) std::fill_n(step_.row(i), ocp_->capacity().row(), 0.0);
    const int before = qp_solver_.factorisations();
    const double of_qp = qp_solver_.refine(linearisation_->qp(), step_, enough_refined * options_.tolerance, deadline);
    report.factorisations += qp_solver_.factorisations() - before;
    if (!std::isfinite(of_qp)) break;
    add_step(best_, 1.0, trial_);
    linearise(trial_);
    const double refined = kkt_residual(*qp_, trial_).largest();
    if (!(refined < halved * residual)) break;
    residual = refined;
    has_refined = true;
    std::swap(best_, trial_);
  }
  linearise(best_);
  return has_refined;
}

void GnRti::begin_at(const Iterate& guess) noexcept {
  defect_penalty_ = bound_penalty_ = 0.0;
  was_elastic_ = is_priced_ = use_exact_ = false;
  attempts_ = 0;
  futile_ = 0;
  penalty_cuts_left_ = most_penalty_cuts;
  first_price_ = 0.0;
  best_ = guess;
  // The line search does not vary a given initial state.
  if (ocp_->initial_state()) std::copy_n(ocp_->initial_state(), ocp_->state_count(0), best_.state(0));
}

void GnRti::note_met(const KktResidual& kkt, double objective) noexcept {
  if (limits_.empty() || std::max(kkt.defect, kkt.bound_violation) > options_.tolerance) return;
  objective += slack_costs(linearisation_->qp(), all_stages(*ocp_));
  if (has_met_ && !(objective < met_objective_)) return;
  met_ = best_;
  met_objective_ = objective;
  has_met_ = true;
}

void GnRti::note_violation(const KktResidual& kkt) noexcept {
  if (has_met_ || limits_.empty() || kkt.defect > std::sqrt(options_.tolerance)) return;
  const double violation = costs_of_limits(best_).violation;
  if (!(violation < met_violation_)) return;
  met_ = best_;
  met_violation_ = violation;
}

Report GnRti::converge(Iterate& iterate, Clock::time_point deadline) noexcept {
  Report report;
  qp_solver_.set_cheap(false);
  search_.begin();
  has_met_ = false;
  met_violation_ = std::numeric_limits<double>::infinity();
  const Iterate* guess = &iterate;
  begin_at(*guess);
  report.status = Status::iteration_limit;
  double least_residual = std::numeric_limits<double>::infinity(), last_residual = least_residual;
  double halved_residual = least_residual;
  bool is_settled = false;
  int refinements_left = most_refinements;
  int slow = 0, short_steps = 0, stagnant = 0, first_iteration = 0;
  for (;; ++report.iterations) {
    const double objective = linearise(best_);
    report.kkt = kkt_residual(*qp_, best_);
    note_met(report.kkt, objective);
    const double residual = report.kkt.largest();
    if (residual <= options_.tolerance) {
      report.status = Status::solved;
      break;
    }
    if (report.iterations == options_.max_iterations) break;
    // One iteration is made in any case: a loop that is always late gets somewhere, if slowly.
    if (report.iterations > 0 && is_past(deadline)) {
      report.status = Status::deadline;
      break;
    }
    // If Gauss-Newton makes little progress or cycles, the residuals are large: from here on the exact Hessian does
    // better.
    if (options_.hessian == Curvature::automatic && !use_exact_ && ocp_->has_second_derivatives()) {
      slow = residual > 0.3 * least_residual ? slow + 1 : 0;
      if (slow >= 4) {
        use_exact_ = true;
        linearise(best_);
      }
    }
    least_residual = std::min(least_residual, residual);
    if (!limits_.empty() && is_settled && residual > little_progress * last_residual && refinements_left > 0 &&
        report.kkt.bound_violation <= std::sqrt(options_.tolerance)) {
      --refinements_left;
      is_settled = false;
      // The iterate before may have had better multipliers.
      const bool is_worse = last_residual < residual;
      if (is_worse) {
        std::swap(best_, trial_);
        linearise(best_);
      }
      refine(report, is_worse ? last_residual : residual, deadline);
      continue;
    }

    if (!limits_.empty() && !is_priced_ && is_violation_stuck(report.iterations - first_iteration)) {
      begin_priced_at(*guess, deadline);
      continue;
    }
    // Damped steps do better than short ones, and than those of a Hessian that is not convex.
    stagnant = residual > halved * halved_residual ? stagnant + 1 : 0;
    if (stagnant == 0) halved_residual = residual;
    const bool may_damp = !limits_.empty() || hessian() == Hessian::exact;
    if (std::max(short_steps, stagnant) > most_short_steps && may_damp && !is_priced_ && is_nearly_feasible())
      begin_priced(2.0 * largest_bound_multiplier(*ocp_, best_));
    double merit_after = 0.0;
    bool feasible = false, accepted = false, late = false;
    // Large multipliers of priced limits would dominate the exact Hessian.
    bool may_be_elastic = !limits_.empty() && hessian() != Hessian::exact;
    const auto try_step = [&] {
      StageQpSolver::Outcome outcome{};
      if (is_priced_) return take_priced_step(report, residual, merit_after, deadline, feasible, late);
      is_elastic_ = false;
      qp_solver_.guess_from(*qp_, best_);
      outcome = solve_qp(report, deadline);
      if (outcome == StageQpSolver::Outcome::infeasible && !limits_.empty()) {
        if (!may_be_elastic) return false;
        outcome = solve_elastic(report, deadline);
        if (outcome == StageQpSolver::Outcome::infeasible) {
          is_elastic_ = false;
          qp_ = &linearisation_->qp();
        }
      }
      // Linearised equations can contradict bounds even if the nonlinear ones do not: then a single step has to remove
      // less.
      outcome = relax_until_feasible(outcome, report, deadline);
      late = outcome == StageQpSolver::Outcome::out_of_time;
      if (late || outcome == StageQpSolver::Outcome::infeasible || !is_finite(*ocp_, step_)) return false;
      feasible = true;
      return search_along_step(report, residual, merit_after, deadline);
    };
    accepted = try_step();
    // Where the exact Hessian had to be convexified its step is unreliable, so the Gauss-Newton step is tried too and
    // the better one is taken. Near the solution merits differ by rounding only, and it is the exact Hessian that
    // converges, unless it does not.
    const bool is_unreliable =
        qp_solver_.was_convexified() && (residual > near_solution || residual > little_less * last_residual);
    if (!late && hessian() == Hessian::exact && (!accepted || is_unreliable)) {
      std::swap(trial_, other_trial_);
      const bool exact_accepted = accepted;
      linearisation_->linearise(best_, Hessian::gauss_newton);
      qp_ = &linearisation_->qp();
      may_be_elastic = !limits_.empty();
      accepted = try_step();
      // The price may be another one now.
      if (exact_accepted && (!accepted || merit(other_trial_) < merit_after)) {
        std::swap(trial_, other_trial_);
        accepted = true;
      }
    }
    if (!accepted && !late && !limits_.empty() && residual < near_solution && refinements_left > 0) {
      --refinements_left;
      linearise(best_);
      if (refine(report, residual, deadline)) continue;
    }
    last_residual = residual;
    const bool is_hopeless = accepted && (is_futile() || (is_priced_ && !raise_price(merit_after)));
    // The least violation around one point need not be the least of all: from a guess that is left in another direction
    // there may be none.
    if ((!accepted || is_hopeless) && !late && !limits_.empty() && attempts_ < most_attempts) {
      begin_priced_at(*guess, deadline);
      continue;
    }
    if (!accepted || is_hopeless) {
      note_violation(report.kkt);
      // A point that meets everything is no sign of infeasibility, whatever became of the QP there.
      const bool is_feasible_point = std::max(report.kkt.defect, report.kkt.bound_violation) <= options_.tolerance;
      const bool is_violated =
          is_priced_ && !limits_.empty() && costs_of_limits(best_).violation > std::sqrt(options_.tolerance);
      report.status = late                                                           ? Status::deadline
                      : !is_feasible_point && (accepted || is_violated || !feasible) ? Status::infeasible
                                                                                     : Status::stalled;
      if (late || !find_other_start(*guess, is_feasible_point, deadline)) break;
      report.status = Status::iteration_limit;
      report.fallback_used = true;
      guess = &other_start_;
      begin_at(*guess);
      least_residual = last_residual = halved_residual = std::numeric_limits<double>::infinity();
      slow = short_steps = stagnant = 0;
      first_iteration = report.iterations + 1;
      continue;
    }
    short_steps = step_length_ < short_step ? short_steps + 1 : 0;
    is_settled = step_length_ == 1.0 && std::abs(slope_) <= settled_merit * (1.0 + std::abs(merit_after));
    std::swap(best_, trial_);
  }
  // Where there is a point that meets everything there is a plan, however far others went astray. Real-time iterations
  // begin where hard limits are violated least, and go on so.
  if (report.status == Status::infeasible &&
      (has_met_ || (options_.mode == Mode::rti && std::isfinite(met_violation_)))) {
    best_ = met_;
    report.status = has_met_ ? Status::stalled : Status::relaxed;
  }
  const double objective = ocp_->evaluate(best_, nullptr, scratch_);
  if (report.status != Status::infeasible && is_finite(*ocp_, best_) && std::isfinite(objective))
    std::swap(iterate, best_);
  report.objective = linearisation_->linearise(iterate, Hessian::none);
  report.objective += slack_costs(linearisation_->qp(), all_stages(*ocp_));
  report.kkt = kkt_residual(linearisation_->qp(), iterate);
  return report;
}

}  // namespace rhec::gn_rti
