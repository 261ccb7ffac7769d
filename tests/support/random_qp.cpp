#include "support/random_qp.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <limits>

namespace rhec::testing {

StageQp RandomQp::make(int intervals, int states, int controls, bool given) {
  StageQp qp({intervals, states, controls});
  qp.set_intervals(intervals);
  qp.initial_state_is_given = given;
  const double infinity = std::numeric_limits<double>::infinity();
  for (int i = 0; i <= intervals; ++i) {
    const int m = i < intervals ? integer(0, controls) : 0;
    qp.set_sizes(i, states, m);
    const int n = states + m;
    Eigen::MatrixXd root = Eigen::MatrixXd::NullaryExpr(n, n, [&] { return uniform(-1.0, 1.0); });
    const Eigen::MatrixXd H = root * root.transpose() + 0.1 * Eigen::MatrixXd::Identity(n, n);
    Q_of(qp, i) = H.topLeftCorner(states, states);
    S_of(qp, i) = H.bottomLeftCorner(m, states);
    S_transposed_of(qp, i) = H.topRightCorner(states, m);
    R_of(qp, i) = H.bottomRightCorner(m, m);
    for (int c = 0; c < states; ++c) {
      qp.q(i)[c] = uniform(-1.0, 1.0);
      qp.state_lower(i)[c] = -infinity;
      qp.state_upper(i)[c] = infinity;
    }
    for (int c = 0; c < m; ++c) {
      qp.r(i)[c] = uniform(-1.0, 1.0);
      qp.control_lower(i)[c] = -infinity;
      qp.control_upper(i)[c] = infinity;
    }
    if (i == intervals) break;
    // The next stage's size is unknown here, but all stages have the same number of states.
    for (int r = 0; r < states; ++r) {
      double* F = qp.AB(i) + r * qp.stride();
      for (int c = 0; c < states; ++c) F[c] = uniform(-0.6, 0.6);
      for (int c = 0; c < m; ++c) F[states + c] = uniform(-1.0, 1.0);
    }
    for (int k = 0; k < states; ++k) qp.b(i)[k] = uniform(-1.0, 1.0);
  }
  for (int k = 0; k < states; ++k) qp.initial_step()[k] = uniform(-1.0, 1.0);
  return qp;
}

void RandomQp::carry(StageQp& qp, bool says_so) {
  for (int i = 0; i < qp.intervals(); ++i) {
    const int states = qp.states(i), carried = integer(0, 3) == 0 ? 0 : integer(1, std::min(3, states));
    for (int r = states - carried; r < states; ++r) {
      double* F = qp.AB(i) + r * qp.stride();
      std::fill_n(F, qp.stride(), 0.0);
      F[r] = 1.0;
    }
    if (says_so) qp.set_sizes(i, states, qp.controls(i), carried);
  }
}

DenseQp::DenseQp(const StageQp& qp, const ActiveSet& active) {
  const int N = qp.intervals();
  int size = 0;
  for (int i = 0; i <= N; ++i) {
    state_at.push_back(size);
    size += qp.states(i);
    control_at.push_back(size);
    size += qp.controls(i);
  }
  H.setZero(size, size);
  g.setZero(size);
  std::vector<Eigen::VectorXd> rows;
  std::vector<double> right;
  for (int i = 0; i <= N; ++i) {
    const int n = qp.states(i), m = qp.controls(i), x = state_at[i], w = control_at[i];
    H.block(x, x, n, n) = Q_of(qp, i);
    g.segment(x, n) = q_of(qp, i);
    if (m > 0) {
      H.block(w, x, m, n) = S_of(qp, i);
      H.block(x, w, n, m) = S_of(qp, i).transpose();
      H.block(w, w, m, m) = R_of(qp, i);
      g.segment(w, m) = r_of(qp, i);
    }
    if (i == N) break;
    for (int k = 0; k < qp.states(i + 1); ++k) {
      Eigen::VectorXd row = Eigen::VectorXd::Zero(size);
      row.segment(x, n) = A_of(qp, i).row(k);
      if (m > 0) row.segment(w, m) = B_of(qp, i).row(k);
      row[state_at[i + 1] + k] = -1.0;
      rows.push_back(row);
      right.push_back(-qp.b(i)[k]);
    }
  }
  if (qp.initial_state_is_given) {
    for (int k = 0; k < qp.states(0); ++k) {
      rows.push_back(Eigen::VectorXd::Unit(size, k));
      right.push_back(qp.initial_step()[k]);
    }
  }
  dynamics_rows = static_cast<int>(rows.size());
  const auto hold = [&](int variable, int side, double lower, double upper) {
    if (side == 0) return;
    rows.push_back(Eigen::VectorXd::Unit(size, variable));
    right.push_back(side < 0 ? lower : upper);
  };
  for (int i = 0; i <= N; ++i) {
    if (i > 0 || !qp.initial_state_is_given)
      for (int k = 0; k < qp.states(i); ++k)
        hold(state_at[i] + k, active.state(i)[k], qp.state_lower(i)[k], qp.state_upper(i)[k]);
    if (i < N)
      for (int k = 0; k < qp.controls(i); ++k)
        hold(control_at[i] + k, active.control(i)[k], qp.control_lower(i)[k], qp.control_upper(i)[k]);
  }
  E.resize(static_cast<int>(rows.size()), size);
  e.resize(E.rows());
  for (int r = 0; r < E.rows(); ++r) {
    E.row(r) = rows[r];
    e[r] = right[r];
  }
}

Eigen::VectorXd DenseQp::solve() const {
  const auto n = H.rows(), m = E.rows();
  Eigen::MatrixXd kkt = Eigen::MatrixXd::Zero(n + m, n + m);
  kkt.topLeftCorner(n, n) = H;
  kkt.topRightCorner(n, m) = E.transpose();
  kkt.bottomLeftCorner(m, n) = E;
  Eigen::VectorXd right(n + m);
  right << -g, e;
  return kkt.fullPivLu().solve(right);
}

}  // namespace rhec::testing
