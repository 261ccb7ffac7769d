#include "rhec/core/ocp/tracking_start.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "rhec/core/base/infinity.hpp"
#include "rhec/core/ocp/iterate_checks.hpp"

namespace rhec {
namespace {

// A start has to violate less than the first share of what the guess does, or to cost less than the second.
constexpr double clearly_less_violated = 0.5, clearly_cheaper = 0.5;
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

}  // namespace

void TrackingStart::setup(const Ocp& ocp) {
  const Capacity capacity = ocp.capacity();
  is_possible_ = std::max(capacity.states, capacity.controls) <= Riccati::max_width;
  if (!is_possible_) return;
  qp_ = StageQp(capacity);
  riccati_ = Riccati(capacity);
  no_bounds_ = ActiveSet(capacity);
  from_ = to_ = step_ = best_ = Iterate(capacity);
  limits_.assign((static_cast<std::size_t>(capacity.intervals) + 1) * capacity.limit_row(), 0.0);
}

TrackingStart::Quality TrackingStart::quality_of(const Ocp& ocp, const Iterate& iterate,
                                                 std::span<double> scratch) noexcept {
  Quality quality{total_violation(ocp, iterate), ocp.evaluate(iterate, nullptr, scratch)};
  if (limits_.empty()) return quality;
  ocp.evaluate_limits(iterate, limits_.data(), scratch);
  for (int i = 0; i <= ocp.intervals(); ++i) {
    const LimitCosts of_stage =
        limit_costs(ocp, i, limits_.data() + static_cast<std::ptrdiff_t>(i) * ocp.capacity().limit_row());
    quality.violation += of_stage.violation;
    quality.cost += of_stage.slack;
  }
  return quality;
}

/// The simulation with the regulator's policy.
void TrackingStart::follow(const Ocp& ocp, const Iterate& from, Iterate& to, std::span<double> scratch) noexcept {
  to = from;
  double deviation[Riccati::max_width], control[Riccati::max_width];
  for (int i = 0; i < ocp.intervals(); ++i) {
    for (int j = 0; j < ocp.state_count(i); ++j) deviation[j] = to.state(i)[j] - from.state(i)[j];
    riccati_.feedback(qp_, i, deviation, control);
    for (int j = 0; j < ocp.control_count(i); ++j)
      to.control(i)[j] =
          std::min(std::max(from.control(i)[j] + control[j], ocp.control_lower(i)[j]), ocp.control_upper(i)[j]);
    ocp.simulate_interval(i, to, scratch);
  }
}

bool TrackingStart::find(const Ocp& ocp, const Iterate& guess, Clock::time_point deadline, std::span<double> scratch,
                         Iterate& to) noexcept {
  if (!is_possible_ || !ocp.can_roll_out()) return false;
  const Quality given = quality_of(ocp, guess, scratch);
  from_ = guess;
  from_.clear_multipliers();
  ocp.linearise(all_stages(ocp), from_, Hessian::gauss_newton, qp_, scratch);
  move_to_least(qp_, from_);
  std::copy_n(ocp.initial_state(), ocp.state_count(0), from_.state(0));
  double least = infinity;
  for (int round = 0; round < most_regulators && !is_past(deadline); ++round) {
    ocp.linearise(all_stages(ocp), from_, Hessian::gauss_newton, qp_, scratch);
    riccati_.factor(qp_, no_bounds_);
    if (riccati_.solve(qp_, no_bounds_, step_) != Riccati::Outcome::done) break;
    follow(ocp, from_, to_, scratch);
    const double cost = ocp.evaluate(to_, nullptr, scratch);
    if (!(cost < enough_cheaper * least)) break;
    least = cost;
    best_ = from_ = to_;
  }
  if (!std::isfinite(least)) return false;
  const Quality found = quality_of(ocp, best_, scratch);
  const bool is_less_violated = !(found.violation >= clearly_less_violated * given.violation);
  const bool is_cheaper = found.violation <= given.violation && !(found.cost >= clearly_cheaper * given.cost);
  if (!std::isfinite(found.violation) || !std::isfinite(found.cost) || !(is_less_violated || is_cheaper)) return false;
  to = best_;
  return true;
}

}  // namespace rhec
