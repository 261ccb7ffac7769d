// Mode `converge` where hard limits resist: from here on their violation has a price in the QPs and in the merit
// function alike (Fletcher 1987, Sl1QP), and steps are damped where the linearisation holds for short ones alone.
#include <algorithm>
#include <cmath>
#include <cstddef>

#include "gn_rti.hpp"
#include "rhec/core/ocp/iterate_checks.hpp"
#include "step_costs.hpp"

namespace rhec::gn_rti {
namespace {

// Prices relative to the gradient.
constexpr double low_price = 1e-1, high_price = 1e2, dearer = 1e1, dearest_price = 1e7;
// The price rises where a step leaves more than the first share of the violation and a higher price removes more of
// what is left than the second one does not.
constexpr double enough_left = 0.5, less = 0.9;
// Damping relative to the curvature, and its range.
constexpr double first_damping = 1e-3, stronger = 10.0, weaker = 0.2, strongest_damping = 1e9;
// With more it is no longer what makes a QP convex.
constexpr double most_to_be_convex = 1.0;
// Entries of the Hessian that are smaller than this share of the largest are damped as if they were not.
constexpr double least_curvature = 1e-6;
// The problem at a price is solved where a step promises less than this share of the merit.
constexpr double settled = 1e-7;
// So many tenfold prices that remove nothing are enough.
constexpr int most_futile_prices = 4;
// Below this length a step along a line is not as good as a damped one.
constexpr double shortest_undamped = 0.2;
// A violation that is not halved in so many iterations is stuck.
constexpr int most_iterations_to_halve = 12;
constexpr double half = 0.5, small_violation = 1e-3;

bool is_step(StageQpSolver::Outcome outcome) noexcept {
  return outcome != StageQpSolver::Outcome::infeasible && outcome != StageQpSolver::Outcome::out_of_time;
}

/// Adds a share of the curvature to the diagonal.
void damp(StageQp& qp, double damping) noexcept {
  const int states = qp.capacity().states;
  const auto used = [&](int i, int j) { return j < qp.states(i) || (j >= states && j < states + qp.controls(i)); };
  const auto entry = [&](int i, int j) -> double& { return qp.H(i)[static_cast<std::ptrdiff_t>(j) * qp.stride() + j]; };
  double largest = 0.0;
  for (int i = 0; i <= qp.intervals(); ++i)
    for (int j = 0; j < qp.stride(); ++j)
      if (used(i, j)) largest = std::max(largest, std::abs(entry(i, j)));
  for (int i = 0; i <= qp.intervals(); ++i)
    for (int j = 0; j < qp.stride(); ++j)
      if (used(i, j)) entry(i, j) += damping * std::max(std::abs(entry(i, j)), least_curvature * largest);
}

}  // namespace

/// Whether the hard limits are violated as before for many iterations.
bool GnRti::is_violation_stuck(int iterations) noexcept {
  const double violation = costs_of_limits(best_).violation;
  if (iterations == 0) first_violation_ = violation;
  if (iterations == 0 || violation < half * least_violation_) {
    least_violation_ = violation;
    least_violation_at_ = iterations;
  }
  return !is_nearly_feasible() && iterations - least_violation_at_ >= most_iterations_to_halve;
}

bool GnRti::is_nearly_feasible() noexcept {
  return costs_of_limits(best_).violation <=
         std::max(std::sqrt(options_.tolerance), small_violation * first_violation_);
}

/// Begins again at the guess: steps that went astray may have led far away.
void GnRti::begin_priced_at(const Iterate& guess, Clock::time_point deadline) noexcept {
  if (attempts_ == 0)
    has_tracking_start_ = !limits_.empty() && tracking_.find(*ocp_, guess, deadline, scratch_, tracking_start_);
  best_ = has_tracking_start_ ? tracking_start_ : guess;
  if (has_tracking_start_) first_violation_ = costs_of_limits(best_).violation;
  if (ocp_->initial_state()) std::copy_n(ocp_->initial_state(), ocp_->state_count(0), best_.state(0));
  begin_priced(0.0);
  first_price_ = attempts_++ == 0 ? low_price : high_price;
}

/// Goes on where it is, with steps at a price.
void GnRti::begin_priced(double price) noexcept {
  is_priced_ = is_elastic_ = true;
  asked_share_ = 1.0;
  price_ = price;
  damping_ = defect_penalty_ = bound_penalty_ = 0.0;
  futile_ = futile_prices_ = 0;
}

void GnRti::set_price(double price) noexcept {
  price_ = price;
  relaxed_qp_ = linearisation_->qp();
  for (int i = 0; i <= relaxed_qp_.intervals(); ++i)
    for (int r = 0; r < relaxed_qp_.limits(i); ++r)
      if (!std::isfinite(relaxed_qp_.limit_linear(i)[r])) relaxed_qp_.limit_linear(i)[r] = price;
  if (damping_ > 0.0) damp(relaxed_qp_, damping_);
  qp_ = &relaxed_qp_;
}

/// Solves the QP at the present price, or at a higher one where that removes more of the violation. A damped step says
/// little of that.
StageQpSolver::Outcome GnRti::solve_priced(Report& report, Clock::time_point deadline) noexcept {
  const StageQp& given = linearisation_->qp();
  const double unit = 1.0 + largest_gradient(given), before = costs_of_limits(best_).violation;
  report.fallback_used = true;
  const auto solve_at = [&](double price) {
    set_price(price);
    qp_solver_.guess_from(*qp_, best_);
    return solve_qp(report, deadline);
  };
  price_ = std::max(price_, first_price_ * unit);
  const double now = price_;
  const auto outcome = solve_at(now);
  if (damping_ > 0.0 || before <= options_.tolerance || now > dearest_price * unit || !is_step(outcome)) return outcome;
  const double after = violation_after(given, step_);
  if (after <= enough_left * before) return outcome;
  const auto dear = solve_at(dearer * now);
  // Where the lower price does as much, it is kept.
  return is_step(dear) && violation_after(given, step_) <= less * after ? dear : solve_at(now);
}

/// Where the problem at this price is solved and violates limits, the price was too low. False where higher ones have
/// not removed any of the violation: its sum has a local minimum here.
bool GnRti::raise_price(double merit_after) noexcept {
  if (-slope_ > settled * (1.0 + std::abs(merit_after))) return true;
  const double violation = costs_of_limits(trial_).violation;
  if (violation <= options_.tolerance) return true;
  price_ *= dearer;
  if (futile_prices_ == 0 || violation < less * settled_violation_) {
    settled_violation_ = violation;
    futile_prices_ = 0;
  }
  return ++futile_prices_ <= most_futile_prices;
}

/// A step from `best_` to `trial_`, damped until the merit function accepts it; false if none is acceptable.
bool GnRti::take_priced_step(Report& report, double residual, double& merit_after, Clock::time_point deadline,
                             bool& feasible, bool& late) noexcept {
  // Without limits a line search may go on: damping does not shorten what removes defects.
  shortest_length_ = limits_.empty() ? 0.0 : shortest_undamped;
  bool accepted = false;
  while (!accepted && !late) {
    const auto outcome = relax_until_feasible(solve_priced(report, deadline), report, deadline);
    late = outcome == StageQpSolver::Outcome::out_of_time;
    // What is reflected to make a QP convex is a poor guess; a little damping may do.
    if (is_step(outcome) && qp_solver_.was_convexified() && damping_ < most_to_be_convex && is_nearly_feasible()) {
      damping_ = std::max(stronger * damping_, first_damping);
      late = is_past(deadline);
      continue;
    }
    if (!late && outcome != StageQpSolver::Outcome::infeasible && is_finite(*ocp_, step_)) {
      feasible = true;
      accepted = search_along_step(report, residual, merit_after, deadline);
    }
    if (accepted || damping_ > strongest_damping) break;
    damping_ = std::max(stronger * damping_, first_damping);
    late = late || is_past(deadline);
  }
  if (accepted && step_length_ == 1.0) damping_ = damping_ > first_damping ? weaker * damping_ : 0.0;
  if (accepted && step_length_ < shortest_undamped) damping_ = std::max(stronger * damping_, first_damping);
  shortest_length_ = 0.0;
  return accepted;
}

}  // namespace rhec::gn_rti
