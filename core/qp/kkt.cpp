#include "rhec/core/qp/kkt.hpp"

#include <algorithm>
#include <cmath>

#include "qp_view.hpp"
#include "rhec/core/base/assertion.hpp"
#include "rhec/core/base/infinity.hpp"
#include "rhec/core/kernels/kernel_sets.hpp"

namespace rhec {

double KktResidual::largest() const noexcept {
  return std::max({stationarity, defect, bound_violation, complementarity});
}

namespace {

/// Column `c` of stage i's AB, times the next node's costate.
double pull_of(const StageQp& qp, int i, int c, const double* costate) noexcept {
  const double* AB = qp.AB(i) + c;
  double sum = 0.0;
  for (int r = 0; r < qp.states(i + 1); ++r) sum += AB[r * qp.stride()] * costate[r];
  return sum;
}

/// The same for column `c` of its G, times the multipliers of its limits.
double pull_of_limits(const StageQp& qp, int i, int c, const double* multipliers) noexcept {
  const double* G = qp.G(i) + c;
  double sum = 0.0;
  for (int r = 0; r < qp.limits(i); ++r) sum += G[r * qp.stride()] * multipliers[r];
  return sum;
}

/// Keeps NaN.
void take(double& largest, double value) noexcept {
  if (!std::isnan(largest) && !(value <= largest)) largest = value;
}

/// One side of a limit: `excess` is the distance beyond it, `pull` its multiplier in this direction.
void add_side(double excess, double pull, double linear, double quadratic, KktTerms& terms) noexcept {
  if (!(excess > -infinity)) {  // no limit on this side
    take(terms.complementarity, pull);
    return;
  }
  // As for bounds: the complementarity of a multiplier is at most the multiplier itself.
  const auto product = [](double multiplier, double distance) { return multiplier * std::min(1.0, distance); };
  const double slack = linear < infinity ? std::max(0.0, excess) : 0.0;
  take(terms.bound_violation, excess - slack);
  if (linear < infinity) {
    const double rest = linear + quadratic * slack - pull;  // multiplier of sigma >= 0
    take(terms.stationarity, -rest);
    take(terms.complementarity, product(std::max(0.0, rest), slack));
  }
  take(terms.complementarity, product(pull, std::abs(excess - slack)));
}

/// What the kernel gives, for a stage with limits.
void add_limited_stage(const StageQp& qp, const Iterate& iterate, int i, KktTerms& terms) noexcept {
  const int ns = qp.capacity().states;
  const bool is_last = i == qp.intervals();
  const auto add_column = [&](int c, double costate) {
    const double gradient = qp.h(i)[c], bound = iterate.bound_row(i)[c];
    double sum = gradient + bound - costate + pull_of_limits(qp, i, c, iterate.limit_bound(i));
    if (!is_last) sum += pull_of(qp, i, c, iterate.costate(i + 1));
    take(terms.stationarity, std::abs(sum));
    for (const double term : {gradient, bound, costate}) take(terms.largest_term, std::abs(term));
    const double lower = qp.lower(i)[c], upper = qp.upper(i)[c];
    take(terms.bound_violation, std::max(lower, -upper));
    take(terms.complementarity, std::abs(bound) * std::min(1.0, std::abs(bound > 0.0 ? upper : lower)));
  };
  for (int j = 0; j < qp.states(i); ++j) {
    add_column(j, iterate.costate(i)[j]);
    if (i == 0 && !qp.initial_state_is_given) take(terms.stationarity, std::abs(iterate.costate(0)[j]));
  }
  for (int j = 0; j < qp.controls(i); ++j) add_column(ns + j, 0.0);
  for (int j = 0; !is_last && j < qp.states(i + 1); ++j) take(terms.defect, std::abs(qp.b(i)[j]));
  for (int r = 0; r < qp.limits(i); ++r) {
    const double multiplier = iterate.limit_bound(i)[r];
    const double linear = qp.limit_linear(i)[r], quadratic = qp.limit_quadratic(i)[r];
    take(terms.largest_term, std::abs(multiplier));
    add_side(-qp.limit_upper(i)[r], std::max(0.0, multiplier), linear, quadratic, terms);
    add_side(qp.limit_lower(i)[r], std::max(0.0, -multiplier), linear, quadratic, terms);
    if (std::isnan(multiplier)) terms.stationarity = multiplier;
  }
}

}  // namespace

void KktTerms::add(const KktTerms& others) noexcept {
  take(stationarity, others.stationarity);
  take(defect, others.defect);
  take(bound_violation, others.bound_violation);
  take(complementarity, others.complementarity);
  take(largest_term, others.largest_term);
}

void KktTerms::add(const StageQp& qp, const Iterate& iterate, StageRange range) noexcept {
  RHEC_ASSERT(qp.capacity() == iterate.capacity(), "an iterate of the QP's capacity");
  RHEC_ASSERT(range.first >= 0 && range.last <= qp.intervals(), "stages of the QP");
  KktTerms found;
  if (qp.has_limits()) {
    for (int i = range.first; i <= range.last; ++i) add_limited_stage(qp, iterate, i, found);
  } else {
    QpView view = view_of(qp, iterate);
    view.first = range.first;
    view.last = range.last;
    const KktParts parts = qp_kernels().kkt(view);
    found = {parts.stationarity, parts.defect, parts.bound_violation, parts.complementarity, parts.largest_term};
  }
  if (range.first == 0 && qp.initial_state_is_given)
    for (int j = 0; j < qp.states(0); ++j) found.defect = std::max(found.defect, std::abs(qp.initial_step()[j]));
  add(found);
}

KktResidual KktTerms::residual() const noexcept {
  const double size = 1.0 + largest_term;
  return {stationarity / size, defect, bound_violation, complementarity / size};
}

KktResidual kkt_residual(const StageQp& qp, const Iterate& iterate) noexcept {
  KktTerms terms;
  terms.add(qp, iterate, {0, qp.intervals()});
  return terms.residual();
}

void set_costates(const StageQp& qp, Iterate& iterate) noexcept {
  const int N = qp.intervals();
  for (int i = N; i >= 0; --i) {
    double* costate = iterate.costate(i);
    for (int j = 0; j < qp.states(i); ++j) {
      costate[j] = qp.q(i)[j] + iterate.state_bound(i)[j] + pull_of_limits(qp, i, j, iterate.limit_bound(i));
      if (i < N) costate[j] += pull_of(qp, i, j, iterate.costate(i + 1));
    }
  }
  if (!qp.initial_state_is_given) std::fill_n(iterate.costate(0), qp.states(0), 0.0);
}

}  // namespace rhec
