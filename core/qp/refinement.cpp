// Refinement of the solution of a stage QP with limits by augmented Lagrangians.
#include <algorithm>
#include <cmath>
#include <cstddef>

#include "limit_checks.hpp"
#include "rhec/core/base/infinity.hpp"
#include "rhec/core/qp/kkt.hpp"
#include "rhec/core/qp/stage_qp_solver.hpp"

namespace rhec {
namespace {

constexpr int most_refinements = 20, most_futile_refinements = 3;
constexpr double enough_less = 0.5;
// Weights of rows relative to the curvature along them: they rise where a round leaves more than a share of the
// violation.
constexpr double first_weight = 1e4, heavier = 10.0, heaviest = 1e8;
constexpr double violation_left = 0.1;
// Entries of a Hessian's diagonal that are smaller than this share of the largest of its stage count as this share.
constexpr double least_share = 1e-10;

/// What a row adds to the gradient, in units of the row, and to the curvature along it.
struct Pull {
  double multiplier = 0.0, weight = 0.0;
};

struct Slack {
  double linear = infinity, quadratic = 0.0;  ///< of a hard row
};

/// Of a row with a multiplier and the distances of its sides from its value: the side that it is at, -1 or +1, or
/// beyond, -2 or +2, where a soft one gives way; 0 between.
int side_of(double multiplier, double lower, double upper, double weight, const Slack& slack) noexcept {
  if (const double above = multiplier - weight * upper; above > 0.0) return above > slack.linear ? 2 : 1;
  if (const double below = multiplier - weight * lower; below < 0.0) return -below > slack.linear ? -2 : -1;
  return 0;
}

/// Of a row at a side. The slack of a soft one is that which costs least.
Pull pull_of(int side, double multiplier, double lower, double upper, double weight, const Slack& slack) noexcept {
  if (side == 0) return {};
  const double sign = side > 0 ? 1.0 : -1.0;
  const double along = sign * (multiplier - weight * (side > 0 ? upper : lower));
  if (std::abs(side) == 1) return {sign * along, weight};
  const double sum = slack.quadratic + weight;
  return {sign * (slack.quadratic * along + weight * slack.linear) / sum, weight * slack.quadratic / sum};
}

double multiplier_after(double multiplier, double lower, double upper, double weight, const Slack& slack) noexcept {
  return pull_of(side_of(multiplier, lower, upper, weight, slack), multiplier, lower, upper, weight, slack).multiplier;
}

/// Visits all bounds and limits with their weights: of_bound(stage, place in the row, weight), of_limit(stage, r,
/// weight).
template <class OfBound, class OfLimit>
void for_each_row(const StageQp& qp, double relative_weight, const OfBound& of_bound, const OfLimit& of_limit) {
  const int states = qp.capacity().states, stride = qp.stride();
  for (int i = 0; i <= qp.intervals(); ++i) {
    const auto curvature = [&](int j) { return std::abs(qp.H(i)[static_cast<std::ptrdiff_t>(j) * stride + j]); };
    const int end = states + qp.controls(i);
    const auto is_used = [&](int j) { return j < qp.states(i) || j >= states; };
    double largest = 0.0;
    for (int j = 0; j < end; ++j)
      if (is_used(j)) largest = std::max(largest, curvature(j));
    const double least = largest > 0.0 ? least_share * largest : 1.0;
    for (int j = 0; j < end; ++j)
      if (is_used(j) && (i > 0 || j >= states || !qp.initial_state_is_given))
        of_bound(i, j, relative_weight * std::max(curvature(j), least));
    for (int r = 0; r < qp.limits(i); ++r) {
      const double* row = qp.G(i) + static_cast<std::ptrdiff_t>(r) * stride;
      double compliance = 0.0;
      for (int j = 0; j < end; ++j)
        if (is_used(j)) compliance += row[j] * row[j] / std::max(curvature(j), least);
      // A row of zeros has a multiplier where its sides cannot be met.
      of_limit(i, r, relative_weight / (compliance > 0.0 ? compliance : 1.0));
    }
  }
}

double product(const double* a, const double* b, int count) noexcept {
  double sum = 0.0;
  for (int j = 0; j < count; ++j) sum += a[j] * b[j];
  return sum;
}

/// The QP in steps from `at`, but for its Hessian.
void move_to(const StageQp& qp, const Iterate& at, StageQp& moved) noexcept {
  const int stride = qp.stride(), states = qp.capacity().states;
  for (int i = 0; i <= qp.intervals(); ++i) {
    const double* const z = at.row(i);
    for (int j = 0; j < states + qp.controls(i); ++j) {
      moved.h(i)[j] = qp.h(i)[j] + product(qp.H(i) + static_cast<std::ptrdiff_t>(j) * stride, z, stride);
      moved.lower(i)[j] = qp.lower(i)[j] - z[j];
      moved.upper(i)[j] = qp.upper(i)[j] - z[j];
    }
    for (int r = 0; r < qp.limits(i); ++r) {
      const double value = product(qp.G(i) + static_cast<std::ptrdiff_t>(r) * stride, z, stride);
      moved.limit_lower(i)[r] = qp.limit_lower(i)[r] - value;
      moved.limit_upper(i)[r] = qp.limit_upper(i)[r] - value;
    }
    for (int r = 0; i < qp.intervals() && r < qp.states(i + 1); ++r)
      moved.b(i)[r] =
          qp.b(i)[r] + product(qp.AB(i) + static_cast<std::ptrdiff_t>(r) * stride, z, stride) - at.state(i + 1)[r];
  }
  for (int j = 0; qp.initial_state_is_given && j < qp.states(0); ++j)
    moved.initial_step()[j] = qp.initial_step()[j] - at.state(0)[j];
}

}  // namespace

/// Writes to `barrier_`, which is the QP in steps from `at`, the Lagrangian's gradient in the place of the objective's,
/// and rows at or beyond a side into the objective. Which these are is told by weights as small as the curvature, so
/// that a disturbance of a row's value does not decide it alone.
void StageQpSolver::augment_rows(const StageQp& qp, const Iterate& at, double relative_weight) noexcept {
  const int stride = qp.stride();
  for (int i = 0; i <= qp.intervals(); ++i) {
    double* const h = barrier_.h(i);
    for (int j = 0; j < qp.states(i); ++j) h[j] -= at.costate(i)[j];
    for (int r = 0; i < qp.intervals() && r < qp.states(i + 1); ++r)
      for (int j = 0; j < stride; ++j)
        h[j] += at.costate(i + 1)[r] * qp.AB(i)[static_cast<std::ptrdiff_t>(r) * stride + j];
    std::copy_n(qp.H(i), static_cast<std::ptrdiff_t>(capacity_.states + qp.controls(i)) * stride, barrier_.H(i));
  }
  for_each_row(
      qp, relative_weight,
      [&](int i, int j, double weight) {
        double &lower = barrier_.lower(i)[j], &upper = barrier_.upper(i)[j];
        const double multiplier = at.bound_row(i)[j];
        const int side = side_of(multiplier, lower, upper, weight / relative_weight, {});
        const Pull pull = pull_of(side, multiplier, lower, upper, weight, {});
        barrier_.h(i)[j] += pull.multiplier;
        barrier_.H(i)[static_cast<std::ptrdiff_t>(j) * stride + j] += pull.weight;
      },
      [&](int i, int r, double weight) {
        const double multiplier = at.limit_bound(i)[r], lower = barrier_.limit_lower(i)[r],
                     upper = barrier_.limit_upper(i)[r];
        const Slack slack{qp.limit_linear(i)[r], qp.limit_quadratic(i)[r]};
        const int side = side_of(multiplier, lower, upper, weight / relative_weight, slack);
        const Pull pull = pull_of(side, multiplier, lower, upper, weight, slack);
        add_row(qp.G(i) + static_cast<std::ptrdiff_t>(r) * stride, pull.weight, pull.multiplier, stride, barrier_.H(i),
                barrier_.h(i));
      });
}

/// Adds the solution of that QP, `increment_`, to `to`.
void StageQpSolver::add_increment(const StageQp& qp, double relative_weight, Iterate& to) const noexcept {
  const int stride = qp.stride();
  for_each_row(
      qp, relative_weight,
      [&](int i, int j, double weight) {
        const double along = increment_.row(i)[j];
        double& multiplier = to.bound_row(i)[j];
        multiplier =
            multiplier_after(multiplier, barrier_.lower(i)[j] - along, barrier_.upper(i)[j] - along, weight, {});
      },
      [&](int i, int r, double weight) {
        const double along = product(qp.G(i) + static_cast<std::ptrdiff_t>(r) * stride, increment_.row(i), stride);
        double& multiplier = to.limit_bound(i)[r];
        multiplier =
            multiplier_after(multiplier, barrier_.limit_lower(i)[r] - along, barrier_.limit_upper(i)[r] - along, weight,
                             {qp.limit_linear(i)[r], qp.limit_quadratic(i)[r]});
      });
  for (int i = 0; i <= qp.intervals(); ++i) {
    for (int j = 0; j < qp.states(i); ++j) {
      to.state(i)[j] += increment_.state(i)[j];
      to.costate(i)[j] += increment_.costate(i)[j];
    }
    for (int j = 0; j < qp.controls(i); ++j) to.control(i)[j] += increment_.control(i)[j];
  }
}

/// The method of multipliers (Nocedal & Wright 2006, section 17.4): rows are in the objective, so that a Riccati
/// recursion solves what is left, however many of them are active and depend on each other; and what it solves for is
/// what has still to be added, so that its rounding is relative to that.
double StageQpSolver::refine(const StageQp& qp, Iterate& step, double wanted, Clock::time_point deadline) noexcept {
  if (!qp.has_limits()) return infinity;
  barrier_ = qp;
  refined_ = step;
  double relative_weight = first_weight, least = infinity, last = infinity, violation = infinity;
  for (int round = 0, futile = 0;; ++round) {
    move_to(qp, refined_, barrier_);
    const KktResidual kkt = kkt_residual(barrier_, refined_);
    const double residual = kkt.largest();
    if (!std::isfinite(residual)) break;
    futile = residual < enough_less * last ? 0 : futile + 1;
    last = residual;
    if (residual < least) {
      least = residual;
      step = refined_;
    }
    // As good as it has to be: its policy stays what it is.
    if (round == 0 && least <= wanted) return least;
    if (least <= wanted || round == most_refinements || futile > most_futile_refinements || is_past(deadline)) break;
    if (kkt.bound_violation > violation_left * violation && relative_weight < heaviest) relative_weight *= heavier;
    violation = kkt.bound_violation;
    augment_rows(qp, refined_, relative_weight);
    riccati_.factor(barrier_, no_bounds_);
    ++factorisations_;
    if (riccati_.was_convexified() || riccati_.solve(barrier_, no_bounds_, increment_) != Riccati::Outcome::done) break;
    add_increment(qp, relative_weight, refined_);
  }
  factored_ = prepared_ = is_dual_ = false;
  is_refined_ = least < infinity;
  refined_ = step;
  return least;
}

/// The policy of the last increment, about the solution that it led to.
void StageQpSolver::refined_feedback(int i, const double* state_step, double* control_step) noexcept {
  double deviation[Riccati::max_width];
  for (int j = 0; j < barrier_.states(i); ++j) deviation[j] = state_step[j] - refined_.state(i)[j];
  riccati_.feedback(barrier_, i, deviation, control_step);
  for (int j = 0; j < barrier_.controls(i); ++j) control_step[j] += refined_.control(i)[j];
}

}  // namespace rhec
