// The interior-point method of SparseQp.
#include <algorithm>
#include <cmath>
#include <utility>

#include "rhec/core/base/infinity.hpp"
#include "sparse_products.hpp"
#include "sparse_qp.hpp"

namespace rhec::sparse_sqp {
namespace {

constexpr int most_interior_iterations = 80;
constexpr int polishing_rounds = 6;
// Residuals relative to the magnitudes in the QP.
constexpr double interior_tolerance = 1e-12;
constexpr double good_enough_interior = 1e-6;
constexpr double to_the_boundary = 0.995;

}  // namespace

/// Mehrotra's predictor-corrector method [8]. With a penalty the equations are J d + c = p - q with p, q > 0 and the
/// cost penalty * sum(p + q); the multipliers of p and q are penalty - lambda and penalty + lambda. A limit is an
/// equation J d + c = t + p - q with lower < t < upper, whose p and q have the weights of its slack; t, p and q are
/// eliminated.
SparseQp::Outcome SparseQp::interior_point(const Data& qp, double penalty, Clock::time_point deadline) {
  used_interior_point_ = true;
  for (int k = 0; k < n_; ++k) active_[k] = qp.lower[k] == qp.upper[k] ? 2 : 0;
  const bool is_limited = !qp.limits.rows.empty();
  for (const int r : qp.limits.rows) off_[r] = qp.limits.lower[r] == -infinity && qp.limits.upper[r] == infinity;
  const double gradient_size = 1.0 + max_abs(qp.gradient, n_);
  start_interior(qp, penalty, std::clamp(0.1 * gradient_size, 1e-2, 1e4));
  const double constraint_size = 1.0 + (is_limited ? size_of_constraints(qp) : max_abs(qp.constraints, m_));
  double best_residual = infinity;
  int no_progress = 0;
  for (int iteration = 0;; ++iteration) {
    if (Clock::now() > deadline) return Outcome::deadline;
    multiply_hessian(qp, d_.data(), dual_residual_.data());
    for (int k = 0; k < n_; ++k) dual_residual_[k] += qp.gradient[k];
    const double terms = std::max(gradient_size, max_abs(dual_residual_.data(), n_)) + max_abs(lambda_.data(), m_);
    add_jacobian_transposed(qp, lambda_.data(), dual_residual_.data());
    multiply_jacobian(qp, d_.data(), primal_residual_.data());
    for (int r = 0; r < m_; ++r) primal_residual_[r] += qp.constraints[r];
    std::copy(dual_residual_.begin(), dual_residual_.end(), mu_.begin());
    double mu = add_pairs_to_residuals(qp), dual_error = 0.0;
    for (const int r : qp.limits.rows) dual_error = std::max(dual_error, std::abs(value_steps_[r]));
    for (int k = 0; k < n_; ++k)
      if (active_[k] == 0) dual_error = std::max(dual_error, std::abs(mu_[k]));
    if (!pairs_.empty()) mu /= static_cast<double>(pairs_.size());
    const double residual =
        std::max({max_abs(primal_residual_.data(), m_) / constraint_size, dual_error / terms, mu / terms});
    if (is_limited && !(all_finite(d_.data(), n_) && all_finite(lambda_.data(), m_) && all_finite(values_.data(), m_)))
      return Outcome::failed;
    if (residual < interior_tolerance) break;
    no_progress = residual < 0.9 * best_residual ? 0 : no_progress + 1;
    if (residual < best_residual && residual < good_enough_interior) {
      best_d_ = d_;
      best_lambda_ = lambda_;
      best_pairs_ = pairs_;
      best_values_ = values_;
      best_dual_residual_ = dual_residual_;
    }
    best_residual = std::min(best_residual, residual);
    const bool is_good_enough = best_residual < good_enough_interior;
    // Beyond a certain accuracy the barrier terms get too large for double precision, and the residual grows again.
    if (!std::isfinite(residual) || no_progress > (is_good_enough ? 2 : 15) || iteration == most_interior_iterations) {
      if (!is_good_enough) return Outcome::failed;
      std::swap(d_, best_d_);
      std::swap(lambda_, best_lambda_);
      std::swap(pairs_, best_pairs_);
      std::swap(values_, best_values_);
      std::swap(dual_residual_, best_dual_residual_);
      break;
    }

    write_interior_matrix(qp);
    // Where bounds limit a direction of negative curvature, the barrier terms make the matrix convex enough.
    if (!factor_with(qp)) return qp.is_convex ? Outcome::failed : Outcome::indefinite;
    double target = 0.0;
    if (!pairs_.empty()) {
      interior_direction(qp, 0.0);
      const double length = interior_length(1.0);
      double affine_mu = 0.0;
      for (Pair& pair : pairs_) {
        affine_mu += (pair.s + length * pair.ds) * (pair.z + length * pair.dz);
        pair.correction = pair.ds * pair.dz;
      }
      affine_mu /= static_cast<double>(pairs_.size());
      const double ratio = std::clamp(affine_mu / mu, 0.0, 1.0);
      target = ratio * ratio * ratio * mu;
    }
    interior_direction(qp, target);
    // With a quadratic cost, one common step length reduces primal and dual residuals together.
    const double length = interior_length(to_the_boundary);
    for (int k = 0; k < n_; ++k) d_[k] += length * solution_[k];
    for (int r = 0; r < m_; ++r) lambda_[r] += length * solution_[n_ + r];
    for (const int r : qp.limits.rows) values_[r] += length * value_steps_[r];
    for (Pair& pair : pairs_) {
      pair.s += length * pair.ds;
      pair.z += length * pair.dz;
      pair.correction = 0.0;
    }
  }
  finish_interior(qp, penalty > 0.0);
  return Outcome::solved;
}

void SparseQp::start_interior(const Data& qp, double penalty, double multiplier) {
  pairs_.clear();
  for (int k = 0; k < n_; ++k) {
    if (active_[k] == 2) {
      d_[k] = qp.lower[k];
      continue;
    }
    // Starts well inside the bounds, as close to a zero step as that allows.
    const double margin = std::min(0.1, 0.25 * (qp.upper[k] - qp.lower[k]));
    d_[k] = std::min(std::max(0.0, qp.lower[k] + margin), qp.upper[k] - margin);
    if (std::isfinite(qp.lower[k])) pairs_.push_back({Pair::Kind::lower, k, d_[k] - qp.lower[k], multiplier});
    if (std::isfinite(qp.upper[k])) pairs_.push_back({Pair::Kind::upper, k, qp.upper[k] - d_[k], multiplier});
  }
  std::fill(lambda_.begin(), lambda_.end(), 0.0);
  const bool is_limited = !qp.limits.rows.empty();
  if (penalty == 0.0 && !is_limited) return;
  multiply_jacobian(qp, d_.data(), primal_residual_.data());
  for (int r = 0; r < m_; ++r) primal_residual_[r] += qp.constraints[r];
  for (const int r : qp.limits.rows) {
    const double lower = qp.limits.lower[r], upper = qp.limits.upper[r];
    if (off_[r]) continue;
    const double margin = std::min(0.1, 0.25 * (upper - lower));
    values_[r] = std::min(std::max(primal_residual_[r], lower + margin), upper - margin);
    primal_residual_[r] -= values_[r];
    if (lower == upper) continue;  // then its value is given
    if (lower > -infinity) pairs_.push_back({Pair::Kind::least, r, values_[r] - lower, multiplier});
    if (upper < infinity) pairs_.push_back({Pair::Kind::most, r, upper - values_[r], multiplier});
  }
  for (int r = 0; r < m_; ++r) {
    double linear = penalty > 0.0 ? penalty : infinity, quadratic = 0.0;
    bool may_exceed = true, may_lack = true;
    if (is_limited && qp.limits.linear[r] < infinity) {
      linear = qp.limits.linear[r];
      quadratic = qp.limits.quadratic[r];
    }
    if (linear == infinity || off_[r]) continue;
    if (is_limited) {
      may_exceed = qp.limits.upper[r] < infinity;
      may_lack = qp.limits.lower[r] > -infinity;
    }
    // With lambda = 0 the multipliers of p and q are the prices at the margin.
    const double value = primal_residual_[r], excess = std::max(value, 0.0) + 0.1, lack = excess - value;
    if (may_exceed) pairs_.push_back({Pair::Kind::excess, r, excess, linear + quadratic * excess, quadratic});
    if (may_lack) pairs_.push_back({Pair::Kind::lack, r, lack, linear + quadratic * lack, quadratic});
  }
}

/// Adds to `mu_` the pull of the bounds, to `primal_residual_` the values and slacks of limits, and writes what is left
/// of the stationarity of these values. Returns the sum of s z.
double SparseQp::add_pairs_to_residuals(const Data& qp) noexcept {
  double mu = 0.0;
  for (const int r : qp.limits.rows) {
    value_steps_[r] = off_[r] || qp.limits.lower[r] == qp.limits.upper[r] ? 0.0 : -lambda_[r];
    primal_residual_[r] = off_[r] ? 0.0 : primal_residual_[r] - values_[r];
  }
  for (const Pair& pair : pairs_) {
    mu += pair.s * pair.z;
    switch (pair.kind) {
      case Pair::Kind::lower:
        mu_[pair.index] -= pair.z;
        break;
      case Pair::Kind::upper:
        mu_[pair.index] += pair.z;
        break;
      case Pair::Kind::least:
        value_steps_[pair.index] -= pair.z;
        break;
      case Pair::Kind::most:
        value_steps_[pair.index] += pair.z;
        break;
      case Pair::Kind::excess:
        primal_residual_[pair.index] -= pair.s;
        break;
      case Pair::Kind::lack:
        primal_residual_[pair.index] += pair.s;
        break;
    }
  }
  return mu;
}

/// What the eliminated slacks and values add to the diagonal of the matrix.
void SparseQp::write_interior_matrix(const Data& qp) {
  std::fill(primal_.begin(), primal_.end(), 0.0);
  std::fill(dual_.begin(), dual_.end(), 0.0);
  std::fill(side_stiffness_.begin(), side_stiffness_.end(), 0.0);
  for (const Pair& pair : pairs_) {
    if (pair.is_bound()) {
      primal_[pair.index] += pair.z / pair.s;
    } else if (pair.is_side()) {
      side_stiffness_[pair.index] += pair.z / pair.s;
    } else {
      dual_[pair.index] += pair.s / pair.stiffness();
    }
  }
  for (const int r : qp.limits.rows)
    if (side_stiffness_[r] > 0.0) dual_[r] += 1.0 / side_stiffness_[r];
}

namespace {

/// The step of an excess or a lack were lambda to stay.
double free_step(const auto& pair, double wanted) noexcept {
  if (pair.quadratic == 0.0) return wanted / pair.z - pair.s;
  return (wanted - pair.s * pair.z) / pair.stiffness();
}

}  // namespace

/// Newton direction towards s z = target, less the pair's second-order correction, for every pair. `solution_` gets the
/// directions of d and lambda.
void SparseQp::interior_direction(const Data& qp, double target) {
  for (int k = 0; k < n_; ++k) rhs_[k] = active_[k] == 2 ? 0.0 : -dual_residual_[k];
  for (int r = 0; r < m_; ++r) rhs_[n_ + r] = -primal_residual_[r];
  // The step of a limit's value is (step of lambda + `value_steps_`) / stiffness of its sides.
  for (const int r : qp.limits.rows) value_steps_[r] = lambda_[r];
  for (const Pair& pair : pairs_) {
    const double wanted = target - pair.correction;
    switch (pair.kind) {
      case Pair::Kind::lower:
        rhs_[pair.index] += wanted / pair.s;
        break;
      case Pair::Kind::upper:
        rhs_[pair.index] -= wanted / pair.s;
        break;
      case Pair::Kind::least:
        value_steps_[pair.index] += wanted / pair.s;
        break;
      case Pair::Kind::most:
        value_steps_[pair.index] -= wanted / pair.s;
        break;
      case Pair::Kind::excess:
        rhs_[n_ + pair.index] += free_step(pair, wanted);
        break;
      case Pair::Kind::lack:
        rhs_[n_ + pair.index] -= free_step(pair, wanted);
        break;
    }
  }
  for (const int r : qp.limits.rows)
    if (side_stiffness_[r] > 0.0) rhs_[n_ + r] += value_steps_[r] / side_stiffness_[r];
  solve_system();
  for (const int r : qp.limits.rows)
    value_steps_[r] = side_stiffness_[r] > 0.0 ? (solution_[n_ + r] + value_steps_[r]) / side_stiffness_[r] : 0.0;
  for (Pair& pair : pairs_) {
    const double wanted = target - pair.correction;
    if (pair.is_bound() || pair.is_side()) {
      const double step = pair.is_bound() ? solution_[pair.index] : value_steps_[pair.index];
      pair.ds = pair.kind == Pair::Kind::lower || pair.kind == Pair::Kind::least ? step : -step;
      pair.dz = (wanted - pair.z * pair.ds) / pair.s - pair.z;
    } else if (pair.quadratic == 0.0) {
      pair.dz = pair.kind == Pair::Kind::lack ? solution_[n_ + pair.index] : -solution_[n_ + pair.index];
      pair.ds = (wanted - pair.s * pair.dz) / pair.z - pair.s;
    } else {
      const double pull = pair.kind == Pair::Kind::lack ? solution_[n_ + pair.index] : -solution_[n_ + pair.index];
      pair.ds = (wanted - pair.s * pull - pair.s * pair.z) / pair.stiffness();
      pair.dz = pull + pair.quadratic * pair.ds;
    }
  }
}

/// Fraction-to-the-boundary rule: the longest step length, at most one, that goes at most `share` of the way to where a
/// slack or multiplier vanishes.
double SparseQp::interior_length(double share) const noexcept {
  double length = 1.0;
  for (const Pair& pair : pairs_) {
    if (pair.ds < 0.0) length = std::min(length, -share * pair.s / pair.ds);
    if (pair.dz < 0.0) length = std::min(length, -share * pair.z / pair.dz);
  }
  return length;
}

/// Rounds the interior solution to an active set and polishes it; the result is exact if the active-set rounds settle.
void SparseQp::finish_interior(const Data& qp, bool relaxed) {
  if (!relaxed) {
    const auto d = d_, lambda = lambda_;
    for (const Pair& pair : pairs_)
      if (pair.is_bound() && pair.z > pair.s) active_[pair.index] = pair.kind == Pair::Kind::lower ? -1 : 1;
    using State = LimitRows::State;
    for (const int r : qp.limits.rows)
      limit_rows_.set(r, !off_[r] && qp.limits.lower[r] == qp.limits.upper[r] ? State::both : State::off);
    for (const Pair& pair : pairs_) {
      if (pair.is_side() && pair.z > pair.s)
        limit_rows_.set(pair.index, pair.kind == Pair::Kind::least ? State::lower : State::upper);
      else if (!pair.is_bound() && !pair.is_side() && pair.s > pair.z)
        limit_rows_.set(pair.index, pair.kind == Pair::Kind::lack ? State::below : State::above);
    }
    const ActiveSet found = solve_active(qp, polishing_rounds);
    // One that is far from settled has multipliers of the wrong sign, which these here have not.
    if (found == ActiveSet::optimal) return;
    d_ = d;
    lambda_ = lambda;
  }
  std::fill(mu_.begin(), mu_.end(), 0.0);
  for (const Pair& pair : pairs_) {
    if (!pair.is_bound() || pair.s > pair.z) continue;
    mu_[pair.index] = pair.kind == Pair::Kind::lower ? -pair.z : pair.z;
  }
  // The interior-point method has no multipliers for fixed variables: they follow from stationarity.
  for (int k = 0; k < n_; ++k)
    if (qp.lower[k] == qp.upper[k]) mu_[k] = -dual_residual_[k];
}

}  // namespace rhec::sparse_sqp
