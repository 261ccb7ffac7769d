#include "sparse_qp.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "rhec/core/base/infinity.hpp"

namespace rhec::sparse_sqp {
namespace {

constexpr int active_set_rounds = 10;
constexpr int polishing_rounds = 6;
// The active set is far from settled if a round releases this many bounds and more than half as many as the round
// before.
constexpr int many = 16;
// The same holds after this many consecutive rounds that release bounds and add none.
constexpr int enough = 4;
constexpr int most_interior_iterations = 80;
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
// Interior point: residuals relative to the magnitudes in the QP.
constexpr double interior_tolerance = 1e-12;
constexpr double good_enough_interior = 1e-6;
constexpr double to_the_boundary = 0.995;

double max_abs(const double* v, int n) {
  double largest = 0.0;
  for (int k = 0; k < n; ++k) largest = std::max(largest, std::abs(v[k]));
  return largest;
}

}  // namespace

void SparseQp::take_structure(const SparseNlp& nlp) {
  factor_.take_structure(nlp);
  nlp_ = &nlp;
  n_ = nlp.variables();
  m_ = nlp.constraints();
  active_.assign(n_, 0);
  fixed_.assign(n_, 0);
  for (auto* v : {&d_, &mu_, &primal_, &work_n_, &dual_residual_}) v->assign(n_, 0.0);
  for (auto* v : {&lambda_, &dual_, &work_m_, &primal_residual_}) v->assign(m_, 0.0);
  pairs_.reserve(2 * (static_cast<std::size_t>(n_) + m_));
  for (auto* v : {&rhs_, &solution_, &other_solution_}) v->assign(static_cast<std::size_t>(n_) + m_, 0.0);
}

void SparseQp::forget() noexcept {
  factor_.forget();
  nlp_ = nullptr;
}

void SparseQp::multiply_hessian(const Data& qp, const double* x, double* y) const noexcept {
  const auto& H = nlp_->hessian();
  std::fill_n(y, n_, 0.0);
  for (int c = 0; c < n_; ++c) {
    double sum = 0.0;
    for (int k = H.starts[c]; k < H.starts[c + 1]; ++k) {
      const int r = H.row_indices[k];
      sum += qp.hessian[k] * x[r];
      if (r != c) y[r] += qp.hessian[k] * x[c];
    }
    y[c] += sum;
  }
}

void SparseQp::multiply_jacobian(const Data& qp, const double* x, double* y) const noexcept {
  const auto& J = nlp_->jacobian();
  std::fill_n(y, m_, 0.0);
  for (int c = 0; c < n_; ++c)
    for (int k = J.starts[c]; k < J.starts[c + 1]; ++k) y[J.row_indices[k]] += qp.jacobian[k] * x[c];
}

void SparseQp::add_jacobian_transposed(const Data& qp, const double* y, double* x) const noexcept {
  const auto& J = nlp_->jacobian();
  for (int c = 0; c < n_; ++c)
    for (int k = J.starts[c]; k < J.starts[c + 1]; ++k) x[c] += qp.jacobian[k] * y[J.row_indices[k]];
}

void SparseQp::guess_active(const Data& qp, const double* bound_multipliers) {
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

/// Refines `d_` and `lambda_` until the equations are satisfied. With large weights their residual can be small
/// relative to the whole system and still too large for the next iterate. False if they cannot be satisfied: equations
/// that contradict the active bounds yield huge multipliers, relative to which the residual looks small.
bool SparseQp::meet_equations(const Data& qp) {
  const auto unmet = [&] {
    multiply_jacobian(qp, d_.data(), work_m_.data());
    double largest = 0.0;
    for (int r = 0; r < m_; ++r) largest = std::max(largest, std::abs(work_m_[r] + qp.constraints[r]));
    return largest;
  };
  const double size = max_abs(qp.constraints, m_), well_met = least_reduction * size + rounding_of_equations;
  double remaining = unmet();
  for (int round = 0; round < equation_refinements && !(remaining <= well_met); ++round) {
    std::fill_n(rhs_.data(), n_, 0.0);
    for (int r = 0; r < m_; ++r) rhs_[n_ + r] = -qp.constraints[r] - work_m_[r];
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
  int released_before = 0, peeled = 0;  // peeled: consecutive rounds that added no bound
  for (int round = 0; round < rounds; ++round) {
    if (!factor_with(qp)) return qp.is_convex ? ActiveSet::unknown : ActiveSet::indefinite;
    const auto value_at = [&](int k) { return active_[k] == 1 ? qp.upper[k] : qp.lower[k]; };
    // Contribution of the fixed variables to the other rows.
    for (int k = 0; k < n_; ++k) d_[k] = active_[k] != 0 ? value_at(k) : 0.0;
    multiply_hessian(qp, d_.data(), mu_.data());
    multiply_jacobian(qp, d_.data(), work_m_.data());
    for (int k = 0; k < n_; ++k) rhs_[k] = active_[k] != 0 ? d_[k] : -qp.gradient[k] - mu_[k];
    for (int r = 0; r < m_; ++r) rhs_[n_ + r] = -qp.constraints[r] - work_m_[r];
    if (solve_system() > believable) return ActiveSet::unknown;
    std::copy_n(solution_.data(), n_, d_.data());
    std::copy_n(solution_.data() + n_, m_, lambda_.data());
    if (!meet_equations(qp)) return ActiveSet::unknown;
    multiply_hessian(qp, d_.data(), mu_.data());
    for (int k = 0; k < n_; ++k) mu_[k] += qp.gradient[k];
    const double gradient_size = 1.0 + max_abs(mu_.data(), n_);
    add_jacobian_transposed(qp, lambda_.data(), mu_.data());
    const double step_size = 1.0 + max_abs(d_.data(), n_);
    bool settled = true;
    int added = 0, released = 0;
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
  guess_active(qp, bound_multipliers);
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

/// Mehrotra's predictor-corrector method [8]. With a penalty the equations are J d + c = p - q with p, q > 0 and the
/// cost penalty * sum(p + q); the multipliers of p and q are penalty - lambda and penalty + lambda.
SparseQp::Outcome SparseQp::interior_point(const Data& qp, double penalty, Clock::time_point deadline) {
  used_interior_point_ = true;
  for (int k = 0; k < n_; ++k) active_[k] = qp.lower[k] == qp.upper[k] ? 2 : 0;
  const double gradient_size = 1.0 + max_abs(qp.gradient, n_);
  start_interior(qp, penalty, std::clamp(0.1 * gradient_size, 1e-2, 1e4));
  const double constraint_size = 1.0 + max_abs(qp.constraints, m_);
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
    double mu = 0.0, dual_error = 0.0;
    std::copy(dual_residual_.begin(), dual_residual_.end(), mu_.begin());
    for (const Pair& pair : pairs_) {
      mu += pair.s * pair.z;
      switch (pair.kind) {
        case Pair::Kind::lower:
          mu_[pair.index] -= pair.z;
          break;
        case Pair::Kind::upper:
          mu_[pair.index] += pair.z;
          break;
        case Pair::Kind::excess:
          primal_residual_[pair.index] -= pair.s;
          break;
        case Pair::Kind::lack:
          primal_residual_[pair.index] += pair.s;
          break;
      }
    }
    for (int k = 0; k < n_; ++k)
      if (active_[k] == 0) dual_error = std::max(dual_error, std::abs(mu_[k]));
    if (!pairs_.empty()) mu /= static_cast<double>(pairs_.size());
    const double residual =
        std::max({max_abs(primal_residual_.data(), m_) / constraint_size, dual_error / terms, mu / terms});
    if (residual < interior_tolerance) break;
    no_progress = residual < 0.9 * best_residual ? 0 : no_progress + 1;
    if (residual < best_residual && residual < good_enough_interior) {
      best_d_ = d_;
      best_lambda_ = lambda_;
      best_pairs_ = pairs_;
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
      std::swap(dual_residual_, best_dual_residual_);
      break;
    }

    std::fill(primal_.begin(), primal_.end(), 0.0);
    std::fill(dual_.begin(), dual_.end(), 0.0);
    for (const Pair& pair : pairs_) {
      if (pair.is_bound()) {
        primal_[pair.index] += pair.z / pair.s;
      } else {
        dual_[pair.index] += pair.s / pair.z;
      }
    }
    // Where bounds limit a direction of negative curvature, the barrier terms make the matrix convex enough.
    if (!factor_with(qp)) return qp.is_convex ? Outcome::failed : Outcome::indefinite;
    double target = 0.0;
    if (!pairs_.empty()) {
      interior_direction(0.0);
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
    interior_direction(target);
    // With a quadratic cost, one common step length reduces primal and dual residuals together.
    const double length = interior_length(to_the_boundary);
    for (int k = 0; k < n_; ++k) d_[k] += length * solution_[k];
    for (int r = 0; r < m_; ++r) lambda_[r] += length * solution_[n_ + r];
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
  if (penalty == 0.0) return;
  multiply_jacobian(qp, d_.data(), primal_residual_.data());
  for (int r = 0; r < m_; ++r) {
    const double value = primal_residual_[r] + qp.constraints[r], excess = std::max(value, 0.0) + 0.1;
    pairs_.push_back({Pair::Kind::excess, r, excess, penalty});
    pairs_.push_back({Pair::Kind::lack, r, excess - value, penalty});
  }
}

/// Newton direction towards s z = target, less the pair's second-order correction, for every pair. `solution_` gets the
/// directions of d and lambda.
void SparseQp::interior_direction(double target) {
  for (int k = 0; k < n_; ++k) rhs_[k] = active_[k] == 2 ? 0.0 : -dual_residual_[k];
  for (int r = 0; r < m_; ++r) rhs_[n_ + r] = -primal_residual_[r];
  for (const Pair& pair : pairs_) {
    const double wanted = target - pair.correction;
    switch (pair.kind) {
      case Pair::Kind::lower:
        rhs_[pair.index] += wanted / pair.s;
        break;
      case Pair::Kind::upper:
        rhs_[pair.index] -= wanted / pair.s;
        break;
      case Pair::Kind::excess:
        rhs_[n_ + pair.index] += wanted / pair.z - pair.s;
        break;
      case Pair::Kind::lack:
        rhs_[n_ + pair.index] -= wanted / pair.z - pair.s;
        break;
    }
  }
  solve_system();
  for (Pair& pair : pairs_) {
    const double wanted = target - pair.correction;
    if (pair.is_bound()) {
      pair.ds = pair.kind == Pair::Kind::lower ? solution_[pair.index] : -solution_[pair.index];
      pair.dz = (wanted - pair.z * pair.ds) / pair.s - pair.z;
    } else {
      pair.dz = pair.kind == Pair::Kind::lack ? solution_[n_ + pair.index] : -solution_[n_ + pair.index];
      pair.ds = (wanted - pair.s * pair.dz) / pair.z - pair.s;
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
      if (pair.z > pair.s) active_[pair.index] = pair.kind == Pair::Kind::lower ? -1 : 1;
    const ActiveSet found = solve_active(qp, polishing_rounds);
    if (found == ActiveSet::optimal || found == ActiveSet::feasible) return;
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

bool SparseQp::correct(const Data& qp, const double* constraints, double* step) {
  if (!factor_is_final_) {
    std::fill(primal_.begin(), primal_.end(), 0.0);
    std::fill(dual_.begin(), dual_.end(), 0.0);
    if (!factor_with(qp)) return false;
    factor_is_final_ = true;
  }
  std::fill_n(rhs_.data(), n_, 0.0);
  for (int r = 0; r < m_; ++r) rhs_[n_ + r] = -constraints[r];
  if (solve_system() > believable) return false;
  std::copy_n(solution_.data(), n_, step);
  return true;
}

}  // namespace rhec::sparse_sqp
