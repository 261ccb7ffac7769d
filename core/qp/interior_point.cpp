// The primal-dual interior-point method of the stage-QP solver (Mehrotra's predictor and corrector). A limit adds its
// barrier terms to the QP's matrices; the slack of a soft one is eliminated from them.
#include <algorithm>
#include <cmath>

#include "limit_checks.hpp"
#include "rhec/core/base/infinity.hpp"
#include "rhec/core/qp/stage_qp_solver.hpp"

namespace rhec {
namespace {

constexpr int max_interior_iterations = 60;
constexpr double divergence = 1e10;

}  // namespace

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
    for (int r = 0; qp.has_limits() && r < qp.limits(i); ++r) {
      const std::size_t before = bounded_.size();
      add(false, i, r, qp.limit_lower(i)[r], qp.limit_upper(i)[r]);
      if (bounded_.size() == before) continue;
      Bounded& v = bounded_.back();
      v.row = qp.G(i) + static_cast<std::ptrdiff_t>(r) * qp.stride();
      v.linear = qp.limit_linear(i)[r];
      v.quadratic = qp.limit_quadratic(i)[r];
      v.is_soft = v.linear < infinity;
    }
  }
}

double StageQpSolver::value_of(const Bounded& v, const Iterate& step) const noexcept {
  if (!v.row) return v.is_state ? step.state(v.stage)[v.component] : step.control(v.stage)[v.component];
  double value = 0.0;
  const double* z = step.row(v.stage);
  for (int j = 0; j < capacity_.row(); ++j) value += v.row[j] * z[j];
  return value;
}

/// For a hard side, multiplier+ = (target - correction) / slack - weight (slack+ - slack) with slack+ = distance+. A
/// soft one has slack+ = distance+ + excess+, and excess+ follows from its own complementarity and rest = linear +
/// quadratic excess - multiplier.
StageQpSolver::Barrier StageQpSolver::barrier_of(const Bounded& v, const Side& s, double target) noexcept {
  const double weight = s.multiplier / s.slack, pull = (target - s.correction) / s.slack + s.multiplier;
  if (!v.is_soft) return {weight, pull};
  const double of_excess = s.rest / s.excess, start = (target - s.excess_correction) / s.excess + s.rest;
  const double sum = of_excess + v.quadratic + weight;
  return {weight * (of_excess + v.quadratic) / sum, pull - weight * (start + pull - v.linear) / sum};
}

/// The Newton step of a side for a new distance of the value from the bound.
void StageQpSolver::set_steps(const Bounded& v, Side& s, double distance, double target) const noexcept {
  double new_slack = distance;
  if (v.is_soft) {
    const double weight = s.multiplier / s.slack, pull = (target - s.correction) / s.slack + s.multiplier;
    const double of_excess = s.rest / s.excess, start = (target - s.excess_correction) / s.excess + s.rest;
    const double new_excess = (start + pull - v.linear - weight * distance) / (of_excess + v.quadratic + weight);
    s.excess_step = new_excess - s.excess;
    s.rest_step = start - of_excess * new_excess - s.rest;
    new_slack += new_excess;
  }
  s.slack_step = new_slack - s.slack;
  s.multiplier_step = (target - s.correction - s.multiplier * s.slack_step) / s.slack - s.multiplier;
}

