#include "stage_covariances.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include "rhec/core/qp/stage_qp_views.hpp"

namespace rhec::sparse_sqp {

bool stage_covariances(const StageQp& qp, std::span<double> blocks) {
  const int N = qp.intervals();
  std::vector<Eigen::MatrixXd> closed(N), spread(N);  // F and B L^-T of each stage
  Eigen::MatrixXd P = Q_of(qp, N);
  Eigen::LLT<Eigen::MatrixXd> factor;
  for (int i = N - 1; i >= 0; --i) {
    const Eigen::MatrixXd A = A_of(qp, i), PA = P * A;
    closed[i] = A;
    spread[i] = B_of(qp, i);
    Eigen::MatrixXd next = Q_of(qp, i);
    next.noalias() += A.transpose() * PA;
    if (qp.controls(i) > 0) {
      const Eigen::MatrixXd B = B_of(qp, i);
      const Eigen::MatrixXd reduced = R_of(qp, i) + B.transpose() * P * B;
      factor.compute(reduced);
      if (factor.info() != Eigen::Success) return false;
      const Eigen::MatrixXd W = factor.matrixL().solve(S_of(qp, i) + B.transpose() * PA);
      spread[i] = factor.matrixL().solve(B.transpose()).transpose();
      closed[i].noalias() -= spread[i] * W;
      next.noalias() -= W.transpose() * W;
    }
    P = 0.5 * (next + next.transpose());
  }

  const auto stride = static_cast<std::ptrdiff_t>(qp.capacity().states);
  std::vector<double> all(static_cast<std::size_t>((N + 1) * stride * stride), 0.0);
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(qp.states(0), qp.states(0));
  if (!qp.initial_state_is_given) {
    factor.compute(P);
    if (factor.info() != Eigen::Success) return false;
    covariance = 2.0 * factor.solve(Eigen::MatrixXd::Identity(P.rows(), P.cols()));
  }
  for (int i = 0; i <= N; ++i) {
    Eigen::Map<Eigen::MatrixXd, 0, Eigen::OuterStride<>>(all.data() + i * stride * stride, qp.states(i), qp.states(i),
                                                         Eigen::OuterStride<>(stride)) =
        0.5 * (covariance + covariance.transpose());
    if (i == N) break;
    covariance = (closed[i] * covariance * closed[i].transpose()).eval();
    covariance.noalias() += 2.0 * spread[i] * spread[i].transpose();
  }
  if (!std::all_of(all.begin(), all.end(), [](double value) { return std::isfinite(value); })) return false;
  std::copy(all.begin(), all.end(), blocks.begin());
  return true;
}

}  // namespace rhec::sparse_sqp
