#include "support/qp_conditions.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

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
