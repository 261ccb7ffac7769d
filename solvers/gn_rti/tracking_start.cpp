// Mode `converge`: a start for unstable dynamics, whose simulation with the guess' controls alone may lead far away.
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

#include "gn_rti.hpp"
#include "rhec/core/ocp/iterate_checks.hpp"

namespace rhec::gn_rti {
namespace {

// A start has to violate less than the first share of what the guess does, or to cost less than the second.
constexpr double clearly_less_violated = 0.5, clearly_cheaper = 1e-2;
// So many regulators in a row, each about where the one before led to, while that costs less than this share.
constexpr int most_regulators = 5;
constexpr double enough_cheaper = 0.9;

/// Where each stage's own objective is least, by its diagonal, within bounds.
void move_to_least(const StageQp& qp, Iterate& iterate) noexcept {
  const int states = qp.capacity().states;
  for (int i = 0; i <= qp.intervals(); ++i)
    for (int j = 0; j < states + qp.controls(i); ++j) {
      if (j >= qp.states(i) && j < states) continue;
      const double curvature = qp.H(i)[static_cast<std::ptrdiff_t>(j) * qp.stride() + j];
      const double step = curvature > 0.0 ? -qp.h(i)[j] / curvature : 0.0;
      iterate.row(i)[j] += std::min(std::max(step, qp.lower(i)[j]), qp.upper(i)[j]);
    }
}

void drop_limits(StageQp& qp) noexcept {
  constexpr double none = std::numeric_limits<double>::infinity();
  for (int i = 0; i <= qp.intervals(); ++i) {
    std::fill_n(qp.state_lower(i), qp.states(i), -none);
    std::fill_n(qp.state_upper(i), qp.states(i), none);
    if (!qp.has_limits()) continue;
    std::fill_n(qp.limit_lower(i), qp.limits(i), -none);
    std::fill_n(qp.limit_upper(i), qp.limits(i), none);
  }
}

}  // namespace

/// Sum by which bounds and hard limits are violated, and what is paid for the rest.
GnRti::StartQuality GnRti::quality_of(const Iterate& iterate) noexcept {
  StartQuality quality{total_violation(*ocp_, iterate), ocp_->evaluate(iterate, nullptr, scratch_)};
  if (limits_.empty()) return quality;
  const LimitCosts limits = costs_of_limits(iterate);
  quality.violation += limits.violation;
  quality.cost += limits.slack;
  return quality;
}

/// Writes a trajectory without defects that follows, by feedback, the states at which the objective of each stage is
/// least, to `tracking_`: a linear-quadratic regulator about them, and then about what it leads to, without limits and
/// bounds of states (Anderson & Moore 1990, chapter 4). False if it is not clearly better than the guess.
bool GnRti::find_tracking_start(const Iterate& guess, Report& report, Clock::time_point deadline) noexcept {
  if (!ocp_->can_roll_out()) return false;
  const StartQuality given = quality_of(guess);
  other_trial_ = guess;
  other_trial_.clear_multipliers();
  linearisation_->linearise(other_trial_, Hessian::gauss_newton);
  move_to_least(linearisation_->qp(), other_trial_);
  if (ocp_->initial_state()) std::copy_n(ocp_->initial_state(), ocp_->state_count(0), other_trial_.state(0));
  double least = std::numeric_limits<double>::infinity();
  for (int round = 0; round < most_regulators && !is_past(deadline); ++round) {
    linearisation_->linearise(other_trial_, Hessian::gauss_newton);
    relaxed_qp_ = linearisation_->qp();
    drop_limits(relaxed_qp_);
    qp_ = &relaxed_qp_;
    qp_solver_.guess_from(*qp_, other_trial_);
    const auto outcome = solve_qp(report, deadline);
    if (outcome == StageQpSolver::Outcome::infeasible || outcome == StageQpSolver::Outcome::out_of_time) break;
    roll_out_step(other_trial_, 1.0, trial_);
    const double cost = ocp_->evaluate(trial_, nullptr, scratch_);
    if (!(cost < enough_cheaper * least)) break;
    least = cost;
    trial_.clear_multipliers();
    tracking_ = other_trial_ = trial_;
  }
  if (!std::isfinite(least)) return false;
  const StartQuality found = quality_of(tracking_);
  return std::isfinite(found.violation) && std::isfinite(found.cost) &&
         (!(found.violation >= clearly_less_violated * given.violation) ||
          (found.violation <= given.violation && !(found.cost >= clearly_cheaper * given.cost)));
}

}  // namespace rhec::gn_rti
