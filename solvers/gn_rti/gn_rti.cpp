#include "gn_rti.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <utility>

#include "rhec/core/ocp/iterate_checks.hpp"
#include "rhec/core/qp/stage_checks.hpp"
#include "rhec/plugins/kit/sdk.hpp"

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

/// Visits corresponding rows of two iterates, of states and controls alike: function(destination, source, length).
template <class Function>
void for_each_primal_row(const Ocp& ocp, Iterate& to, const Iterate& from, const Function& function) {
  for (int i = 0; i <= ocp.intervals(); ++i) {
    function(to.state(i), from.state(i), ocp.state_count(i));
    if (i < ocp.intervals()) function(to.control(i), from.control(i), ocp.control_count(i));
  }
}
template <class Function>
void for_each_dual_row(const Ocp& ocp, Iterate& to, const Iterate& from, const Function& function) {
  for (int i = 0; i <= ocp.intervals(); ++i) {
    function(to.costate(i), from.costate(i), ocp.state_count(i));
    function(to.state_bound(i), from.state_bound(i), ocp.state_count(i));
    if (i < ocp.intervals()) function(to.control_bound(i), from.control_bound(i), ocp.control_count(i));
    if (ocp.capacity().limits > 0) function(to.limit_bound(i), from.limit_bound(i), ocp.limit_count(i));
  }
}

/// Whether any costate is nonzero (NaN counts as nonzero).
bool has_costates(const Ocp& ocp, const Iterate& iterate) noexcept {
  for (int i = 1; i <= ocp.intervals(); ++i)
    for (int j = 0; j < ocp.state_count(i); ++j)
      if (iterate.costate(i)[j] != 0.0) return true;
  return false;
}

/// What the slacks cost after a step, as far as the linearisation knows.
double slack_costs_after(const StageQp& qp, const Iterate& step) noexcept {
  double costs = 0.0;
  for (int i = 0; i <= qp.intervals(); ++i) {
    for (int r = 0; r < qp.limits(i); ++r) {
      const double linear = qp.limit_linear(i)[r];
      if (!std::isfinite(linear)) continue;
      const double* row = qp.G(i) + static_cast<std::ptrdiff_t>(r) * qp.stride();
      double value = 0.0;
      for (int j = 0; j < qp.capacity().states + qp.controls(i); ++j) value += row[j] * step.row(i)[j];
      const double slack = std::max({0.0, qp.limit_lower(i)[r] - value, value - qp.limit_upper(i)[r]});
      costs += (linear + 0.5 * qp.limit_quadratic(i)[r] * slack) * slack;
    }
  }
  return costs;
}

}  // namespace

const OptionTable<GnRtiOptions>& GnRtiOptions::table() {
  static const auto options =
      OptionTable<GnRtiOptions>()
          .choice("mode", &GnRtiOptions::mode, {{"rti", Mode::rti}, {"converge", Mode::converge}},
                  "rti: a fixed number of full steps a sample; converge: to the tolerance, with a line search")
          .choice(
              "hessian", &GnRtiOptions::hessian,
              {{"gauss_newton", Curvature::gauss_newton}, {"exact", Curvature::exact}, {"auto", Curvature::automatic}},
              "curvature of the quadratic programs; auto: Gauss-Newton for estimation; for control exact, or in mode "
              "rti "
              "Gauss-Newton where that costs much less and does as well")
          .integer("iterations", &GnRtiOptions::iterations, "steps a sample in mode rti, at most", between(1, 1000))
          .number("residual", &GnRtiOptions::residual,
                  "KKT residual at which mode rti takes no further step in a sample; 0: it always takes all",
                  at_least(0.0))
          .integer("max_iterations", &GnRtiOptions::max_iterations, "limit of mode converge", between(1, 100000))
          .number("tolerance", &GnRtiOptions::tolerance, "KKT residual at which mode converge is content",
                  greater_than(0.0));
  return options;
}

std::string GnRti::why_not(const Ocp& ocp) const {
  const Capacity capacity = ocp.capacity();
  if (std::max(capacity.states, capacity.controls) > Riccati::max_width)
    return "a stage has more than " + std::to_string(Riccati::max_width) +
           " states or controls; use sparse_sqp, which is for wide models";
  if (ocp.has_second_derivatives()) return {};
  if (options_.hessian == Curvature::exact)
    return "the exact Hessian was asked for and the model has no second derivatives; set hessian: gauss_newton";
  // A line search makes the Gauss-Newton step safe; a full step need not converge.
  if (options_.hessian == Curvature::automatic && options_.mode == Mode::rti && !ocp.has_small_residuals())
    return "the model has no second derivatives, and full Gauss-Newton steps need not converge in control; set mode: "
           "converge, or hessian: gauss_newton if residuals are small";
  return {};
}

