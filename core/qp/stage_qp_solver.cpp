#include "rhec/core/qp/stage_qp_solver.hpp"

#include <algorithm>
#include <cmath>

#include "rhec/core/base/assertion.hpp"
#include "rhec/core/qp/stage_checks.hpp"
#include "tolerances.hpp"

namespace rhec {
namespace {

constexpr int claimed_rounds = 1;  // tries of the warm-started set if the QP is not convex
constexpr int warm_rounds = 8;     // corrections of the active set before the interior-point method
constexpr int polish_rounds = 6;   // the same, from the interior-point method's active set
constexpr int few_states = 2;
constexpr int max_interior_iterations = 60;
// The interior-point method stops well before rounding spoils its Newton systems; polishing does the rest.
constexpr StageQpSolver::Accuracy ready_to_polish{1e-8, 1e-7};
// If polishing does not settle, the interior-point method itself must be accurate.
constexpr StageQpSolver::Accuracy on_its_own{1e-12, 1e-10};
constexpr double divergence = 1e10;

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
  bounded_.reserve(nodes * (capacity.states + capacity.controls));
  for (auto* v : {&diagonal_, &h_}) v->assign(nodes * capacity.row(), 0.0);
}

void StageQpSolver::reset() noexcept {
  active_.clear();
  factored_ = prepared_ = false;
  factorisations_ = 0;
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
}

void StageQpSolver::factor(const StageQp& qp) noexcept {
  riccati_.factor(qp, active_);
  factored_ = true;
  ++factorisations_;
}

/// Few active state bounds in estimation: these usually persist from sample to sample and are cheap inside the
/// factorisation. In control they move with the horizon, so that most samples need their sensitivities.
bool StageQpSolver::claim_is_likely(const StageQp& qp) const noexcept {
  if (!any_active_ || qp.initial_state_is_given) return false;
  int states = 0;
  for (int i = 0; i <= qp.intervals(); ++i)
    for (int j = 0; j < qp.states(i); ++j) states += active_.state(i)[j] != 0;
  return states > 0 && states <= few_states;
}

void StageQpSolver::prepare(const StageQp& qp) noexcept {
  if (claim_is_likely(qp)) {
    factor(qp);
  } else {
    prepare_changes(qp);
  }
}

void StageQpSolver::prepare_changes(const StageQp& qp) noexcept {
  dual_.prepare(qp, riccati_, any_active_ ? &active_ : nullptr);
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
  is_dual_ = is_convexified_ = false;
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

DualActiveSet::Outcome StageQpSolver::solve_from_guess(const StageQp& qp, Iterate& step,
                                                       Clock::time_point deadline) noexcept {
  if (!prepared_) prepare_changes(qp);
  prepared_ = false;
  const auto outcome = dual_.solve(qp, riccati_, active_, step, deadline);
  is_dual_ = outcome == DualActiveSet::Outcome::solved;
  factorisations_ += dual_.factorisations();
  return outcome;
}

StageQpSolver::Outcome StageQpSolver::solve_by_interior_point(const StageQp& qp, Iterate& step,
                                                              Clock::time_point deadline) noexcept {
  is_dual_ = is_convexified_ = false;
  return solve_robustly(qp, step, deadline);
}

StageQpSolver::Outcome StageQpSolver::solve_robustly(const StageQp& given, Iterate& step,
                                                     Clock::time_point deadline) noexcept {
  // From here on the QP is fixed and convex.
  const StageQp& qp = convexify(given);
  if (!interior_point(qp, step, ready_to_polish, deadline)) {
    active_.clear();
    factored_ = false;
    return out_of_time_ ? Outcome::out_of_time : Outcome::infeasible;
  }
  // The active set of the interior-point method, kept only if it leads to the exact solution.
  active_.clear();
  any_active_ = true;
  for (const Bounded& v : bounded_) {
    std::int8_t& side = v.is_state ? active_.state(v.stage)[v.component] : active_.control(v.stage)[v.component];
    const bool at_lower = std::isfinite(v.lower) && v.below.multiplier > gradient_scale_ * v.below.slack;
    const bool at_upper = std::isfinite(v.upper) && v.above.multiplier > gradient_scale_ * v.above.slack;
    side = at_lower && (!at_upper || v.below.multiplier > v.above.multiplier) ? std::int8_t{-1}
           : at_upper                                                         ? std::int8_t{1}
                                                                              : std::int8_t{0};
  }
  factored_ = false;
  if (try_active_sets(qp, step, polish_rounds, deadline)) return Outcome::interior_point;
  // Polishing has overwritten the step. If rounding prevents the higher accuracy, repeat the first run.
  factored_ = false;
  if (!out_of_time_ && !interior_point(qp, step, on_its_own, deadline) && !out_of_time_)
    interior_point(qp, step, ready_to_polish, deadline);
  return out_of_time_ ? Outcome::out_of_time : Outcome::interior_point;
}

const StageQp& StageQpSolver::convexify(const StageQp& qp) noexcept {
  const StageQp& now = solved(qp);
  riccati_.factor(now, no_bounds_);
  ++factorisations_;
  if (!riccati_.was_convexified()) return now;
  if (!is_convexified_) convexified_ = qp;
  riccati_.write_convexified(convexified_);
  is_convexified_ = was_convexified_ = true;
  return convexified_;
}

bool StageQpSolver::covariances(const StageQp& qp, double* all, double* last) noexcept {
  riccati_.factor_for_covariances(qp, no_bounds_);
  factored_ = prepared_ = is_dual_ = false;
  if (riccati_.was_convexified()) return false;
  riccati_.covariances(qp, all, last);
  return true;
}

void StageQpSolver::collect_bounded(const StageQp& qp) noexcept {
  bounded_.clear();
  const auto add = [&](bool is_state, int stage, int component, double lower, double upper) {
    if (!std::isfinite(lower) && !std::isfinite(upper)) return;
    Bounded v;
    v.is_state = is_state;
    v.stage = stage;
    v.component = component;
    v.lower = lower;
    v.upper = upper;
    bounded_.push_back(v);
  };
  for (int i = 0; i <= qp.intervals(); ++i) {
    if (i > 0 || !qp.initial_state_is_given)
      for (int j = 0; j < qp.states(i); ++j) add(true, i, j, qp.state_lower(i)[j], qp.state_upper(i)[j]);
    for (int j = 0; j < qp.controls(i); ++j) add(false, i, j, qp.control_lower(i)[j], qp.control_upper(i)[j]);
  }
}

/// Barrier Hessian and gradient of the Newton system for complementarity `target`, in terms of the new values.
void StageQpSolver::barrier_terms(const StageQp& qp, double target) noexcept {
  const std::ptrdiff_t entries = static_cast<std::ptrdiff_t>(qp.intervals() + 1) * qp.stride();
  std::fill_n(diagonal_.data(), entries, 0.0);
  std::copy_n(qp.h(0), entries, h_.data());
  for (const Bounded& v : bounded_) {
    const std::ptrdiff_t entry =
        static_cast<std::ptrdiff_t>(v.stage) * qp.stride() + v.component + (v.is_state ? 0 : capacity_.states);
    double &diagonal = diagonal_[entry], &gradient = h_[entry];
    if (std::isfinite(v.lower)) {
      const Side& s = v.below;
      const double weight = s.multiplier / s.slack;
      diagonal += weight;
      gradient -= (target - s.correction) / s.slack + weight * (v.lower + s.slack);
    }
    if (std::isfinite(v.upper)) {
      const Side& s = v.above;
      const double weight = s.multiplier / s.slack;
      diagonal += weight;
      gradient += (target - s.correction) / s.slack - weight * (v.upper - s.slack);
    }
  }
}

bool StageQpSolver::interior_point(const StageQp& qp, Iterate& step, const Accuracy& wanted,
                                   Clock::time_point deadline) noexcept {
  collect_bounded(qp);
  double scale = 1.0;
  for (int i = 0; i <= qp.intervals(); ++i) {
    for (int j = 0; j < qp.states(i); ++j) scale = std::max(scale, std::abs(qp.q(i)[j]));
    for (int j = 0; j < qp.controls(i); ++j) scale = std::max(scale, std::abs(qp.r(i)[j]));
  }
  gradient_scale_ = scale;
  int sides = 0;
  for (Bounded& v : bounded_) {
    const double range = std::min(v.upper - v.lower, 2.0);
    v.value = std::min(std::max(0.0, v.lower), v.upper);
    const auto start = [&](Side& side, double distance) {
      side = {};
      side.slack = std::max({distance, 0.1 * range, 1e-3});
      side.multiplier = 0.1 * scale / std::max(1.0, side.slack);
      ++sides;
    };
    if (std::isfinite(v.lower)) start(v.below, v.value - v.lower);
    if (std::isfinite(v.upper)) start(v.above, v.upper - v.value);
  }
  if (sides == 0) return try_active_sets(qp, step, 1, deadline);
  active_.clear();

  const auto value_in = [](const Iterate& trial, const Bounded& v) {
    return v.is_state ? trial.state(v.stage)[v.component] : trial.control(v.stage)[v.component];
  };
  // Newton directions for both sides of every bounded variable, given the new values.
  const auto directions = [&](double target) {
    for (Bounded& v : bounded_) {
      const double value = value_in(step, v);
      const auto side_step = [&](Side& s, double new_slack) {
        s.slack_step = new_slack - s.slack;
        s.multiplier_step = (target - s.correction - s.multiplier * s.slack_step) / s.slack - s.multiplier;
      };
      if (std::isfinite(v.lower)) side_step(v.below, value - v.lower);
      if (std::isfinite(v.upper)) side_step(v.above, v.upper - value);
    }
  };
  const auto each_side = [&](const auto& function) {
    for (Bounded& v : bounded_) {
      if (std::isfinite(v.lower)) function(v, v.below);
      if (std::isfinite(v.upper)) function(v, v.above);
    }
  };
  const auto longest_step = [&] {
    double length = 1.0;
    each_side([&](const Bounded&, const Side& s) {
      if (s.slack_step < 0.0) length = std::min(length, -s.slack / s.slack_step);
      if (s.multiplier_step < 0.0) length = std::min(length, -s.multiplier / s.multiplier_step);
    });
    return length;
  };
  const auto mean_complementarity = [&](double length) {
    double sum = 0.0;
    each_side([&](const Bounded&, const Side& s) {
      sum += (s.slack + length * s.slack_step) * (s.multiplier + length * s.multiplier_step);
    });
    return sum / sides;
  };

  for (int iteration = 0; iteration < max_interior_iterations; ++iteration) {
    out_of_time_ = is_past(deadline);
    if (out_of_time_) return false;
    each_side([](const Bounded&, Side& s) { s.slack_step = s.multiplier_step = s.correction = 0.0; });
    const double complementarity = mean_complementarity(0.0);
    barrier_terms(qp, 0.0);
    riccati_.factor(qp, active_, diagonal_.data());
    ++factorisations_;
    if (riccati_.solve(qp, active_, step, h_.data()) != Riccati::Outcome::done) return false;
    directions(0.0);
    const double affine = longest_step();
    const double ratio = mean_complementarity(affine) / complementarity;
    const double target = std::max(ratio * ratio * ratio * complementarity, 1e-3 * wanted.gap * scale);
    each_side([](const Bounded&, Side& s) { s.correction = s.slack_step * s.multiplier_step; });
    barrier_terms(qp, target);
    if (riccati_.solve(qp, active_, step, h_.data()) != Riccati::Outcome::done) return false;
    directions(target);
    const double length = std::min(1.0, 0.995 * longest_step());
    if (!std::isfinite(length) || !std::isfinite(target)) return false;
    double infeasibility = 0.0;
    each_side([&](const Bounded& v, Side& s) {
      s.slack += length * s.slack_step;
      s.multiplier += length * s.multiplier_step;
      const bool is_lower = &s == &v.below;
      const double value = value_in(step, v);
      infeasibility = std::max(infeasibility, std::abs((is_lower ? value - v.lower : v.upper - value) - s.slack));
    });
    double gap = 0.0, largest_multiplier = 0.0;
    each_side([&](const Bounded&, const Side& s) {
      gap = std::max(gap, s.slack * s.multiplier);
      largest_multiplier = std::max(largest_multiplier, s.multiplier);
    });
    // Multipliers that grow without limit certify that bounds contradict each other.
    if (largest_multiplier > divergence * scale) return false;
    if (gap < wanted.gap * scale && infeasibility < wanted.infeasibility) {
      for (int i = 0; i <= qp.intervals(); ++i) {
        std::fill_n(step.state_bound(i), qp.states(i), 0.0);
        if (i < qp.intervals()) std::fill_n(step.control_bound(i), qp.controls(i), 0.0);
      }
      for (const Bounded& v : bounded_) {
        double& multiplier =
            v.is_state ? step.state_bound(v.stage)[v.component] : step.control_bound(v.stage)[v.component];
        multiplier =
            (std::isfinite(v.upper) ? v.above.multiplier : 0.0) - (std::isfinite(v.lower) ? v.below.multiplier : 0.0);
      }
      return true;
    }
  }
  return false;
}

}  // namespace rhec