/// Barrier Hessian and gradient of the Newton system for complementarity `target`, in terms of the new values.
void StageQpSolver::barrier_terms(const StageQp& qp, double target) noexcept {
  const std::ptrdiff_t entries = static_cast<std::ptrdiff_t>(qp.intervals() + 1) * qp.stride();
  std::fill_n(diagonal_.data(), entries, 0.0);
  std::copy_n(qp.h(0), entries, h_.data());
  if (qp.has_limits())
    for (int i = 0; i <= qp.intervals(); ++i)
      std::copy_n(qp.H(i), (capacity_.states + qp.controls(i)) * qp.stride(), barrier_.H(i));
  for (const Bounded& v : bounded_) {
    if (v.row) {
      double weight = 0.0, gradient = 0.0;
      if (std::isfinite(v.lower)) {
        const Barrier below = barrier_of(v, v.below, target);
        weight += below.weight;
        gradient -= below.pull + below.weight * v.lower;
      }
      if (std::isfinite(v.upper)) {
        const Barrier above = barrier_of(v, v.above, target);
        weight += above.weight;
        gradient += above.pull - above.weight * v.upper;
      }
      add_row(v.row, weight, gradient, qp.stride(), barrier_.H(v.stage),
              h_.data() + static_cast<std::ptrdiff_t>(v.stage) * qp.stride());
      continue;
    }
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
      if (!v.is_soft) return;
      // Between zero and the end of the multiplier's range.
      side.excess = std::max(0.1, -distance);
      side.slack = std::max(distance + side.excess, 1e-3);
      side.multiplier = std::min(side.multiplier, 0.5 * (v.linear + v.quadratic * side.excess));
      side.rest = v.linear + v.quadratic * side.excess - side.multiplier;
      ++sides;
    };
    if (std::isfinite(v.lower)) start(v.below, v.value - v.lower);
    if (std::isfinite(v.upper)) start(v.above, v.upper - v.value);
  }
  if (sides == 0) return try_active_sets(qp, step, 1, deadline);
  active_.clear();

  const auto value_in = [this](const Iterate& trial, const Bounded& v) { return value_of(v, trial); };
  const StageQp& newton = qp.has_limits() ? barrier_ : qp;
  if (qp.has_limits()) barrier_ = qp;
  // Newton directions for both sides of every bounded variable, given the new values.
  const auto directions = [&](double target) {
    for (Bounded& v : bounded_) {
      const double value = value_in(step, v);
      const auto side_step = [&](Side& s, double distance) { set_steps(v, s, distance, target); };
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
    each_side([&](const Bounded& v, const Side& s) {
      if (s.slack_step < 0.0) length = std::min(length, -s.slack / s.slack_step);
      if (s.multiplier_step < 0.0) length = std::min(length, -s.multiplier / s.multiplier_step);
      if (!v.is_soft) return;
      if (s.excess_step < 0.0) length = std::min(length, -s.excess / s.excess_step);
      if (s.rest_step < 0.0) length = std::min(length, -s.rest / s.rest_step);
    });
    return length;
  };
  const auto mean_complementarity = [&](double length) {
    double sum = 0.0;
    each_side([&](const Bounded& v, const Side& s) {
      sum += (s.slack + length * s.slack_step) * (s.multiplier + length * s.multiplier_step);
      if (v.is_soft) sum += (s.excess + length * s.excess_step) * (s.rest + length * s.rest_step);
    });
    return sum / sides;
  };

  for (int iteration = 0; iteration < max_interior_iterations; ++iteration) {
    out_of_time_ = is_past(deadline);
    if (out_of_time_) return false;
    each_side([](const Bounded&, Side& s) {
      s.slack_step = s.multiplier_step = s.correction = 0.0;
      s.excess_step = s.rest_step = s.excess_correction = 0.0;
    });
    const double complementarity = mean_complementarity(0.0);
    barrier_terms(qp, 0.0);
    riccati_.factor(newton, active_, diagonal_.data());
    ++factorisations_;
    if (riccati_.solve(newton, active_, step, h_.data()) != Riccati::Outcome::done) return false;
    directions(0.0);
    const double affine = longest_step();
    const double ratio = mean_complementarity(affine) / complementarity;
    const double target = std::max(ratio * ratio * ratio * complementarity, 1e-3 * wanted.gap * scale);
    each_side([](const Bounded&, Side& s) {
      s.correction = s.slack_step * s.multiplier_step;
      s.excess_correction = s.excess_step * s.rest_step;
    });
    barrier_terms(qp, target);
    if (riccati_.solve(newton, active_, step, h_.data()) != Riccati::Outcome::done) return false;
    directions(target);
    const double length = std::min(1.0, 0.995 * longest_step());
    if (!std::isfinite(length) || !std::isfinite(target)) return false;
    double infeasibility = 0.0;
    each_side([&](const Bounded& v, Side& s) {
      s.slack += length * s.slack_step;
      s.multiplier += length * s.multiplier_step;
      if (v.is_soft) {
        s.excess += length * s.excess_step;
        s.rest += length * s.rest_step;
      }
      const bool is_lower = &s == &v.below;
      const double value = value_in(step, v);
      infeasibility =
          std::max(infeasibility, std::abs((is_lower ? value - v.lower : v.upper - value) + s.excess - s.slack));
    });
    double gap = 0.0, largest_multiplier = 0.0;
    each_side([&](const Bounded&, const Side& s) {
      gap = std::max({gap, s.slack * s.multiplier, s.excess * s.rest});
      largest_multiplier = std::max(largest_multiplier, s.multiplier);
    });
    // Multipliers that grow without limit certify that bounds contradict each other.
    if (largest_multiplier > divergence * scale) return false;
    if (gap < wanted.gap * scale && infeasibility < wanted.infeasibility) {
      for (int i = 0; i <= qp.intervals(); ++i) {
        std::fill_n(step.state_bound(i), qp.states(i), 0.0);
        if (i < qp.intervals()) std::fill_n(step.control_bound(i), qp.controls(i), 0.0);
        if (qp.has_limits()) std::fill_n(step.limit_bound(i), capacity_.limit_row(), 0.0);
      }
      for (const Bounded& v : bounded_) {
        double& multiplier = v.row        ? step.limit_bound(v.stage)[v.component]
                             : v.is_state ? step.state_bound(v.stage)[v.component]
                                          : step.control_bound(v.stage)[v.component];
        multiplier =
            (std::isfinite(v.upper) ? v.above.multiplier : 0.0) - (std::isfinite(v.lower) ? v.below.multiplier : 0.0);
      }
      return true;
    }
  }
  return false;
}

}  // namespace rhec
