#include "sparse_qp.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "rhec/core/base/infinity.hpp"
#include "sparse_products.hpp"

namespace rhec::sparse_sqp {
namespace {

constexpr int active_set_rounds = 10;
// The active set is far from settled if a round releases this many bounds and more than half as many as the round
// before.
constexpr int many = 16;
// The same holds after this many consecutive rounds that release bounds and add none.
constexpr int enough = 4;
constexpr int equation_refinements = 6;
// A step must reduce the defects to this share, or to rounding.
constexpr double least_reduction = 1e-3, rounding_of_equations = 1e-12;
// Relative tolerance beyond which a bound is violated or a multiplier has the wrong sign.
constexpr double active_set_tolerance = 1e-11;
// Relative residual below which the solution of a linear system is accepted, and below which it needs no smaller
// regularisation.
constexpr double believable = 1e-8;
constexpr double accurate = 1e-11;
constexpr double largest_step = 1e10;

}  // namespace

void SparseQp::take_structure(const SparseNlp& nlp) {
  factor_.take_structure(nlp);
  nlp_ = &nlp;
  n_ = nlp.variables();
  m_ = nlp.constraints();
  active_.assign(n_, 0);
  fixed_.assign(n_, 0);
  for (auto* v : {&d_, &mu_, &primal_, &work_n_, &dual_residual_}) v->assign(n_, 0.0);
  for (auto* v : {&lambda_, &dual_, &work_m_, &primal_residual_, &values_, &value_steps_, &side_stiffness_})
    v->assign(m_, 0.0);
  limit_rows_.take_structure(m_);
  off_.assign(m_, 0);
  pairs_.reserve(2 * (static_cast<std::size_t>(n_) + m_));
  for (auto* v : {&rhs_, &solution_, &other_solution_}) v->assign(static_cast<std::size_t>(n_) + m_, 0.0);
}

void SparseQp::forget() noexcept {
  factor_.forget();
  nlp_ = nullptr;
}

void SparseQp::multiply_hessian(const Data& qp, const double* x, double* y) const noexcept {
  multiply_symmetric(nlp_->hessian(), qp.hessian, x, y);
}

void SparseQp::multiply_jacobian(const Data& qp, const double* x, double* y) const noexcept {
  std::fill_n(y, m_, 0.0);
  add_product(nlp_->jacobian(), qp.jacobian, x, y);
}

void SparseQp::add_jacobian_transposed(const Data& qp, const double* y, double* x) const noexcept {
  add_transposed_product(nlp_->jacobian(), qp.jacobian, y, x);
}

void SparseQp::guess_active(const Data& qp, const double* bound_multipliers, const double* multipliers) {
  limit_rows_.guess(qp.limits, multipliers);
  for (int k = 0; k < n_; ++k) {
    active_[k] = 0;
    if (qp.lower[k] == qp.upper[k]) {
      active_[k] = 2;
    } else if (bound_multipliers[k] < 0.0 && std::isfinite(qp.lower[k])) {
      active_[k] = -1;
    } else if (bound_multipliers[k] > 0.0 && std::isfinite(qp.upper[k])) {
      active_[k] = 1;
    }
  }
}

/// Factorises with `primal_`, `dual_` and the active set; false if the inertia is wrong. With a semidefinite Hessian
/// only rounding can cause that; then the regularisation is raised, and refinement removes its effect.
bool SparseQp::factor_with(const Data& qp) {
  for (int k = 0; k < n_; ++k) fixed_[k] = active_[k] != 0;
  KktFactor::Numbers numbers;
  numbers.hessian = qp.hessian;
  numbers.jacobian = qp.jacobian;
  numbers.primal = primal_.data();
  numbers.dual = dual_.data();
  numbers.fixed = fixed_.data();
  if (!qp.limits.rows.empty()) numbers.off = off_.data();
  numbers.regularisation = regularisation_;
  numbers_ = numbers;
  for (;;) {
    ++factorisations_;
    if (factor_.factor(numbers_)) return true;
    if (!qp.is_convex || numbers_.regularisation >= largest_regularisation) return false;
    numbers_.regularisation *= 10.0;
  }
}

/// `solution_` = K^-1 `rhs_`; returns the remaining relative residual. If refinement converges poorly, e.g. with
/// weights of very different magnitudes, the regularisation is too large relative to the matrix: smaller ones are
/// tried.
double SparseQp::solve_system() {
  double residual = factor_.solve(rhs_.data(), solution_.data());
  while (residual > accurate && numbers_.regularisation > least_regularisation) {
    std::swap(solution_, other_solution_);
    const double last = numbers_.regularisation;
    numbers_.regularisation *= 1e-2;
    ++factorisations_;
    const bool factored = factor_.factor(numbers_);
    const double next = factored ? factor_.solve(rhs_.data(), solution_.data()) : infinity;
    if (!(next < 0.1 * residual)) {
      if (!(next < residual)) std::swap(solution_, other_solution_);
      numbers_.regularisation = last;
      ++factorisations_;
      factor_.factor(numbers_);
      return std::min(residual, next);
    }
    residual = next;
    regularisation_ = numbers_.regularisation;
  }
  return residual;
}

/// `work_m_` = what is left of the equations and of active limits.
void SparseQp::find_unmet(const Data& qp) {
  multiply_jacobian(qp, d_.data(), work_m_.data());
  for (int r = 0; r < m_; ++r) work_m_[r] += qp.constraints[r];
  for (const int r : qp.limits.rows) work_m_[r] = limit_rows_.unmet(qp.limits, r, work_m_[r], lambda_[r]);
}

/// The largest defect, or violation of a limit, without a step.
double SparseQp::size_of_constraints(const Data& qp) {
  std::copy_n(qp.constraints, m_, work_m_.data());
  for (const int r : qp.limits.rows)
    work_m_[r] = std::max({0.0, qp.limits.lower[r] - work_m_[r], work_m_[r] - qp.limits.upper[r]});
  return max_abs(work_m_.data(), m_);
}

/// Refines `d_` and `lambda_` until the equations are satisfied. With large weights their residual can be small
/// relative to the whole system and still too large for the next iterate. False if they cannot be satisfied: equations
/// that contradict the active bounds yield huge multipliers, relative to which the residual looks small.
bool SparseQp::meet_equations(const Data& qp) {
  const auto unmet = [&] {
    find_unmet(qp);
    return max_abs(work_m_.data(), m_);
  };
  double size = max_abs(qp.constraints, m_);
  if (!qp.limits.rows.empty()) size = size_of_constraints(qp);
  const double well_met = least_reduction * size + rounding_of_equations;
  double remaining = unmet();
  for (int round = 0; round < equation_refinements && !(remaining <= well_met); ++round) {
    std::fill_n(rhs_.data(), n_, 0.0);
    for (int r = 0; r < m_; ++r) rhs_[n_ + r] = -work_m_[r];
    if (solve_system() > believable) return false;
    for (int k = 0; k < n_; ++k) d_[k] += solution_[k];
    for (int r = 0; r < m_; ++r) lambda_[r] += solution_[n_ + r];
    const double last = std::exchange(remaining, unmet());
    if (remaining < 0.1 * last) continue;
    // The regularisation prevents the equations from being satisfied: reduce it.
    if (numbers_.regularisation <= least_regularisation) break;
    const double before = std::exchange(numbers_.regularisation, 1e-2 * numbers_.regularisation);
    ++factorisations_;
    if (factor_.factor(numbers_)) continue;
    numbers_.regularisation = before;
    ++factorisations_;
    factor_.factor(numbers_);
    break;
  }
  if (remaining <= well_met) regularisation_ = numbers_.regularisation;
  return remaining <= believable * (1.0 + size);
}

/// Rounds of the primal-dual active-set method from `active_`. If the outcome is optimal or feasible, the solution is
/// in `d_`, `lambda_`, `mu_`.
SparseQp::ActiveSet SparseQp::solve_active(const Data& qp, int rounds) {
  std::fill(primal_.begin(), primal_.end(), 0.0);
  std::fill(dual_.begin(), dual_.end(), 0.0);
  const bool is_limited = !qp.limits.rows.empty();
  int released_before = 0, peeled = 0;  // peeled: consecutive rounds that added no bound
  for (int round = 0; round < rounds; ++round) {
    if (is_limited) limit_rows_.write_matrix(qp.limits, off_.data(), dual_.data());
    if (!factor_with(qp)) return qp.is_convex ? ActiveSet::unknown : ActiveSet::indefinite;
    const auto value_at = [&](int k) { return active_[k] == 1 ? qp.upper[k] : qp.lower[k]; };
    // Contribution of the fixed variables to the other rows.
    for (int k = 0; k < n_; ++k) d_[k] = active_[k] != 0 ? value_at(k) : 0.0;
    multiply_hessian(qp, d_.data(), mu_.data());
    std::fill(lambda_.begin(), lambda_.end(), 0.0);
    find_unmet(qp);
    for (const int r : qp.limits.rows)
      if (off_[r]) lambda_[r] = limit_rows_.known_multiplier(qp.limits, r);
    if (is_limited) add_jacobian_transposed(qp, lambda_.data(), mu_.data());
    for (int k = 0; k < n_; ++k) rhs_[k] = active_[k] != 0 ? d_[k] : -qp.gradient[k] - mu_[k];
    for (int r = 0; r < m_; ++r) rhs_[n_ + r] = -work_m_[r];
    for (const int r : qp.limits.rows)
      if (off_[r]) rhs_[n_ + r] = -lambda_[r];
    if (solve_system() > believable) return ActiveSet::unknown;
    std::copy_n(solution_.data(), n_, d_.data());
    std::copy_n(solution_.data() + n_, m_, lambda_.data());
    if (!meet_equations(qp)) return ActiveSet::unknown;
    // A limit that no variable can change has no finite multiplier.
    if (is_limited && !(all_finite(lambda_.data(), m_) && all_finite(d_.data(), n_))) return ActiveSet::unknown;
    multiply_hessian(qp, d_.data(), mu_.data());
    for (int k = 0; k < n_; ++k) mu_[k] += qp.gradient[k];
    const double gradient_size = 1.0 + max_abs(mu_.data(), n_);
    add_jacobian_transposed(qp, lambda_.data(), mu_.data());
    const double step_size = 1.0 + max_abs(d_.data(), n_);
    bool settled = true;
    int added = 0, released = 0;
    if (is_limited) {
      multiply_jacobian(qp, d_.data(), work_m_.data());
      for (int r = 0; r < m_; ++r) work_m_[r] += qp.constraints[r];
      const auto change =
          limit_rows_.update(qp.limits, work_m_.data(), lambda_.data(), active_set_tolerance * step_size,
                             active_set_tolerance * (gradient_size + max_abs(lambda_.data(), m_)));
      added = change.added;
      released = change.released;
      settled = added + released == 0;
    }
    for (int k = 0; k < n_; ++k) {
      mu_[k] = active_[k] != 0 ? -mu_[k] : 0.0;
      if (active_[k] == 2) continue;
      std::int8_t next = active_[k];
      if (active_[k] == 0) {
        if (d_[k] < qp.lower[k] - active_set_tolerance * step_size) next = -1;
        if (d_[k] > qp.upper[k] + active_set_tolerance * step_size) next = 1;
      } else if (mu_[k] * active_[k] < -active_set_tolerance * gradient_size) {
        next = 0;
      }
      if (next != active_[k]) ++(next == 0 ? released : added);
      settled = settled && next == active_[k];
      active_[k] = next;
    }
    // If the active set has a long run of nodes at a bound that should be shorter, each round releases only the nodes
    // at the ends of the run.
    peeled = added == 0 ? peeled + 1 : 0;
    const bool is_peeling =
        (peeled >= enough && round == rounds - 1) || (peeled > 0 && released >= many && 2 * released > released_before);
    released_before = released;
    if (settled || is_peeling) {
      factor_is_final_ = settled;
      for (int k = 0; k < n_; ++k) {
        d_[k] = std::clamp(d_[k], qp.lower[k], qp.upper[k]);
        if (active_[k] != 2) mu_[k] = active_[k] * std::max(0.0, mu_[k] * active_[k]);
      }
      limit_rows_.clip(qp.limits, lambda_.data());
      // A direction that neither cost nor equations nor bounds determine.
      if (!(max_abs(d_.data(), n_) <= largest_step)) return ActiveSet::unknown;
      return settled ? ActiveSet::optimal : ActiveSet::feasible;
    }
  }
  return ActiveSet::unknown;
}

SparseQp::Outcome SparseQp::solve(const Data& qp, double* step, double* multipliers, double* bound_multipliers,
                                  Clock::time_point deadline) {
  regularisation_ = first_regularisation;
  used_interior_point_ = false;
  factor_is_final_ = false;
  guess_active(qp, bound_multipliers, multipliers);
  Outcome outcome = Outcome::solved;
  switch (solve_active(qp, active_set_rounds)) {
    case ActiveSet::optimal:
      break;
    case ActiveSet::feasible:
      outcome = Outcome::feasible;
      break;
    case ActiveSet::indefinite:
      // If the reduced Hessian is not positive definite, it is not with fewer active bounds either.
      for (int k = 0; k < n_; ++k) bound_multipliers[k] = active_[k] == 2 ? 0.0 : active_[k];
      limit_rows_.describe(qp.limits, multipliers);
      return Outcome::indefinite;
    case ActiveSet::unknown:
      outcome = interior_point(qp, 0.0, deadline);
      if (outcome != Outcome::solved) return outcome;
  }
  std::copy_n(d_.data(), n_, step);
  std::copy_n(lambda_.data(), m_, multipliers);
  std::copy_n(mu_.data(), n_, bound_multipliers);
  return outcome;
}

SparseQp::Outcome SparseQp::solve_relaxed(const Data& qp, double penalty, double* step, double* multipliers,
                                          double* bound_multipliers, Clock::time_point deadline) {
  factor_is_final_ = false;
  const Outcome outcome = interior_point(qp, penalty, deadline);
  if (outcome != Outcome::solved) return outcome;
  std::copy_n(d_.data(), n_, step);
  std::copy_n(lambda_.data(), m_, multipliers);
  std::copy_n(mu_.data(), n_, bound_multipliers);
  return Outcome::relaxed;
}

bool SparseQp::correct(const Data& qp, const double* constraints, double* step) {
  if (!factor_is_final_) {
    std::fill(primal_.begin(), primal_.end(), 0.0);
    std::fill(dual_.begin(), dual_.end(), 0.0);
    limit_rows_.write_matrix(qp.limits, off_.data(), dual_.data());
    if (!factor_with(qp)) return false;
    factor_is_final_ = true;
  }
  std::fill_n(rhs_.data(), n_, 0.0);
  for (int r = 0; r < m_; ++r) rhs_[n_ + r] = -constraints[r];
  using State = LimitRows::State;
  for (const int r : qp.limits.rows) {
    const State state = limit_rows_.state(r);
    const bool is_at_side = state == State::lower || state == State::upper || state == State::both;
    rhs_[n_ + r] = is_at_side ? -limit_rows_.unmet(qp.limits, r, constraints[r], 0.0) : 0.0;
  }
  if (solve_system() > believable) return false;
  std::copy_n(solution_.data(), n_, step);
  return true;
}

}  // namespace rhec::sparse_sqp
