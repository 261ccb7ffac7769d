#include "rhec/core/qp/kkt.hpp"

#include <algorithm>
#include <cmath>

#include "qp_view.hpp"
#include "rhec/core/base/assertion.hpp"
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

}  // namespace

void KktTerms::add(const KktTerms& others) noexcept {
  // NaN must be kept.
  const auto take = [](double& largest, double value) {
    if (!std::isnan(largest) && !(value <= largest)) largest = value;
  };
  take(stationarity, others.stationarity);
  take(defect, others.defect);
  take(bound_violation, others.bound_violation);
  take(complementarity, others.complementarity);
  take(largest_term, others.largest_term);
}

void KktTerms::add(const StageQp& qp, const Iterate& iterate, StageRange range) noexcept {
  RHEC_ASSERT(qp.capacity() == iterate.capacity(), "an iterate of the QP's capacity");
  RHEC_ASSERT(range.first >= 0 && range.last <= qp.intervals(), "stages of the QP");
  QpView view = view_of(qp, iterate);
  view.first = range.first;
  view.last = range.last;
  const KktParts parts = qp_kernels().kkt(view);
  KktTerms found{parts.stationarity, parts.defect, parts.bound_violation, parts.complementarity, parts.largest_term};
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
      costate[j] = qp.q(i)[j] + iterate.state_bound(i)[j];
      if (i < N) costate[j] += pull_of(qp, i, j, iterate.costate(i + 1));
    }
  }
  if (!qp.initial_state_is_given) std::fill_n(iterate.costate(0), qp.states(0), 0.0);
}

}  // namespace rhec
