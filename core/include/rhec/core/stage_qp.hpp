#pragma once

#include <cstddef>
#include <vector>

#include <Eigen/Core>

#include "rhec/core/iterate.hpp"

namespace rhec {

/// An Ocp linearised at a point, in the steps (ds_i, dw_i) from there:
///
///     minimise    sum_{i=0}^{N} 1/2 [ds; dw]' [Q S'; S R] [ds; dw] + q' ds + r' dw        (no dw at node N)
///     subject to  ds_{i+1} = A ds_i + B dw_i + b_i
///                 state_lower_i <= ds_i <= state_upper_i,  control_lower_i <= dw_i <= control_upper_i
///                 ds_0 = initial_step where the initial state is given
///
/// Sizes are per stage and at run time; storage is column-major with the capacity's leading dimensions (n_s for A B Q,
/// n_w for S R), so that it never moves. S is n_w x n_s.
class RHEC_EXPORT StageQp {
 public:
  using Matrix = Eigen::Map<Eigen::MatrixXd, 0, Eigen::OuterStride<>>;
  using ConstMatrix = Eigen::Map<const Eigen::MatrixXd, 0, Eigen::OuterStride<>>;
  using Vector = Eigen::Map<Eigen::VectorXd>;
  using ConstVector = Eigen::Map<const Eigen::VectorXd>;

  StageQp() = default;
  explicit StageQp(const Capacity& capacity);

  const Capacity& capacity() const noexcept { return capacity_; }
  int intervals() const noexcept { return intervals_; }
  int states(int node) const noexcept { return state_counts_[node]; }
  int controls(int interval) const noexcept { return interval < intervals_ ? control_counts_[interval] : 0; }
  void set_intervals(int intervals) noexcept { intervals_ = intervals; }
  void set_sizes(int node, int states, int controls) noexcept {
    state_counts_[node] = states;
    control_counts_[node] = controls;
  }
  bool initial_state_is_given = false;

  // Raw access for kernels: pointers to stage i.
  double* A(int i) noexcept { return at(A_, i, ns_ * ns_); }
  double* B(int i) noexcept { return at(B_, i, ns_ * nw_); }
  double* b(int i) noexcept { return at(b_, i, ns_); }
  double* Q(int i) noexcept { return at(Q_, i, ns_ * ns_); }
  double* S(int i) noexcept { return at(S_, i, nw_ * ns_); }
  double* R(int i) noexcept { return at(R_, i, nw_ * nw_); }
  double* q(int i) noexcept { return at(q_, i, ns_); }
  double* r(int i) noexcept { return at(r_, i, nw_); }
  double* state_lower(int i) noexcept { return at(state_lower_, i, ns_); }
  double* state_upper(int i) noexcept { return at(state_upper_, i, ns_); }
  double* control_lower(int i) noexcept { return at(control_lower_, i, nw_); }
  double* control_upper(int i) noexcept { return at(control_upper_, i, nw_); }
  double* initial_step() noexcept { return initial_step_.data(); }
  const double* A(int i) const noexcept { return at(A_, i, ns_ * ns_); }
  const double* B(int i) const noexcept { return at(B_, i, ns_ * nw_); }
  const double* b(int i) const noexcept { return at(b_, i, ns_); }
  const double* Q(int i) const noexcept { return at(Q_, i, ns_ * ns_); }
  const double* S(int i) const noexcept { return at(S_, i, nw_ * ns_); }
  const double* R(int i) const noexcept { return at(R_, i, nw_ * nw_); }
  const double* q(int i) const noexcept { return at(q_, i, ns_); }
  const double* r(int i) const noexcept { return at(r_, i, nw_); }
  const double* state_lower(int i) const noexcept { return at(state_lower_, i, ns_); }
  const double* state_upper(int i) const noexcept { return at(state_upper_, i, ns_); }
  const double* control_lower(int i) const noexcept { return at(control_lower_, i, nw_); }
  const double* control_upper(int i) const noexcept { return at(control_upper_, i, nw_); }
  const double* initial_step() const noexcept { return initial_step_.data(); }

  // The same as Eigen views of the stage's true size.
  ConstMatrix A_of(int i) const { return {A(i), states(i + 1), states(i), Eigen::OuterStride<>(ns_)}; }
  ConstMatrix B_of(int i) const { return {B(i), states(i + 1), controls(i), Eigen::OuterStride<>(ns_)}; }
  ConstVector b_of(int i) const { return {b(i), states(i + 1)}; }
  ConstMatrix Q_of(int i) const { return {Q(i), states(i), states(i), Eigen::OuterStride<>(ns_)}; }
  ConstMatrix S_of(int i) const { return {S(i), controls(i), states(i), Eigen::OuterStride<>(nw_)}; }
  ConstMatrix R_of(int i) const { return {R(i), controls(i), controls(i), Eigen::OuterStride<>(nw_)}; }
  ConstVector q_of(int i) const { return {q(i), states(i)}; }
  ConstVector r_of(int i) const { return {r(i), controls(i)}; }

 private:
  static double* at(std::vector<double>& v, int i, int size) noexcept {
    return v.data() + static_cast<std::ptrdiff_t>(i) * size;
  }
  static const double* at(const std::vector<double>& v, int i, int size) noexcept {
    return v.data() + static_cast<std::ptrdiff_t>(i) * size;
  }

  Capacity capacity_;
  int ns_ = 0, nw_ = 0, intervals_ = 0;
  std::vector<int> state_counts_, control_counts_;
  std::vector<double> A_, B_, b_, Q_, S_, R_, q_, r_;
  std::vector<double> state_lower_, state_upper_, control_lower_, control_upper_, initial_step_;
};

}  // namespace rhec
