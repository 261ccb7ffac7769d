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

constexpr int columns_at_once = 8;  // divides the length of a row

/// Column `c` of stage i's AB, times the next node's costate.
double pull_of(const StageQp& qp, int i, int c, const double* costate) noexcept {
  const double* AB = qp.AB(i) + c;
  double sum = 0.0;
  for (int r = 0; r < qp.states(i + 1); ++r) sum += AB[r * qp.stride()] * costate[r];
  return sum;
}

/// The same for column `c` of its G, times the multipliers of its limits.
double pull_of_limits(const StageQp& qp, int i, int c, const double* multipliers) noexcept {
  const double* G = qp.G(i);  // null where there are no limits, so that it has no column
  double sum = 0.0;
  for (int r = 0; r < qp.limits(i); ++r) sum += G[r * qp.stride() + c] * multipliers[r];
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

/// h - costates + AB' next costates + G' multipliers of limits, eight columns of a stage from `first` on.
void gradient_of(const StageQp& qp, const Iterate& iterate, int i, int first, double* sums) noexcept {
  const int stride = qp.stride(), ns = qp.capacity().states;
  std::copy_n(qp.h(i) + first, columns_at_once, sums);
  for (int j = first; j < std::min(ns, first + columns_at_once); ++j) sums[j - first] -= iterate.costate(i)[j];
  const auto add_rows = [&](const double* rows, const double* factors, int count) {
    for (int r = 0; r < count; ++r, rows += stride)
      for (int c = 0; c < columns_at_once; ++c) sums[c] += rows[c] * factors[r];
  };
  if (i < qp.intervals()) add_rows(qp.AB(i) + first, iterate.costate(i + 1), qp.states(i + 1));
  add_rows(qp.G(i) + first, iterate.limit_bound(i), qp.limits(i));
}

/// What the kernel gives, for a stage whose limits have multipliers.
void add_pulled_stage(const StageQp& qp, const Iterate& iterate, int i, KktTerms& terms) noexcept {
  const int ns = qp.capacity().states;
  const double *h = qp.h(i), *bounds = iterate.bound_row(i), *lower = qp.lower(i), *upper = qp.upper(i);
  const double* costates = iterate.costate(i);
  double sums[columns_at_once];
  int summed = -columns_at_once;  // the first column of the sums
  // Comparisons lose NaN, a sum does not.
  double stationarity = 0.0, largest_term = 0.0, all = 0.0, violation = -infinity;
  const auto add_column = [&](int c, double costate) {
    if (c >= summed + columns_at_once) gradient_of(qp, iterate, i, summed = c - c % columns_at_once, sums);
    const double bound = bounds[c], sum = std::abs(sums[c - summed] + bound);
    all += sum;
    stationarity = std::max(stationarity, sum);
    largest_term = std::max(largest_term, std::max(std::abs(h[c]), std::abs(costate)));
    violation = std::max(violation, std::max(lower[c], -upper[c]));
    if (bound == 0.0) return;
    largest_term = std::max(largest_term, std::abs(bound));
    take(terms.complementarity, std::abs(bound) * std::min(1.0, std::abs(bound > 0.0 ? upper[c] : lower[c])));
  };
  for (int j = 0; j < qp.states(i); ++j) {
    add_column(j, costates[j]);
    if (i == 0 && !qp.initial_state_is_given) stationarity = std::max(stationarity, std::abs(costates[j]));
  }
  for (int j = 0; j < qp.controls(i); ++j) add_column(ns + j, 0.0);
  take(terms.stationarity, std::isnan(all) ? all : stationarity);
  take(terms.largest_term, largest_term);
  take(terms.bound_violation, violation);
  for (int j = 0; i < qp.intervals() && j < qp.states(i + 1); ++j) take(terms.defect, std::abs(qp.b(i)[j]));
}

/// Returns whether any limit of the stage has a multiplier.
bool add_limits(const StageQp& qp, const Iterate& iterate, int i, KktTerms& terms) noexcept {
  const double *most = qp.limit_upper(i), *least = qp.limit_lower(i), *multipliers = iterate.limit_bound(i);
  const double *linear = qp.limit_linear(i), *quadratic = qp.limit_quadratic(i);
  bool any_pulls = false;
  for (int r = 0; r < qp.limits(i); ++r) {
    const double multiplier = multipliers[r];
    if (multiplier == 0.0 && least[r] <= 0.0 && most[r] >= 0.0) continue;  // met, without a multiplier
    any_pulls |= multiplier != 0.0;
    take(terms.largest_term, std::abs(multiplier));
    add_side(-most[r], std::max(0.0, multiplier), linear[r], quadratic[r], terms);
    add_side(least[r], std::max(0.0, -multiplier), linear[r], quadratic[r], terms);
    if (std::isnan(multiplier)) terms.stationarity = multiplier;
  }
  return any_pulls;
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
  const auto add_others = [&](int first, int last) {
    if (first > last) return;
    QpView view = view_of(qp, iterate);
    view.first = first;
    view.last = last;
    const KktParts parts = qp_kernels().kkt(view);
    found.add({parts.stationarity, parts.defect, parts.bound_violation, parts.complementarity, parts.largest_term});
  };
  int first = range.first;
  for (int i = range.first; qp.has_limits() && i <= range.last; ++i) {
    if (!add_limits(qp, iterate, i, found)) continue;
    add_others(first, i - 1);
    add_pulled_stage(qp, iterate, i, found);
    first = i + 1;
  }
  add_others(first, range.last);
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
