#include "feedback.hpp"

#include <algorithm>
#include <cmath>

#include "rhec/core/qp/stage_qp_views.hpp"

namespace rhec::nlopt {
namespace {

using Matrix = Eigen::MatrixXd;

/// Products of matrices are square only where the number of states stays the same.
double largest_diagonal(const Matrix& product) {
  const Eigen::Index n = std::min(product.rows(), product.cols());
  double largest = 0.0;
  for (Eigen::Index k = 0; k < n; ++k) largest = std::max(largest, std::abs(product(k, k)));
  return largest;
}

}  // namespace

void Regulator::setup(const Ocp& ocp) {
  const Capacity capacity = ocp.capacity();
  qp_ = StageQp(capacity);
  is_possible_ = std::max(capacity.states, capacity.controls) <= Riccati::max_width;
  if (!is_possible_) return;
  riccati_ = Riccati(capacity);
  fixed_ = ActiveSet(capacity);
  step_ = Iterate(capacity);
}

double Regulator::growth(const Ocp& ocp, const Iterate& along, std::span<double> scratch) {
  ocp.linearise(all_stages(ocp), along, Hessian::none, qp_, scratch);
  const int N = ocp.intervals();
  double largest = 1.0;
  Matrix product = Matrix::Identity(qp_.states(0), qp_.states(0));
  for (int i = 0; i < N; ++i) {
    product = Matrix(A_of(qp_, i) * product);
    largest = std::max(largest, largest_diagonal(product));
  }
  product = Matrix::Identity(qp_.states(N), qp_.states(N));
  for (int i = N - 1; i >= 0; --i) {
    product = Matrix(product * A_of(qp_, i));
    largest = std::max(largest, largest_diagonal(product));
  }
  return product.allFinite() ? largest : HUGE_VAL;
}

std::shared_ptr<const Feedback> Regulator::about(const Ocp& ocp, const Iterate& iterate, std::span<double> scratch) {
  if (!is_possible_) return nullptr;
  const int N = ocp.intervals();
  ocp.linearise(all_stages(ocp), iterate, Hessian::gauss_newton, qp_, scratch);
  fixed_.clear();
  for (int i = 0; i < N; ++i)
    for (int j = 0; j < ocp.control_count(i); ++j)
      if (ocp.control_lower(i)[j] == ocp.control_upper(i)[j]) fixed_.control(i)[j] = 1;
  riccati_.factor(qp_, fixed_);
  if (riccati_.solve(qp_, fixed_, step_) != Riccati::Outcome::done) return nullptr;
  const auto feedback = std::make_shared<Feedback>();
  feedback->about = iterate;
  double step[Riccati::max_width] = {}, at_zero[Riccati::max_width], control[Riccati::max_width];
  for (int i = 0; i < N; ++i) {
    const int states = ocp.state_count(i), controls = ocp.control_count(i);
    Matrix& K = feedback->gains.emplace_back(controls, states);
    if (controls == 0) continue;
    riccati_.feedback(qp_, i, step, at_zero);
    for (int j = 0; j < states; ++j) {
      step[j] = 1.0;
      riccati_.feedback(qp_, i, step, control);
      step[j] = 0.0;
      for (int k = 0; k < controls; ++k) K(k, j) = fixed_.control(i)[k] != 0 ? 0.0 : control[k] - at_zero[k];
    }
    if (!K.allFinite()) return nullptr;
  }
  return feedback;
}

}  // namespace rhec::nlopt
