#include "stage_convexity.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include "rhec/core/qp/stage_qp_views.hpp"

namespace rhec::sparse_sqp {
namespace {

// A pivot below this share of its terms counts as zero. Zero is accepted: a pivot of a Gauss-Newton QP may be zero.
constexpr double rounding = 1e-13;
// Once the recursion has visited each stage this often on average, all stages take the Gauss-Newton Hessian.
constexpr int most_work = 8;
// Weight that holds a state at its bound, relative to the largest cost of a state.
constexpr double stiff = 1e8;

class Recursion {
 public:
  Recursion(StageQp& qp, const StageQp& gauss_newton, std::span<const std::uint8_t> fixed)
      : qp_(qp),
        gauss_newton_(gauss_newton),
        fixed_(fixed),
        given_up_(static_cast<std::size_t>(qp.intervals()) + 1, 0),
        costs_to_go_(static_cast<std::size_t>(qp.intervals()) + 1) {
    std::ptrdiff_t variable = qp.initial_state_is_given ? 0 : qp.states(0);
    for (int i = 0; i < qp.intervals(); ++i) {
      control_starts_.push_back(variable);
      variable += qp.controls(i) + qp.states(i + 1);
    }
    for (int i = 0; i <= qp.intervals(); ++i)
      for (int j = 0; j < qp.states(i); ++j) largest_cost_ = std::max(largest_cost_, std::abs(Q_of(qp, i)(j, j)));
  }

  int run() {
    const int stages = qp_.intervals() + 1;
    int start = stages - 1, reach = 1, last_failure = -1;
    for (int failure = recurse_from(start); failure >= 0; failure = recurse_from(start)) {
      if (failure == last_failure && reach >= stages - failure)
        break;  // not even Gauss-Newton has a positive pivot here
      reach = failure == last_failure ? 2 * reach : 1;
      last_failure = failure;
      const bool is_hopeless = work_ > most_work * stages;
      start = is_hopeless ? stages - 1 : std::min(failure + reach, stages) - 1;
      if (is_hopeless) reach = stages;
      for (int i = is_hopeless ? 0 : failure; i <= start; ++i) give_up(i);
    }
    return static_cast<int>(std::count(given_up_.begin(), given_up_.end(), 1));
  }

 private:
  void give_up(int i) {
    given_up_[i] = 1;
    const std::ptrdiff_t rows = qp_.capacity().states + qp_.capacity().controls;
    std::copy_n(gauss_newton_.H(i), rows * qp_.stride(), qp_.H(i));
  }

  /// Recursion from stage `start`; the costs-to-go of later stages are known. Returns the stage whose pivot is not
  /// positive definite, or -1.
  int recurse_from(int start) {
    for (int i = start; i >= 0; --i) {
      ++work_;
      Eigen::MatrixXd next = Q_of(qp_, i);
      if (i < qp_.intervals()) {
        const Eigen::MatrixXd& P = costs_to_go_[i + 1];
        const Eigen::MatrixXd A = A_of(qp_, i), PA = P * A;
        next.noalias() += A.transpose() * PA;
        free_.clear();
        for (int j = 0; j < qp_.controls(i); ++j)
          if (fixed_.empty() || fixed_[control_starts_[i] + j] == 0) free_.push_back(j);
        if (!free_.empty()) {
          const Eigen::MatrixXd B = B_of(qp_, i)(Eigen::all, free_), BPB = B.transpose() * P * B;
          const Eigen::MatrixXd R = R_of(qp_, i)(free_, free_);
          if (!factor(R + BPB, R.diagonal().cwiseAbs() + BPB.diagonal().cwiseAbs())) return i;
          Eigen::MatrixXd W = S_of(qp_, i)(free_, Eigen::all);
          W.noalias() += B.transpose() * PA;
          factor_.matrixL().solveInPlace(W);
          next.noalias() -= W.transpose() * W;
        }
      }
      costs_to_go_[i] = 0.5 * (next + next.transpose());
      if (i > 0 && !fixed_.empty()) hold(costs_to_go_[i], control_starts_[i - 1] + qp_.controls(i - 1));
    }
    if (qp_.initial_state_is_given || qp_.states(0) == 0) return -1;
    const Eigen::MatrixXd& P = costs_to_go_[0];
    return factor(P, P.diagonal().cwiseAbs() + Q_of(qp_, 0).diagonal().cwiseAbs()) ? -1 : 0;
  }

  bool factor(const Eigen::MatrixXd& pivot, const Eigen::VectorXd& sizes) {
    const double least = std::max(rounding * rounding * sizes.maxCoeff(), std::numeric_limits<double>::min());
    const Eigen::VectorXd zero = (rounding * sizes).cwiseMax(least);
    Eigen::MatrixXd raised = pivot;
    raised.diagonal() += zero;
    factor_.compute(raised);
    return factor_.info() == Eigen::Success;
  }

  /// Adds to a cost-to-go the weights that hold its fixed states.
  void hold(Eigen::MatrixXd& P, std::ptrdiff_t start) const {
    for (Eigen::Index j = 0; j < P.rows(); ++j)
      if (fixed_[start + j] != 0) P(j, j) += stiff * largest_cost_;
  }

  StageQp& qp_;
  const StageQp& gauss_newton_;
  std::span<const std::uint8_t> fixed_;
  std::vector<std::uint8_t> given_up_;
  std::vector<Eigen::MatrixXd> costs_to_go_;
  std::vector<std::ptrdiff_t> control_starts_;
  std::vector<int> free_;
  double largest_cost_ = 1.0;
  std::int64_t work_ = 0;  ///< stages visited by the recursion, counted each time
  Eigen::LLT<Eigen::MatrixXd> factor_;
};

}  // namespace

int convexify_by_stages(StageQp& qp, const StageQp& gauss_newton, std::span<const std::uint8_t> fixed) {
  return Recursion(qp, gauss_newton, fixed).run();
}

}  // namespace rhec::sparse_sqp
