#include "support/qp_conditions.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <limits>

namespace rhec::testing {

double kkt_violation(const StageQp& qp, const Iterate& step) {
  double worst = 0.0;
  const int N = qp.intervals();
  for (int i = 0; i <= N; ++i) {
    const Eigen::Map<const Eigen::VectorXd> s(step.state(i), qp.states(i)),
        w(step.control(i < N ? i : 0), qp.controls(i));
    Eigen::VectorXd by_state = Q_of(qp, i) * s + q_of(qp, i);
    Eigen::VectorXd by_control = Eigen::VectorXd::Zero(qp.controls(i));
    if (i < N) {
      const Eigen::Map<const Eigen::VectorXd> costate(step.costate(i + 1), qp.states(i + 1));
      by_state += S_of(qp, i).transpose() * w + A_of(qp, i).transpose() * costate;
      by_control = R_of(qp, i) * w + S_of(qp, i) * s + r_of(qp, i) + B_of(qp, i).transpose() * costate;
      const Eigen::Map<const Eigen::VectorXd> next(step.state(i + 1), qp.states(i + 1));
      worst = std::max(worst, (A_of(qp, i) * s + B_of(qp, i) * w + b_of(qp, i) - next).lpNorm<Eigen::Infinity>());
    }
    for (int r = 0; qp.has_limits() && r < qp.limits(i); ++r) {
      const double* row = qp.G(i) + r * qp.stride();
      const int ns = qp.capacity().states;
      const double multiplier = step.limit_bound(i)[r], linear = qp.limit_linear(i)[r];
      double value = 0.0;
      for (int j = 0; j < qp.states(i); ++j) value += row[j] * s[j], by_state[j] += row[j] * multiplier;
      for (int j = 0; j < qp.controls(i); ++j) value += row[ns + j] * w[j], by_control[j] += row[ns + j] * multiplier;
      const double above = value - qp.limit_upper(i)[r], below = qp.limit_lower(i)[r] - value;
      const double excess = std::max({0.0, above, below});
      if (std::isinf(linear)) worst = std::max(worst, excess);
      if (std::isfinite(linear)) {
        // The multiplier is a subgradient of what the slack costs.
        const double most = linear + qp.limit_quadratic(i)[r] * excess;
        worst = std::max(worst, std::abs(multiplier) - most);
        if (excess > 1e-7) worst = std::max(worst, std::abs(multiplier - std::copysign(most, above - below)));
      }
      if (multiplier > 0.0) worst = std::max(worst, multiplier * std::min(1.0, std::max(0.0, -above)));
      if (multiplier < 0.0) worst = std::max(worst, -multiplier * std::min(1.0, std::max(0.0, -below)));
    }
    const auto check = [&](double gradient, double multiplier, double value, double lower, double upper) {
      worst = std::max({worst, std::abs(gradient + multiplier), lower - value, value - upper});
      if (multiplier > 0.0) worst = std::max(worst, multiplier * std::min(1.0, std::abs(upper - value)));
      if (multiplier < 0.0) worst = std::max(worst, -multiplier * std::min(1.0, std::abs(lower - value)));
    };
    for (int j = 0; j < qp.states(i); ++j)
      check(by_state[j] - step.costate(i)[j], step.state_bound(i)[j], s[j],
            i == 0 && qp.initial_state_is_given ? -1e9 : qp.state_lower(i)[j],
            i == 0 && qp.initial_state_is_given ? 1e9 : qp.state_upper(i)[j]);
    for (int j = 0; j < qp.controls(i); ++j)
      check(by_control[j], step.control_bound(i)[j], w[j], qp.control_lower(i)[j], qp.control_upper(i)[j]);
  }
  return worst;
}

StageQp limited_qp(RandomQp& random, bool given, const LimitFamily& family) {
  const StageQp bounded = feasible_qp(random, given, family.room);
  Capacity capacity = bounded.capacity();
  capacity.limits = random.integer(1, 5);
  StageQp qp(capacity);
  qp.set_intervals(bounded.intervals());
  qp.initial_state_is_given = given;
  std::copy_n(bounded.initial_step(), bounded.states(0), qp.initial_step());
  for (int i = 0; i <= qp.intervals(); ++i) qp.set_sizes(i, bounded.states(i), bounded.controls(i));
  Eigen::VectorXd s = Eigen::Map<const Eigen::VectorXd>(qp.initial_step(), bounded.states(0));
  for (int i = 0; i <= qp.intervals(); ++i) {
    const int ns = capacity.states, n = bounded.states(i), m = bounded.controls(i);
    std::copy_n(bounded.H(i), (ns + m) * qp.stride(), qp.H(i));
    std::copy_n(bounded.h(i), qp.stride(), qp.h(i));
    std::copy_n(bounded.lower(i), qp.stride(), qp.lower(i));
    std::copy_n(bounded.upper(i), qp.stride(), qp.upper(i));
    if (i < qp.intervals()) {
      std::copy_n(bounded.AB(i), ns * qp.stride(), qp.AB(i));
      std::copy_n(bounded.b(i), qp.stride(), qp.b(i));
    }
    // Some point within the bounds of the controls, so that the limits have room around a trajectory.
    Eigen::VectorXd w(m);
    for (int j = 0; j < m; ++j) {
      const double lower = std::max(qp.control_lower(i)[j], -1.0), upper = std::min(qp.control_upper(i)[j], 1.0);
      w[j] = 0.5 * (lower + upper);
    }
    if (!family.has_state_bounds)
      for (int j = 0; j < n; ++j) {
        qp.state_lower(i)[j] = -std::numeric_limits<double>::infinity();
        qp.state_upper(i)[j] = std::numeric_limits<double>::infinity();
      }
    const int limits = random.integer(0, capacity.limits);
    qp.set_limits(i, limits);
    for (int r = 0; r < limits; ++r) {
      double* row = qp.G(i) + r * qp.stride();
      const double kind = random.uniform(0.0, 1.0);
      double value = 0.0;
      if (r > 0 && kind < family.dependent) {
        std::copy_n(row - qp.stride(), qp.stride(), row);
      } else if (kind < 0.97) {
        for (int j = 0; kind < 0.7 && j < n; ++j) row[j] = random.uniform(-1.0, 1.0);
        for (int j = 0; (kind < 0.4 || kind > 0.7) && j < m; ++j) row[ns + j] = random.uniform(-1.0, 1.0);
      }
      for (int j = 0; j < n; ++j) value += row[j] * s[j];
      for (int j = 0; j < m; ++j) value += row[ns + j] * w[j];
      const bool is_soft = random.uniform(0.0, 1.0) < family.soft;
      const double off = is_soft ? random.uniform(-1.0, 1.0) : 0.0;
      qp.limit_lower(i)[r] = qp.limit_upper(i)[r] = value + off;
      if (random.uniform(0.0, 1.0) > family.equalities) {
        const double width = random.uniform(0.0, 1.0);
        qp.limit_lower(i)[r] -=
            width < 0.3 ? std::numeric_limits<double>::infinity() : random.uniform(0.0, family.room);
        qp.limit_upper(i)[r] +=
            width > 0.7 ? std::numeric_limits<double>::infinity() : random.uniform(0.0, family.room);
      }
      qp.limit_linear(i)[r] = is_soft ? random.uniform(0.0, 2.0) : std::numeric_limits<double>::infinity();
      if (is_soft && random.uniform(0.0, 1.0) < 0.6) qp.limit_quadratic(i)[r] = random.uniform(0.1, 5.0);
      if (is_soft && qp.limit_quadratic(i)[r] > 0.0 && random.uniform(0.0, 1.0) < 0.2) qp.limit_linear(i)[r] = 0.0;
    }
    if (i < qp.intervals()) s = A_of(qp, i) * s + B_of(qp, i) * w + b_of(qp, i);
  }
  return qp;
}

StageQp bounded_qp(RandomQp& random, bool given, double tightness) {
  StageQp qp = random.make(random.integer(2, 15), random.integer(1, 5), random.integer(1, 4), given);
  for (int i = 0; i <= qp.intervals(); ++i) {
    for (int j = 0; j < qp.controls(i); ++j) {
      qp.control_lower(i)[j] = -random.uniform(0.1, 1.0) * tightness;
      qp.control_upper(i)[j] = random.uniform(0.1, 1.0) * tightness;
    }
    // Wide enough that some trajectory satisfies them.
    for (int j = 0; j < qp.states(i); ++j) {
      qp.state_lower(i)[j] = -4.0;
      qp.state_upper(i)[j] = 4.0;
    }
    for (int j = 0; i < qp.intervals() && j < qp.states(i + 1); ++j) qp.b(i)[j] *= 0.3;
  }
  return qp;
}

StageQp feasible_qp(RandomQp& random, bool given, double room) {
  StageQp qp = random.make(random.integer(2, 15), random.integer(1, 5), random.integer(1, 4), given);
  Eigen::VectorXd s = Eigen::Map<const Eigen::VectorXd>(qp.initial_step(), qp.states(0));
  const auto bound = [&](double value, double& lower, double& upper) {
    if (random.uniform(0.0, 1.0) < 0.8) lower = value - random.uniform(0.0, room);
    if (random.uniform(0.0, 1.0) < 0.8) upper = value + random.uniform(0.0, room);
  };
  for (int i = 0; i <= qp.intervals(); ++i) {
    for (int j = 0; j < qp.states(i); ++j)
      if (random.uniform(0.0, 1.0) < 0.3) bound(s[j], qp.state_lower(i)[j], qp.state_upper(i)[j]);
    if (i == qp.intervals()) break;
    Eigen::VectorXd w(qp.controls(i));
    for (int j = 0; j < qp.controls(i); ++j) {
      w[j] = random.uniform(-1.0, 1.0);
      bound(w[j], qp.control_lower(i)[j], qp.control_upper(i)[j]);
    }
    s = A_of(qp, i) * s + B_of(qp, i) * w + b_of(qp, i);
  }
  return qp;
}

}  // namespace rhec::testing
