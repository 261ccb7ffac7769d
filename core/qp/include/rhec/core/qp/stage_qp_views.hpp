#pragma once

#include <cstddef>

#include <Eigen/Core>

#include "rhec/core/qp/stage_qp.hpp"

namespace rhec {

// A stage of a StageQp as Eigen views of its true size. They refer to the QP's memory. In a header of their own,
// because few need Eigen and it takes long to compile.

using StageRows =
    Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>, 0, Eigen::OuterStride<>>;
using ConstStageRows =
    Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>, 0, Eigen::OuterStride<>>;
using ConstStageVector = Eigen::Map<const Eigen::VectorXd>;

namespace views {

inline StageRows rows(StageQp& qp, double* first, int count, int length) {
  return {first, count, length, Eigen::OuterStride<>(qp.stride())};
}
inline ConstStageRows rows(const StageQp& qp, const double* first, int count, int length) {
  return {first, count, length, Eigen::OuterStride<>(qp.stride())};
}
/// The first row of H that belongs to a control.
template <class Qp>
auto* control_rows(Qp& qp, int i) {
  return qp.H(i) + static_cast<std::ptrdiff_t>(qp.capacity().states) * qp.stride();
}

}  // namespace views

/// n_s of the next stage x n_s.
inline StageRows A_of(StageQp& qp, int i) { return views::rows(qp, qp.AB(i), qp.states(i + 1), qp.states(i)); }
inline ConstStageRows A_of(const StageQp& qp, int i) {
  return views::rows(qp, qp.AB(i), qp.states(i + 1), qp.states(i));
}
/// n_s of the next stage x n_w.
inline StageRows B_of(StageQp& qp, int i) {
  return views::rows(qp, qp.AB(i) + qp.capacity().states, qp.states(i + 1), qp.controls(i));
}
inline ConstStageRows B_of(const StageQp& qp, int i) {
  return views::rows(qp, qp.AB(i) + qp.capacity().states, qp.states(i + 1), qp.controls(i));
}
/// n_s x n_s.
inline StageRows Q_of(StageQp& qp, int i) { return views::rows(qp, qp.H(i), qp.states(i), qp.states(i)); }
inline ConstStageRows Q_of(const StageQp& qp, int i) { return views::rows(qp, qp.H(i), qp.states(i), qp.states(i)); }
/// n_w x n_s. Whoever writes it writes its transpose too.
inline StageRows S_of(StageQp& qp, int i) {
  return views::rows(qp, views::control_rows(qp, i), qp.controls(i), qp.states(i));
}
inline ConstStageRows S_of(const StageQp& qp, int i) {
  return views::rows(qp, views::control_rows(qp, i), qp.controls(i), qp.states(i));
}
inline StageRows S_transposed_of(StageQp& qp, int i) {
  return views::rows(qp, qp.H(i) + qp.capacity().states, qp.states(i), qp.controls(i));
}
/// n_w x n_w.
inline StageRows R_of(StageQp& qp, int i) {
  return views::rows(qp, views::control_rows(qp, i) + qp.capacity().states, qp.controls(i), qp.controls(i));
}
inline ConstStageRows R_of(const StageQp& qp, int i) {
  return views::rows(qp, views::control_rows(qp, i) + qp.capacity().states, qp.controls(i), qp.controls(i));
}
inline ConstStageVector b_of(const StageQp& qp, int i) { return {qp.b(i), qp.states(i + 1)}; }
inline ConstStageVector q_of(const StageQp& qp, int i) { return {qp.q(i), qp.states(i)}; }
inline ConstStageVector r_of(const StageQp& qp, int i) { return {qp.r(i), qp.controls(i)}; }

}  // namespace rhec