void GnRti::setup(const Ocp& ocp) {
  if (const std::string reason = why_not(ocp); !reason.empty()) throw Error("solver 'gn_rti': " + reason);
  const Capacity capacity = ocp.capacity();
  ocp_ = &ocp;
  linearisation_ = ocp.make_linearisation();
  trial_qp_ = relaxed_qp_ = StageQp(capacity);
  qp_ = &linearisation_->qp();
  qp_solver_ = StageQpSolver(capacity);
  for (Iterate* iterate : {&step_, &trial_, &best_, &other_trial_}) *iterate = Iterate(capacity);
  scratch_.assign(ocp.scratch_size(), 0.0);
  if (options_.hessian == Curvature::automatic && options_.mode == Mode::rti) choice_.setup(ocp);
  limits_.assign((static_cast<std::size_t>(capacity.intervals) + 1) * capacity.limit_row(), 0.0);
  defects_.assign(static_cast<std::size_t>(capacity.intervals) * capacity.states, 0.0);
  reset();
}

void GnRti::reset() noexcept {
  is_prepared_ = is_pending_ = false;
  if (linearisation_) linearisation_->forget();
  qp_solver_.reset();
  choice_.reset();
}

Hessian GnRti::hessian() const noexcept {
  if (use_exact_ && ocp_->has_second_derivatives()) return Hessian::exact;
  if (options_.hessian == Curvature::automatic)
    return options_.mode == Mode::rti ? choice_.now() : ocp_->preferred_hessian();
  return options_.hessian == Curvature::exact ? Hessian::exact : Hessian::gauss_newton;
}

/// Linearises at an iterate. The exact Hessian needs costates; an iterate without any first gets those that fit it.
void GnRti::linearise(Iterate& iterate) noexcept {
  if (hessian() == Hessian::exact && !has_costates(*ocp_, iterate)) {
    linearisation_->linearise(iterate, Hessian::gauss_newton);
    set_costates(linearisation_->qp(), iterate);
  }
  linearisation_->linearise(iterate, hessian());
  qp_ = &linearisation_->qp();
}

void GnRti::prepare(const Iterate& guess) noexcept {
  is_prepared_ = is_pending_ = use_exact_ = false;
  if (!ocp_ || !(guess.capacity() == ocp_->capacity())) return;
  if (hessian() == Hessian::exact && !has_costates(*ocp_, guess)) {
    trial_ = guess;
    linearise(trial_);
  } else {
    linearisation_->prepare(guess, hessian());
    qp_ = &linearisation_->qp();
  }
  qp_solver_.guess_from(*qp_, guess);
  qp_solver_.prepare(*qp_);
  is_prepared_ = true;
}

void GnRti::add_step(const Iterate& from, double length, Iterate& to) const noexcept {
  to = from;
  for_each_primal_row(*ocp_, to, step_, [&](double* row, const double* step, int n) {
    for (int j = 0; j < n; ++j) row[j] += length * step[j];
  });
  for_each_dual_row(*ocp_, to, step_, [&](double* row, const double* value, int n) {
    for (int j = 0; j < n; ++j) row[j] += length * (value[j] - row[j]);
  });
}

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
  return without + limits.slack + bound_penalty_ * limits.violation;
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

Report GnRti::solve(Iterate& iterate, Clock::time_point deadline) noexcept {
  Report report = feedback(iterate, deadline);
  finish(iterate, report);
  return report;
}

void GnRti::finish(Iterate& iterate, Report& report) noexcept {
  if (is_pending_) settle(iterate, report);
}

Report GnRti::feedback(Iterate& iterate, Clock::time_point deadline) noexcept {
  Report report;
  use_exact_ = is_pending_ = false;
  if (ocp_ && iterate.capacity() == ocp_->capacity()) {
    // A real-time iteration continues from the previous sample; an iterate without costates has no previous sample.
    if (options_.mode == Mode::rti && has_costates(*ocp_, iterate)) {
      report = real_time(iterate, deadline);
    } else if (is_sound_start(*ocp_, iterate, scratch_)) {
      report = converge(iterate, deadline);
    }
  }
  is_prepared_ = false;
  return report;
}

