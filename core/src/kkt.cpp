#include "rhec/core/kkt.hpp"

#include <algorithm>
#include <cmath>

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

double max_abs(const double* v, int n, double so_far) noexcept {
  for (int j = 0; j < n; ++j) so_far = std::max(so_far, std::abs(v[j]));
  return so_far;
}

/// Violation of bounds on a step of zero, and complementarity of the multipliers, against them.
void check_bounds(const double* lower, const double* upper, const double* multipliers, int n,
                  KktResidual& kkt) noexcept {
  for (int j = 0; j < n; ++j) {
    kkt.bound_violation = std::max({kkt.bound_violation, lower[j], -upper[j]});
    const double gap = multipliers[j] > 0.0 ? std::abs(upper[j]) : multipliers[j] < 0.0 ? std::abs(lower[j]) : 0.0;
    if (multipliers[j] == 0.0) continue;
    // A multiplier at a bound that does not exist is as wrong as it is large.
    kkt.complementarity = std::max(kkt.complementarity, std::abs(multipliers[j]) * std::min(gap, 1.0));
  }
}

}  // namespace

KktResidual kkt_residual(const StageQp& qp, const Iterate& point) noexcept {
  KktResidual kkt;
  const int N = qp.intervals(), ns = qp.capacity().states;
  double largest_term = 0.0;
  for (int i = 0; i <= N; ++i) {
    const int n = qp.states(i), m = qp.controls(i);
    const int n_next = i < N ? qp.states(i + 1) : 0;
    const double *costate = point.costate(i), *bound = point.state_bound(i);
    largest_term = max_abs(bound, n, max_abs(costate, n, max_abs(qp.q(i), n, largest_term)));
    for (int j = 0; j < n; ++j) {
      double sum = qp.q(i)[j] + bound[j] - costate[j];
      if (i < N) sum += pull_of(qp, i, j, point.costate(i + 1));
      kkt.stationarity = std::max(kkt.stationarity, std::abs(sum));
    }
    check_bounds(qp.state_lower(i), qp.state_upper(i), bound, n, kkt);
    if (i == N) break;
    largest_term = max_abs(point.control_bound(i), m, max_abs(qp.r(i), m, largest_term));
    for (int j = 0; j < m; ++j)
      kkt.stationarity =
          std::max(kkt.stationarity, std::abs(qp.r(i)[j] + point.control_bound(i)[j] +
                                              pull_of(qp, i, ns + j, point.costate(i + 1))));
    check_bounds(qp.control_lower(i), qp.control_upper(i), point.control_bound(i), m, kkt);
    kkt.defect = max_abs(qp.b(i), n_next, kkt.defect);
  }
  if (qp.initial_state_is_given) kkt.defect = max_abs(qp.initial_step(), qp.states(0), kkt.defect);
  if (!qp.initial_state_is_given) kkt.stationarity = max_abs(point.costate(0), qp.states(0), kkt.stationarity);
  kkt.stationarity /= 1.0 + largest_term;
  kkt.complementarity /= 1.0 + largest_term;
  return kkt;
}

KktResidual kkt_residual(const Ocp& ocp, const Iterate& point, StageQp& qp, std::span<double> scratch) noexcept {
  ocp.linearise(all_stages(ocp), point, Hessian::gauss_newton, qp, scratch);
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
