#include "support/limited_ocp.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "rhec/core/base/assertion.hpp"

namespace rhec::testing {

double Limit::value(const double* z) const noexcept {
  double sum = kind == Kind::distance ? roundness * roundness : 0.0;
  for (std::size_t k = 0; k < of.size(); ++k) {
    const double entry = z[of[k]];
    if (kind == Kind::linear) sum += with[k] * entry;
    if (kind == Kind::squares) sum += with[k] * entry * entry;
    if (kind == Kind::distance) sum += (entry - with[k]) * (entry - with[k]);
  }
  if (kind == Kind::product) return with[0] * z[of[0]] * z[of[1]];
  return kind == Kind::distance ? std::sqrt(sum) : sum;
}

void Limit::gradient(const double* z, double* derivatives) const noexcept {
  for (std::size_t k = 0; k < of.size(); ++k) {
    const double entry = z[of[k]];
    if (kind == Kind::linear) derivatives[k] = with[k];
    if (kind == Kind::product) derivatives[k] = with[0] * z[of[1 - k]];
    if (kind == Kind::squares) derivatives[k] = 2.0 * with[k] * entry;
    if (kind == Kind::distance) derivatives[k] = (entry - with[k]) / value(z);
  }
}

double Limit::curvature(const double* z, std::size_t j, std::size_t k) const noexcept {
  if (kind == Kind::product) return j == k ? 0.0 : with[0];
  if (kind == Kind::squares) return j == k ? 2.0 * with[k] : 0.0;
  if (kind == Kind::linear) return 0.0;
  const double distance = value(z), to_j = (z[of[j]] - with[j]) / distance, to_k = (z[of[k]] - with[k]) / distance;
  return ((j == k ? 1.0 : 0.0) - to_j * to_k) / distance;
}

LimitedOcp::LimitedOcp(const Ocp& of, int most)
    : SameOcp(of), of_(of), plain_(of.capacity()), plain_qp_(of.capacity()), most_(most) {
  clear_limits();
}

const Iterate& LimitedOcp::without_limits(const Iterate& point) const noexcept {
  const std::ptrdiff_t numbers = static_cast<std::ptrdiff_t>(intervals() + 1) * plain_qp_.stride();
  std::copy_n(point.row(0), numbers, plain_.row(0));
  std::copy_n(point.costate(0), numbers, plain_.costate(0));
  return plain_;
}

double LimitedOcp::evaluate_stages(const Iterate& point, double* defects, double* costs,
                                   std::span<double> scratch) const noexcept {
  return of_.evaluate_stages(without_limits(point), defects, costs, scratch);
}

void LimitedOcp::simulate_interval(int interval, Iterate& point, std::span<double> scratch) const noexcept {
  std::copy_n(point.row(interval), plain_qp_.stride(), plain_.row(interval));
  of_.simulate_interval(interval, plain_, scratch);
  std::copy_n(plain_.state(interval + 1), state_count(interval + 1), point.state(interval + 1));
}

Capacity LimitedOcp::capacity() const noexcept {
  Capacity capacity = of_.capacity();
  capacity.limits = most_;
  return capacity;
}

void LimitedOcp::clear_limits() {
  const auto stages = static_cast<std::size_t>(of_.capacity().intervals) + 1;
  limits_.assign(stages, {});
  rows_.assign(stages * 4 * capacity().limit_row(), 0.0);
}

const double* LimitedOcp::row(int stage, int which) const noexcept {
  return rows_.data() + (static_cast<std::ptrdiff_t>(stage) * 4 + which) * capacity().limit_row();
}

void LimitedOcp::add(int stage, const Limit& limit) {
  RHEC_ASSERT(limit_count(stage) < most_, "room for the limit");
  const double numbers[] = {limit.lower, limit.upper, limit.linear_weight, limit.quadratic_weight};
  for (int which = 0; which < 4; ++which) rows_[row(stage, which) - rows_.data() + limit_count(stage)] = numbers[which];
  limits_[stage].push_back(limit);
}

void LimitedOcp::evaluate_limits(const Iterate& point, double* values, std::span<double>) const noexcept {
  for (int i = 0; i <= intervals(); ++i, values += capacity().limit_row())
    for (int r = 0; r < limit_count(i); ++r) values[r] = limits_[i][r].value(point.row(i));
}

void LimitedOcp::mark_limits(int stage, std::uint8_t* states, std::uint8_t* controls) const noexcept {
  const int count = limit_count(stage), ns = of_.capacity().states;
  std::fill_n(states, count * state_count(stage), 0);
  if (stage < intervals()) std::fill_n(controls, count * control_count(stage), 0);
  for (int r = 0; r < count; ++r)
    for (const int k : limits_[stage][r].of) (k < ns ? states + k * count : controls + (k - ns) * count)[r] = 1;
}

double LimitedOcp::linearise(StageRange range, const Iterate& point, Hessian hessian, StageQp& qp,
                             std::span<double> scratch) const noexcept {
  const double objective = of_.linearise(range, without_limits(point), hessian, plain_qp_, scratch);
  const std::ptrdiff_t stride = qp.stride(), ns = of_.capacity().states, wide = ns + of_.capacity().controls;
  qp.set_intervals(plain_qp_.intervals());
  qp.initial_state_is_given = plain_qp_.initial_state_is_given;
  std::copy_n(plain_qp_.initial_step(), stride, qp.initial_step());
  for (int i = range.first; i <= range.last; ++i) {
    qp.set_sizes(i, plain_qp_.states(i), plain_qp_.control_counts()[i], plain_qp_.identity_counts()[i]);
    std::copy_n(plain_qp_.AB(i), ns * stride, qp.AB(i));
    if (hessian != Hessian::none) std::copy_n(plain_qp_.H(i), wide * stride, qp.H(i));
    std::copy_n(plain_qp_.h(i), stride, qp.h(i));
    std::copy_n(plain_qp_.b(i), stride, qp.b(i));
    std::copy_n(plain_qp_.lower(i), stride, qp.lower(i));
    std::copy_n(plain_qp_.upper(i), stride, qp.upper(i));
    const double* z = point.row(i);
    qp.set_limits(i, limit_count(i));
    for (int r = 0; r < limit_count(i); ++r) {
      const Limit& limit = limits_[i][r];
      const double value = limit.value(z);
      qp.limit_lower(i)[r] = limit.lower - value;
      qp.limit_upper(i)[r] = limit.upper - value;
      qp.limit_linear(i)[r] = limit.linear_weight;
      qp.limit_quadratic(i)[r] = limit.quadratic_weight;
      double* G = qp.G(i) + r * stride;
      std::fill_n(G, stride, 0.0);
      double derivatives[16];
      RHEC_ASSERT(limit.of.size() <= std::size(derivatives), "few entries");
      limit.gradient(z, derivatives);
      for (std::size_t k = 0; k < limit.of.size(); ++k) G[limit.of[k]] = derivatives[k];
      if (hessian != Hessian::exact) continue;
      for (std::size_t j = 0; j < limit.of.size(); ++j)
        for (std::size_t k = 0; k < limit.of.size(); ++k)
          qp.H(i)[limit.of[j] * stride + limit.of[k]] += point.limit_bound(i)[r] * limit.curvature(z, j, k);
    }
  }
  return objective;
}

Iterate with_limits(const LimitedOcp& limited, const Iterate& of_other) {
  Iterate point(limited.capacity());
  const std::ptrdiff_t numbers = static_cast<std::ptrdiff_t>(limited.intervals() + 1) * limited.capacity().row();
  std::copy_n(of_other.row(0), numbers, point.row(0));
  std::copy_n(of_other.costate(0), numbers, point.costate(0));
  std::copy_n(of_other.bound_row(0), numbers, point.bound_row(0));
  return point;
}

}  // namespace rhec::testing
