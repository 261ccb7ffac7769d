#include "gn_rti.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <utility>

#include "rhec/core/ocp/iterate_checks.hpp"
#include "rhec/core/qp/stage_checks.hpp"
#include "rhec/plugins/kit/sdk.hpp"
#include "step_costs.hpp"

namespace rhec::gn_rti {
namespace {

// Limits surprise where what they cost has risen by more than this share of the last objective, and by more than a step
// of this length along the gradient would gain: more than one that comes in sight at the horizon's end. Hard ones cost,
// by the unit, so many times such a step.
constexpr double large_share = 2.0, large_push = 30.0, hard_price = 100.0;
// So many Gauss-Newton steps lead around what has appeared.
constexpr int evading_steps = 4;

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
  for (Iterate* iterate : {&step_, &trial_, &best_, &other_trial_, &first_step_}) *iterate = Iterate(capacity);
  if (capacity.limits > 0) {
    other_start_ = tracking_start_ = met_ = Iterate(capacity);
    tracking_.setup(ocp);
    search_.setup(ocp);
  }
  scratch_.assign(ocp.scratch_size(), 0.0);
  if (options_.hessian == Curvature::automatic && options_.mode == Mode::rti) choice_.setup(ocp);
  limits_.assign((static_cast<std::size_t>(capacity.intervals) + 1) * capacity.limit_row(), 0.0);
  defects_.assign(static_cast<std::size_t>(capacity.intervals) * capacity.states, 0.0);
  reset();
}

void GnRti::reset() noexcept {
  is_prepared_ = is_pending_ = false;
  expected_limits_ = {};
  expected_objective_ = 0.0;
  if (linearisation_) linearisation_->forget();
  qp_solver_.reset();
  choice_.reset();
}

Hessian GnRti::hessian() const noexcept {
  if (evades_) return Hessian::gauss_newton;
  if (use_exact_ && ocp_->has_second_derivatives()) return Hessian::exact;
  if (options_.hessian == Curvature::automatic)
    return options_.mode == Mode::rti ? choice_.now() : ocp_->preferred_hessian();
  return options_.hessian == Curvature::exact ? Hessian::exact : Hessian::gauss_newton;
}

/// Linearises at an iterate. The exact Hessian needs costates; an iterate without any first gets those that fit it.
double GnRti::linearise(Iterate& iterate) noexcept {
  if (hessian() == Hessian::exact && !has_costates(*ocp_, iterate)) {
    linearisation_->linearise(iterate, Hessian::gauss_newton);
    set_costates(linearisation_->qp(), iterate);
  }
  const double objective = linearisation_->linearise(iterate, hessian());
  qp_ = &linearisation_->qp();
  return objective;
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
      expected_limits_ = limit_costs(linearisation_->qp(), all_stages(*ocp_));
      expected_objective_ = report.objective;
    }
  }
  is_prepared_ = false;
  return report;
}

Report GnRti::real_time(Iterate& iterate, Clock::time_point deadline) noexcept {
  Report report;
  report.status = Status::step_taken;
  qp_solver_.set_cheap(true);
  bool is_ready = is_prepared_ && linearisation_->is_at(iterate);
  int steps = options_.iterations;
  for (int iteration = 0; iteration < steps; ++iteration) {
    if (iteration > 0 && is_past(deadline)) {
      report.status = Status::deadline;
      break;
    }
    if (!is_ready) linearisation_->prepare(iterate, hessian());
    linearisation_->refresh(iterate);
    qp_ = &linearisation_->qp();
    if (iteration == 0 && is_surprised()) {
      evades_ = true;
      steps = std::max(steps, evading_steps);
      linearisation_->prepare(iterate, hessian());
      linearisation_->refresh(iterate);
      qp_ = &linearisation_->qp();
      is_ready = false;
    }
    if (!is_ready) qp_solver_.guess_from(*qp_, iterate);
    is_ready = false;
    auto outcome = solve_qp(report, deadline);
    report.status = Status::step_taken;
    if (outcome == StageQpSolver::Outcome::infeasible && !limits_.empty()) {
      best_ = iterate;
      double before = 0.0, after = 0.0;
      outcome = solve_at_prices(report, before, after, deadline);
      report.status = Status::relaxed;
    }
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
    if (!limits_.empty()) clip_active_controls(step_);
    const bool is_last = iteration + 1 == steps;
    if (!is_last && !assess_step(step_, report)) {
      report.status = Status::stalled;
      break;
    }
    is_pending_ = is_last;
    std::swap(iterate, step_);
    ++report.iterations;
    if (!is_last && report.kkt.largest() <= options_.residual) break;
  }
  evades_ = false;
  if (report.iterations == 0) {
    give_up(iterate, report);
    return report;
  }
  if (report.status == Status::infeasible || report.status == Status::stalled) report.status = Status::iteration_limit;
  return report;
}

/// Whether limits are violated by the guess much more than they were at the end of the last sample: something has
/// appeared in its way.
bool GnRti::is_surprised() const noexcept {
  if (limits_.empty() || options_.hessian == Curvature::exact) return false;
  const StageQp& qp = linearisation_->qp();
  const LimitCosts now = limit_costs(qp, all_stages(*ocp_));
  const double slack = now.slack - expected_limits_.slack, violation = now.violation - expected_limits_.violation;
  if (!(slack > 0.0) && !(violation > 0.0)) return false;
  const double unit = 1.0 + largest_gradient(qp), more = slack + hard_price * unit * violation;
  return more > large_share * std::abs(expected_objective_) && more > large_push * unit;
}

/// Puts controls back that rounding has left beyond their active bounds. The guess of the next sample has them inside:
/// it would be another point, whose intervals had to be linearised once more.
void GnRti::clip_active_controls(Iterate& iterate) const noexcept {
  const int N = qp_->intervals();
  for (int i = 0; i < N; ++i) {
    const double* const multipliers = iterate.control_bound(i);
    for (int j = 0; j < qp_->controls(i); ++j) {
      if (multipliers[j] == 0.0) continue;
      double& value = iterate.control(i)[j];
      value = std::clamp(value, ocp_->control_lower(i)[j], ocp_->control_upper(i)[j]);
    }
  }
}

/// Linearises at a new iterate, as the next sample will need it; false if the result is not finite.
bool GnRti::assess_step(const Iterate& iterate, Report& report) noexcept {
  double objective = linearisation_->linearise_for_residual(iterate, hessian());
  const LimitCosts limits = limit_costs(linearisation_->qp(), all_stages(*ocp_));
  objective += limits.slack;
  const KktResidual kkt = kkt_residual(linearisation_->qp(), iterate);
  if (!std::isfinite(objective) || !std::isfinite(kkt.stationarity)) return false;
  report.objective = expected_objective_ = objective;
  report.kkt = kkt;
  expected_limits_ = limits;
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

StageQpSolver::Outcome GnRti::solve_qp(Report& report, Clock::time_point deadline) noexcept {
  const auto outcome = qp_solver_.solve(*qp_, step_, deadline);
  report.factorisations += qp_solver_.factorisations();
  report.fallback_used |= outcome == StageQpSolver::Outcome::interior_point;
  return outcome;
}

}  // namespace rhec::gn_rti

RHEC_PLUGIN(rhec::PluginKind::solver, rhec::gn_rti::GnRti,
            {.name = "gn_rti",
             .version = "0.1.0",
             .licence = "BSD-2-Clause",
             .source = "Sequential quadratic programming with a stage-wise Riccati recursion; real-time iteration of "
                       "Diehl et al. (2002)",
             .capabilities = "rhe, rhc, bounds on states, inputs and parameters, limits, real-time iteration"});
