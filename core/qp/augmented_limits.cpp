// Stage QPs with limits whose Hessian is positive definite only along the active ones. A Riccati recursion does not see
// these, so the QP is augmented: its objective gets 1/2 weight (g z - d)^2 for each active row g z = d (Nocedal &
// Wright 2006, section 17.3). This changes neither its solution nor, but for a shift that is known, its multipliers.
#include <algorithm>
#include <cmath>

#include "limit_checks.hpp"
#include "rhec/core/base/infinity.hpp"
#include "rhec/core/qp/stage_qp_solver.hpp"
#include "tolerances.hpp"

namespace rhec {
namespace {

// Weights relative to the largest curvature of the stage.
constexpr double weights[] = {1e1, 1e3};
constexpr int most_sets = 4;
// QPs in a row that are not convex before one is tried, and tried again, where each has to be cheap.
constexpr int most_wait = 16;
// What the augmentation takes over of the quadratic weight of a slack.
constexpr double share_of_slack = 0.9;

double largest_curvature(const StageQp& qp, int i) noexcept {
  double largest = 0.0;
  for (int j = 0; j < qp.stride(); ++j)
    if (j < qp.states(i) || (j >= qp.capacity().states && j < qp.capacity().states + qp.controls(i)))
      largest = std::max(largest, std::abs(qp.H(i)[j * qp.stride() + j]));
  return largest;
}

/// The weight of a limit in the augmentation; none where a linear slack takes all that the limit asks for.
double weight_of_limit(const StageQp& qp, int i, int r, std::int8_t side, double relative, double curvature) noexcept {
  if (side == 0) return 0.0;
  if (std::abs(side) > 1 && qp.limit_linear(i)[r] < infinity) return share_of_slack * qp.limit_quadratic(i)[r];
  const double* row = qp.G(i) + static_cast<std::ptrdiff_t>(r) * qp.stride();
  double square = 0.0;
  for (int j = 0; j < qp.stride(); ++j) square += row[j] * row[j];
  return square > 0.0 ? relative * curvature / square : 0.0;
}

}  // namespace

/// Visits the rows that are augmented: of state bounds (stage, component, side, weight), and of limits.
template <class OfState, class OfLimit>
void StageQpSolver::for_each_augmented(const StageQp& qp, double relative, const OfState& of_state,
                                       const OfLimit& of_limit) const noexcept {
  for (int i = 0; i <= qp.intervals(); ++i) {
    const double curvature = largest_curvature(qp, i);
    for (int j = 0; (i > 0 || !qp.initial_state_is_given) && j < qp.states(i); ++j)
      if (const std::int8_t side = augmented_.state(i)[j]; side != 0) of_state(i, j, side, relative * curvature);
    for (int r = 0; r < qp.limits(i); ++r) {
      const std::int8_t side = augmented_.limit(i)[r];
      if (const double weight = weight_of_limit(qp, i, r, side, relative, curvature); weight > 0.0)
        of_limit(i, r, side, weight);
    }
  }
}

/// Writes the QP, augmented for the active set, to `convexified_`.
void StageQpSolver::augment(const StageQp& qp, double relative) noexcept {
  augmented_ = active_;
  convexified_.take_stages(qp);
  const int stride = qp.stride();
  for_each_augmented(
      qp, relative,
      [&](int i, int j, std::int8_t side, double weight) {
        convexified_.H(i)[j * stride + j] += weight;
        convexified_.q(i)[j] -= weight * (side < 0 ? qp.state_lower(i) : qp.state_upper(i))[j];
      },
      [&](int i, int r, std::int8_t side, double weight) {
        const double bound = (side < 0 ? qp.limit_lower(i) : qp.limit_upper(i))[r];
        add_row(qp.G(i) + static_cast<std::ptrdiff_t>(r) * stride, weight, -weight * bound, stride, convexified_.H(i),
                convexified_.h(i));
        if (std::abs(side) > 1 && qp.limit_linear(i)[r] < infinity) convexified_.limit_quadratic(i)[r] -= weight;
      });
}

/// Whether all rows of the augmentation are active in the solution, on the sides for which it was made.
bool StageQpSolver::augmentation_fits(const StageQp& qp, double relative) const noexcept {
  bool fits = true;
  for_each_augmented(
      qp, relative,
      [&](int i, int j, std::int8_t side, double) {
        const std::int8_t now = active_.state(i)[j];
        fits = fits && now != 0 && (now == side || is_equality(qp.state_lower(i)[j], qp.state_upper(i)[j]));
      },
      [&](int i, int r, std::int8_t side, double) {
        const std::int8_t now = active_.limit(i)[r];
        const bool is_one =
            qp.limit_linear(i)[r] == infinity && is_equality(qp.limit_lower(i)[r], qp.limit_upper(i)[r]);
        fits = fits && now != 0 && (now == side || is_one);
      });
  return fits;
}

/// Gives the multipliers the gradient of the augmentation, which belongs to them.
void StageQpSolver::shift_multipliers(const StageQp& qp, double relative, Iterate& step) const noexcept {
  for_each_augmented(
      qp, relative,
      [&](int i, int j, std::int8_t side, double weight) {
        const double bound = (side < 0 ? qp.state_lower(i) : qp.state_upper(i))[j];
        step.state_bound(i)[j] += weight * (step.state(i)[j] - bound);
      },
      [&](int i, int r, std::int8_t side, double weight) {
        const double* row = qp.G(i) + static_cast<std::ptrdiff_t>(r) * qp.stride();
        double value = 0.0;
        for (int j = 0; j < qp.stride(); ++j) value += row[j] * step.row(i)[j];
        step.limit_bound(i)[r] += weight * (value - (side < 0 ? qp.limit_lower(i) : qp.limit_upper(i))[r]);
      });
}

/// An augmentation takes several times as long as a convexification. Where each QP has to be cheap, it is for those
/// that stay not convex: where something passes by, rows come and go, few augmentations fit, and none for long.
bool StageQpSolver::may_augment() noexcept {
  if (!is_cheap_) return true;
  if (not_convex_ == 1) has_fitted_ = false;
  if (has_fitted_) return true;
  if (not_convex_ == 1 || wait_ <= 0) wait_ = most_wait + 1;
  return --wait_ == 0;
}

/// Solves a QP that is not convex but for its active limits; false if it is not convex on them either, or no active set
/// settles.
bool StageQpSolver::solve_augmented(const StageQp& qp, Iterate& step, Clock::time_point deadline) noexcept {
  if (!any_active_) return false;
  guessed_ = active_;
  for (const double relative : weights) {
    active_ = guessed_;
    for (int set = 0; set < most_sets; ++set) {
      augment(qp, relative);
      is_convexified_ = true;
      prepared_ = false;
      const auto outcome = solve_from_guess(convexified_, step, deadline);
      out_of_time_ = outcome == DualActiveSet::Outcome::out_of_time || is_past(deadline);
      if (outcome == DualActiveSet::Outcome::solved && augmentation_fits(qp, relative)) {
        shift_multipliers(qp, relative, step);
        has_fitted_ = true;
        return true;
      }
      if (outcome != DualActiveSet::Outcome::solved || out_of_time_) break;
    }
    // Where each has to be cheap: a larger weight seldom helps if one did not.
    if (out_of_time_ || is_cheap_) break;
  }
  active_ = guessed_;
  is_convexified_ = is_dual_ = has_fitted_ = false;
  wait_ = most_wait;
  return false;
}

}  // namespace rhec
