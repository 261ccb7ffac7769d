#include "rhec/core/kkt.hpp"

#include <algorithm>
#include <cmath>

#include "kernels/kernels.hpp"
#include "program_view.hpp"

namespace rhec {

double KktResidual::largest() const noexcept {
  return std::max({stationarity, defect, bound_violation, complementarity});
}

namespace {

/// Column `c` of stage i's F, times the next node's costate.
double pull_of(const StageQp& qp, int i, int c, const double* costate) noexcept {
  const double* F = qp.F(i) + c;
  double sum = 0.0;
  for (int r = 0; r < qp.states(i + 1); ++r) sum += F[r * qp.stride()] * costate[r];
  return sum;
}

}  // namespace

void KktTerms::add(const KktTerms& others) noexcept {
  // What is no number must not get lost.
  const auto take = [](double& largest, double value) {
    if (!std::isnan(largest) && !(value <= largest)) largest = value;
  };
  take(stationarity, others.stationarity);
  take(defect, others.defect);
  take(bound_violation, others.bound_violation);
  take(complementarity, others.complementarity);
  take(largest_term, others.largest_term);
}

void KktTerms::add(const StageQp& qp, const Iterate& point, StageRange range) noexcept {
  ProgramView view = view_of(qp, point);
  view.first = range.first;
  view.last = range.last;
  const KktParts parts = program_kernels().kkt(view);
  KktTerms found{parts.stationarity, parts.defect, parts.bound_violation, parts.complementarity, parts.largest_term};
  if (range.first == 0 && qp.initial_state_is_given)
    for (int j = 0; j < qp.states(0); ++j) found.defect = std::max(found.defect, std::abs(qp.initial_step()[j]));
  add(found);
}

KktResidual KktTerms::residual() const noexcept {
  const double size = 1.0 + largest_term;
  return {stationarity / size, defect, bound_violation, complementarity / size};
}

KktResidual kkt_residual(const StageQp& qp, const Iterate& point) noexcept {
  KktTerms terms;
  terms.add(qp, point, {0, qp.intervals()});
  return terms.residual();
}

KktResidual kkt_residual(const Ocp& ocp, const Iterate& point, StageQp& qp, std::span<double> scratch) noexcept {
  ocp.linearise(all_stages(ocp), point, Hessian::none, qp, scratch);
  return kkt_residual(qp, point);
}

void set_costates(const StageQp& qp, Iterate& point) noexcept {
  const int N = qp.intervals();
  for (int i = N; i >= 0; --i) {
    double* costate = point.costate(i);
    for (int j = 0; j < qp.states(i); ++j) {
      costate[j] = qp.q(i)[j] + point.state_bound(i)[j];
      if (i < N) costate[j] += pull_of(qp, i, j, point.costate(i + 1));
    }
  }
  if (!qp.initial_state_is_given) std::fill_n(point.costate(0), qp.states(0), 0.0);
}

void roll_out(const Ocp& ocp, Iterate& point, std::span<double> scratch) noexcept {
  for (int i = 0; i < ocp.intervals(); ++i)
    for (int j = 0; j < ocp.control_count(i); ++j)
      point.control(i)[j] = std::min(std::max(point.control(i)[j], ocp.control_lower(i)[j]), ocp.control_upper(i)[j]);
  if (ocp.initial_state()) {
    std::copy_n(ocp.initial_state(), ocp.state_count(0), point.state(0));
  } else {
    for (int j = 0; j < ocp.state_count(0); ++j)
      point.state(0)[j] = std::min(std::max(point.state(0)[j], ocp.state_lower(0)[j]), ocp.state_upper(0)[j]);
  }
  ocp.simulate(point, scratch);
}

}  // namespace rhec