Report GnRti::real_time(Iterate& iterate, Clock::time_point deadline) noexcept {
  Report report;
  report.status = Status::step_taken;
  bool is_ready = is_prepared_ && linearisation_->is_at(iterate);
  for (int iteration = 0; iteration < options_.iterations; ++iteration) {
    if (iteration > 0 && is_past(deadline)) {
      report.status = Status::deadline;
      break;
    }
    if (!is_ready) linearisation_->prepare(iterate, hessian());
    linearisation_->refresh(iterate);
    qp_ = &linearisation_->qp();
    if (!is_ready) qp_solver_.guess_from(*qp_, iterate);
    is_ready = false;
    const auto outcome = solve_qp(report, deadline);
    if (outcome == StageQpSolver::Outcome::infeasible || outcome == StageQpSolver::Outcome::out_of_time) {
      report.status = outcome == StageQpSolver::Outcome::infeasible ? Status::infeasible : Status::deadline;
      break;
    }
    // The active-set methods have already checked that their steps are finite.
    if (outcome == StageQpSolver::Outcome::interior_point && !is_finite(*ocp_, step_)) {
      report.status = Status::stalled;
      break;
    }
    // The step is turned into the new iterate in place, and the swap keeps the old iterate where the step was: the
    // processor's cache has room for only a few horizons.
    add_to_step(ocp_->intervals(), iterate, step_);
    const bool is_last = iteration + 1 == options_.iterations;
    if (!is_last && !assess_step(step_, report)) {
      report.status = Status::stalled;
      break;
    }
    is_pending_ = is_last;
    std::swap(iterate, step_);
    ++report.iterations;
    if (!is_last && report.kkt.largest() <= options_.residual) break;
  }
  if (report.iterations == 0) {
    give_up(iterate, report);
    return report;
  }
  if (report.status == Status::infeasible || report.status == Status::stalled) report.status = Status::iteration_limit;
  return report;
}

/// Linearises at a new iterate, as the next sample will need it; false if the result is not finite.
bool GnRti::assess_step(const Iterate& iterate, Report& report) noexcept {
  double objective = linearisation_->linearise_for_residual(iterate, hessian());
  objective += slack_costs(linearisation_->qp(), all_stages(*ocp_));
  const KktResidual kkt = kkt_residual(linearisation_->qp(), iterate);
  if (!std::isfinite(objective) || !std::isfinite(kkt.stationarity)) return false;
  report.objective = objective;
  report.kkt = kkt;
  return true;
}

void GnRti::settle(Iterate& iterate, Report& report) noexcept {
  is_pending_ = false;
  if (!assess_step(iterate, report)) {
    --report.iterations;
    report.status = report.iterations > 0 ? Status::iteration_limit : Status::stalled;
    std::swap(iterate, step_);  // back to the iterate before the last step
    if (report.iterations == 0) give_up(iterate, report);
    return;
  }
  if (options_.hessian == Curvature::automatic) choice_.step(step_, iterate, report.kkt.largest(), scratch_);
}

/// If the iterate was assessed, its linearisation is already available.
bool GnRti::covariances(const Iterate& iterate, StageRange nodes, std::span<double> blocks) noexcept {
  if (!ocp_ || is_prepared_ || is_pending_) return false;
  const int N = ocp_->intervals(), states = ocp_->capacity().states;
  const bool is_all = nodes.first == 0, is_last = nodes.first == N;
  const std::size_t needed = static_cast<std::size_t>(states) * states * (nodes.last - nodes.first + 1);
  if (nodes.last != N || !(is_all || is_last) || blocks.size() < needed) return false;
  linearisation_->prepare(iterate, Hessian::gauss_newton);
  return qp_solver_.covariances(linearisation_->qp(), is_last ? nullptr : blocks.data(),
                                is_last ? blocks.data() : nullptr);
}

/// Reports on an iterate that no step has improved.
void GnRti::give_up(const Iterate& iterate, Report& report) noexcept {
  // The first check for numbers that are not finite on this path.
  if (is_sound_start(*ocp_, iterate, scratch_)) {
    report.objective = linearisation_->linearise(iterate, Hessian::none);
    report.objective += slack_costs(linearisation_->qp(), all_stages(*ocp_));
    report.kkt = kkt_residual(linearisation_->qp(), iterate);
  } else {
    report = {};
  }
}

/// Line search along the step from `best_` on the l1 merit function; the accepted iterate goes to `trial_`. False if no
/// step length is acceptable.
bool GnRti::search_along_step(double residual, double& merit_after) noexcept {
  defect_penalty_ = std::max(defect_penalty_, 1.5 * largest_costate(*ocp_, step_));
  bound_penalty_ = std::max(bound_penalty_, 1.5 * largest_bound_multiplier(*ocp_, step_));
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
    slope -= bound_penalty_ * asked_share_ * costs_of_limits(best_).violation;
  }
  const auto acceptable = [&](double length) {
    merit_after = merit(trial_);
    const double allowed =
        before + sufficient_decrease * length * std::min(slope, 0.0) + merit_rounding * (1.0 + std::abs(before));
    return std::isfinite(merit_after) && merit_after <= allowed;
  };
  // Control starts from a given state and follows the policy. Estimation has measurements at every node and takes the
  // linearised states; it tries the policy only if they are not acceptable.
  const bool policy_first = ocp_->can_roll_out();
  for (double length = 1.0; length >= shortest_step; length *= 0.5) {
    if (policy_first) {
      roll_out_step(best_, length, trial_);
    } else {
      add_step(best_, length, trial_);
    }
    if (acceptable(length)) return true;
    // Near the solution the merit function may reject a good Newton step.
    if (length == 1.0 && residual < near_solution && std::isfinite(merit_after)) {
      ocp_->linearise(all_stages(*ocp_), trial_, Hessian::gauss_newton, trial_qp_, scratch_);
      if (kkt_residual(trial_qp_, trial_).largest() < 0.5 * residual) return true;
    }
    if (policy_first) continue;
    roll_out_step(best_, length, trial_);
    if (acceptable(length)) return true;
  }
  return false;
}

StageQpSolver::Outcome GnRti::solve_qp(Report& report, Clock::time_point deadline) noexcept {
  const auto outcome = qp_solver_.solve(*qp_, step_, deadline);
  report.factorisations += qp_solver_.factorisations();
  report.fallback_used |= outcome == StageQpSolver::Outcome::interior_point;
  return outcome;
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

Report GnRti::converge(Iterate& iterate, Clock::time_point deadline) noexcept {
  Report report;
  defect_penalty_ = bound_penalty_ = 0.0;
  best_ = iterate;
  // The line search does not vary a given initial state.
  if (ocp_->initial_state()) std::copy_n(ocp_->initial_state(), ocp_->state_count(0), best_.state(0));
  report.status = Status::iteration_limit;
  double least_residual = std::numeric_limits<double>::infinity();
  int slow = 0;
  for (;; ++report.iterations) {
    linearise(best_);
    report.kkt = kkt_residual(*qp_, best_);
    const double residual = report.kkt.largest();
    if (residual <= options_.tolerance) {
      report.status = Status::solved;
      break;
    }
    if (report.iterations == options_.max_iterations) break;
    if (is_past(deadline)) {
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

    double merit_after = 0.0;
    bool feasible = false, accepted = false, late = false;
    const auto try_step = [&] {
      qp_solver_.guess_from(*qp_, best_);
      auto outcome = solve_qp(report, deadline);
      // Linearised equations can contradict bounds even if the nonlinear ones do not: then a single step has to remove
      // less.
      for (asked_share_ = 1.0; outcome == StageQpSolver::Outcome::infeasible && asked_share_ > least_asked_share;) {
        relax_qp(0.5);
        outcome = solve_qp(report, deadline);
      }
      late = outcome == StageQpSolver::Outcome::out_of_time;
      if (late || outcome == StageQpSolver::Outcome::infeasible || !is_finite(*ocp_, step_)) return false;
      feasible = true;
      return search_along_step(residual, merit_after);
    };
    accepted = try_step();
    // Where the exact Hessian had to be convexified its step is unreliable, so the Gauss-Newton step is tried too and
    // the better one is taken. Near the solution merits differ by rounding only, and it is the exact Hessian that
    // converges.
    if (!late && hessian() == Hessian::exact &&
        (!accepted || (qp_solver_.was_convexified() && residual > near_solution))) {
      std::swap(trial_, other_trial_);
      const bool exact_accepted = accepted;
      const double exact_merit = merit_after;
      linearisation_->linearise(best_, Hessian::gauss_newton);
      qp_ = &linearisation_->qp();
      accepted = try_step();
      if (exact_accepted && (!accepted || exact_merit < merit_after)) {
        std::swap(trial_, other_trial_);
        accepted = true;
      }
    }
    if (!accepted) {
      report.status = late ? Status::deadline : feasible ? Status::stalled : Status::infeasible;
      break;
    }
    std::swap(best_, trial_);
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

RHEC_PLUGIN(rhec::PluginKind::solver, rhec::gn_rti::GnRti,
            {.name = "gn_rti",
             .version = "0.1.0",
             .licence = "BSD-2-Clause",
             .source = "Sequential quadratic programming with a stage-wise Riccati recursion; real-time iteration of "
                       "Diehl et al. (2002)",
             .capabilities = "rhe, rhc, bounds on states, inputs and parameters, limits, real-time iteration"});
